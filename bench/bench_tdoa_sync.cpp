// SPDX-License-Identifier: MIT
// Cost of one sync frame, of one stamp in control time, and of one uplink and downlink difference.
#include <cstdint>

#include <benchmark/benchmark.h>

#include <uwbpos/ranging/tdoa_downlink.hpp>
#include <uwbpos/ranging/tdoa_uplink.hpp>
#include <uwbpos/sim/noise.hpp>
#include <uwbpos/time/clock_sync.hpp>

namespace {

using namespace uwbpos;

// Frames 0.1 s apart by clocks 20 ppm apart, stamped to within a quarter of a nanosecond.
template <class S>
struct Frames {
  ClockSync<S> sync;
  std::uint64_t control = 0;
  std::uint64_t anchor = 1'000'000;
  std::int64_t host = 0;
  sim::Random random{"bench frames"};

  auto next() {
    control += 6'389'760'000;
    anchor += 6'389'632'205 + (random.bits() & 31) - 16;
    host += 100'000;
    return sync.update(DeviceTime<>{control}, DeviceTime<>{anchor}, S(87e-9), host);
  }
};

template <class S>
void clock_sync(benchmark::State& state) {
  Frames<S> frames;
  for (auto _ : state) benchmark::DoNotOptimize(frames.next());
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(clock_sync<float>);
BENCHMARK(clock_sync<double>);

// An anchor's stamp and the control anchor's, to a range difference.
template <class S>
void uplink_difference(benchmark::State& state) {
  Frames<S> frames;
  for (int i = 0; i < 20; ++i) benchmark::DoNotOptimize(frames.next());
  const auto zero = control_arrival<S>(DeviceTime<>{frames.control + 1'000'000});
  for (auto _ : state) {
    const std::uint64_t stamp = frames.anchor + 1'000'000 + (frames.random.bits() & 1023);
    const auto one = anchor_arrival<S>(frames.sync, DeviceTime<>{stamp}, frames.host);
    benchmark::DoNotOptimize(tdoa_uplink_difference(*zero, *one));
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(uplink_difference<float>);
BENCHMARK(uplink_difference<double>);

template <class S>
void downlink_difference(benchmark::State& state) {
  DownlinkStamps stamps{.a_rx = DeviceTime<>{1},
                        .b_rx = DeviceTime<>{128'001'000},
                        .a_rx_at_b = DeviceTime<>{7},
                        .b_tx = DeviceTime<>{128'000'000}};
  sim::Random random{"bench downlink"};
  for (auto _ : state) {
    stamps.b_rx = DeviceTime<>{128'001'000 + (random.bits() & 1023)};
    benchmark::DoNotOptimize(tdoa_downlink_difference<S>(stamps, {S(1e-6), S(1e-18)}, S(15e-9)));
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(downlink_difference<float>);
BENCHMARK(downlink_difference<double>);

}  // namespace
