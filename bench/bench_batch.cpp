// SPDX-License-Identifier: MIT
// Epochs by the thousand, beside the same one by one. Compiled twice: for the baseline and, where
// the compiler can, for AVX2 with fused products (bench_batch_avx2).
#include <vector>

#include <benchmark/benchmark.h>

#include <uwbpos/sim/noise.hpp>
#include <uwbpos/solve/batch.hpp>

namespace {

using namespace uwbpos;

constexpr std::size_t kEpochs = 1024;

// Eight anchors or more in the corners and along the walls of a hall, tags anywhere in it.
template <class S>
struct Hall {
  std::vector<Vec<S, 3>> anchors;
  std::vector<S> sigmas;
  std::vector<S> ranges;
  std::vector<S> differences;
  std::vector<std::vector<RangeTo<S, 3>>> range_sets;
  std::vector<std::vector<DifferenceTo<S, 3>>> difference_sets;

  explicit Hall(int count) {
    sim::Random random{"hall"};
    for (int i = 0; i < count; ++i) {
      const double angle = 6.283 * i / count;
      anchors.push_back(
          {S(10 + 12 * std::cos(angle)), S(7.5 + 9 * std::sin(angle)), i % 2 == 0 ? S(0.3) : S(4)});
      sigmas.push_back(S(0.1));
    }
    const std::size_t n = anchors.size();
    ranges.resize(n * kEpochs);
    differences.resize((n - 1) * kEpochs);
    for (std::size_t e = 0; e < kEpochs; ++e) {
      const Vec<S, 3> tag{S(random.uniform(1, 19)), S(random.uniform(1, 14)),
                          S(random.uniform(0.5, 2))};
      auto& range_set = range_sets.emplace_back();
      auto& difference_set = difference_sets.emplace_back();
      for (std::size_t i = 0; i < n; ++i) {
        const S range = norm<S, 3>(tag - anchors[i]) + S(random.normal(0, 0.1));
        ranges[i * kEpochs + e] = range;
        range_set.push_back({anchors[i], range, S(0.1)});
        if (i == 0) continue;
        differences[(i - 1) * kEpochs + e] = range - ranges[e];
        difference_set.push_back({anchors[i], range - ranges[e]});
      }
    }
  }
};

template <class T>
std::vector<Result<T>> places() {
  return std::vector<Result<T>>(kEpochs, std::unexpected(Error::TooFewMeasurements));
}

void count(benchmark::State& state) {
  state.SetItemsProcessed(state.iterations() * std::int64_t(kEpochs));
}

template <class S>
void toa_batch(benchmark::State& state) {
  const Hall<S> hall{static_cast<int>(state.range(0))};
  auto fixes = places<Fix<S, 3>>();
  const RangeBatch<S, 3> batch{hall.anchors, hall.sigmas, hall.ranges};
  for (auto _ : state) benchmark::DoNotOptimize(toa_least_squares(batch, std::span{fixes}));
  count(state);
}
template <class S>
void toa_single(benchmark::State& state) {
  const Hall<S> hall{static_cast<int>(state.range(0))};
  auto fixes = places<Fix<S, 3>>();
  for (auto _ : state) {
    for (std::size_t e = 0; e < kEpochs; ++e) fixes[e] = toa_least_squares(hall.range_sets[e]);
    benchmark::DoNotOptimize(fixes);
  }
  count(state);
}
template <class S>
void closed_batch(benchmark::State& state) {
  const Hall<S> hall{static_cast<int>(state.range(0))};
  auto mirrors = places<Mirror<S, 3>>();
  const RangeBatch<S, 3> batch{hall.anchors, hall.sigmas, hall.ranges};
  for (auto _ : state) benchmark::DoNotOptimize(toa_closed_form(batch, std::span{mirrors}));
  count(state);
}
template <class S>
void closed_single(benchmark::State& state) {
  const Hall<S> hall{static_cast<int>(state.range(0))};
  auto mirrors = places<Mirror<S, 3>>();
  for (auto _ : state) {
    for (std::size_t e = 0; e < kEpochs; ++e) mirrors[e] = toa_closed_form(hall.range_sets[e]);
    benchmark::DoNotOptimize(mirrors);
  }
  count(state);
}
template <class S>
void tdoa_batch(benchmark::State& state) {
  const Hall<S> hall{static_cast<int>(state.range(0))};
  auto fixes = places<Fix<S, 3>>();
  const DifferenceBatch<S, 3> batch{hall.anchors[0], std::span{hall.anchors}.subspan(1), S(0.1),
                                    hall.differences};
  for (auto _ : state) benchmark::DoNotOptimize(locate(batch, std::span{fixes}));
  count(state);
}
template <class S>
void tdoa_single(benchmark::State& state) {
  const Hall<S> hall{static_cast<int>(state.range(0))};
  auto fixes = places<Fix<S, 3>>();
  for (auto _ : state) {
    for (std::size_t e = 0; e < kEpochs; ++e) {
      fixes[e] = tdoa_least_squares(hall.anchors[0], hall.difference_sets[e], S(0.1));
    }
    benchmark::DoNotOptimize(fixes);
  }
  count(state);
}

BENCHMARK(toa_batch<float>)->Arg(8)->Arg(32);
BENCHMARK(toa_single<float>)->Arg(8)->Arg(32);
BENCHMARK(toa_batch<double>)->Arg(8);
BENCHMARK(toa_single<double>)->Arg(8);
BENCHMARK(closed_batch<float>)->Arg(8)->Arg(32);
BENCHMARK(closed_single<float>)->Arg(8)->Arg(32);
BENCHMARK(tdoa_batch<float>)->Arg(8)->Arg(32);
BENCHMARK(tdoa_single<float>)->Arg(8)->Arg(32);

}  // namespace
