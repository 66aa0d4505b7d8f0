// SPDX-License-Identifier: MIT
// Cost of one two-way range, of one ultrasonic length, of one step of the rate tracker and of one
// look into a bias table.
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <benchmark/benchmark.h>

#include <uwbpos/ranging/ds_twr.hpp>
#include <uwbpos/ranging/range_bias.hpp>
#include <uwbpos/ranging/ss_twr.hpp>
#include <uwbpos/ranging/ultrasonic.hpp>
#include <uwbpos/sim/noise.hpp>
#include <uwbpos/time/rate_tracker.hpp>

namespace {

using namespace uwbpos;

constexpr std::size_t kCount = 1024;

// Exchanges at 1 … 100 m, replies of 0.3 … 3 ms, the counters anywhere.
std::vector<DsTwrStamps> exchanges() {
  sim::Random random{"bench ranging"};
  std::vector<DsTwrStamps> all;
  for (std::size_t i = 0; i < kCount; ++i) {
    const DeviceTime<> a{random.bits()};
    const DeviceTime<> b{random.bits()};
    const std::int64_t flight = random.integer(200, 20000);
    const std::int64_t reply_b = random.integer(20'000'000, 200'000'000);
    const std::int64_t reply_a = random.integer(20'000'000, 200'000'000);
    const DeviceTime<> response = a + (reply_b + 2 * flight);
    all.push_back(
        {a, b, b + reply_b, response, response + reply_a, b + (reply_b + reply_a + 2 * flight)});
  }
  return all;
}

template <class S>
void ds_twr_asymmetric(benchmark::State& state) {
  const auto all = exchanges();
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(ds_twr_range<S>(all[i++ % kCount]));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(ds_twr_asymmetric<float>);
BENCHMARK(ds_twr_asymmetric<double>);

template <class S>
void ds_twr_symmetric(benchmark::State& state) {
  const auto all = exchanges();
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(ds_twr_range_symmetric<S>(all[i++ % kCount]));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(ds_twr_symmetric<float>);
BENCHMARK(ds_twr_symmetric<double>);

template <class S>
void ss_twr(benchmark::State& state) {
  const auto all = exchanges();
  TwrOptions<S> options;
  options.clock_offset = S(1e-9);
  options.sigma_clock_offset = S(1e-8);
  std::size_t i = 0;
  for (auto _ : state) {
    const DsTwrStamps& s = all[i++ % kCount];
    benchmark::DoNotOptimize(
        ss_twr_range<S>({s.poll_tx, s.poll_rx, s.resp_tx, s.resp_rx}, options));
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(ss_twr<float>);
BENCHMARK(ss_twr<double>);

template <class S>
void ds_twr_offset(benchmark::State& state) {
  const auto all = exchanges();
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(ds_twr_clock_offset<S>(all[i++ % kCount]));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(ds_twr_offset<float>);
BENCHMARK(ds_twr_offset<double>);

template <class S>
void length_of_ultrasound(benchmark::State& state) {
  sim::Random random{"bench counts"};
  std::vector<std::uint32_t> counts(kCount);
  for (auto& count : counts) count = static_cast<std::uint32_t>(random.integer(100, 60'000));
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(ultrasonic_length<S>(counts[i++ % kCount]));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(length_of_ultrasound<float>);
BENCHMARK(length_of_ultrasound<double>);

// Stamps 143 ms apart by clocks 10 ppm apart, with noise of a nanosecond.
template <class S>
void rate_tracker(benchmark::State& state) {
  sim::Random random{"bench stamps"};
  std::vector<std::int64_t> noise(kCount);
  for (auto& ticks : noise) ticks = static_cast<std::int64_t>(random.normal(0, 64));
  RateTracker<S, 32> tracker;
  std::int64_t time = 0;
  std::int64_t host = 0;
  std::size_t i = 0;
  for (auto _ : state) {
    time += 9'128'000'000;
    host += 142'857;
    const auto a = static_cast<std::uint64_t>(time + noise[i]);
    const auto b = static_cast<std::uint64_t>(time + time / 100'000 - noise[i]);
    i = (i + 1) % kCount;
    benchmark::DoNotOptimize(tracker.update(DeviceTime<32>{a}, DeviceTime<32>{b}, host));
  }
  state.counters["tracked"] = tracker.rate() ? 1 : 0;
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(rate_tracker<float>);
BENCHMARK(rate_tracker<double>);

template <class S>
void range_bias(benchmark::State& state) {
  std::array<RangeBiasPoint<S>, 17> points{};
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i] = {S(-95) + 2 * static_cast<S>(i), S(0.25) - S(0.02) * static_cast<S>(i)};
  }
  const auto table = RangeBias<S>::make(points);
  sim::Random random{"bench powers"};
  std::vector<S> powers(kCount);
  for (S& power : powers) power = static_cast<S>(random.uniform(-100, -60));
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(table->at(powers[i++ % kCount]));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(range_bias<float>);
BENCHMARK(range_bias<double>);

}  // namespace
