// SPDX-License-Identifier: MIT
// Cost of one position from range differences, for each solver; `rms_m` shows what it buys. Eight
// anchors around a hall of 20 m × 15 m, tags anywhere in it, σ = 0.1 m an arrival.
#include <cmath>
#include <cstddef>
#include <vector>

#include <benchmark/benchmark.h>

#include <uwbpos/sim/noise.hpp>
#include <uwbpos/solve/bancroft.hpp>
#include <uwbpos/solve/locate.hpp>
#include <uwbpos/solve/tdoa_chan.hpp>
#include <uwbpos/solve/tdoa_fang.hpp>

namespace {

using namespace uwbpos;

constexpr std::size_t kCount = 1024;

template <class S>
struct Snapshot {
  Vec<S, 3> tag;
  Vec<S, 3> reference;
  std::vector<DifferenceTo<S, 3>> differences;
  std::vector<RangeTo<S, 3>> pseudoranges;
  std::vector<PairDifference<S, 3>> ring;
};

template <class S>
std::vector<Snapshot<S>> snapshots() {
  sim::Random random{"bench tdoa"};
  std::vector<Snapshot<S>> all(kCount);
  for (auto& snapshot : all) {
    snapshot.tag = {S(random.uniform(1, 19)), S(random.uniform(1, 14)), S(random.uniform(0.5, 2))};
    for (int i = 0; i < 8; ++i) {
      const Vec<S, 3> anchor{((i & 1) ^ (i >> 1 & 1)) != 0 ? S(20) : S(0),
                             (i & 2) != 0 ? S(15) : S(0), (i & 4) != 0 ? S(4) : S(0.3)};
      snapshot.pseudoranges.push_back(
          {anchor, (snapshot.tag - anchor).norm() + S(random.normal(5, 0.1)), S(0.1)});
    }
    snapshot.reference = snapshot.pseudoranges[0].anchor;
    for (std::size_t i = 1; i < 8; ++i) {
      snapshot.differences.push_back(
          {snapshot.pseudoranges[i].anchor,
           snapshot.pseudoranges[i].range - snapshot.pseudoranges[0].range});
    }
    for (std::size_t i = 0; i < 8; ++i) {
      const auto& a = snapshot.pseudoranges[i];
      const auto& b = snapshot.pseudoranges[(i + 1) % 8];
      snapshot.ring.push_back({a.anchor, b.anchor, b.range - a.range, S(0.1414)});
    }
  }
  return all;
}

template <class S, class Solve>
void run(benchmark::State& state, const Solve& solve) {
  const auto all = snapshots<S>();
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(solve(all[i++ % kCount]));
  double squares = 0;
  std::size_t solved = 0;
  for (const auto& snapshot : all) {
    if (const auto fix = solve(snapshot)) {
      squares += static_cast<double>((fix->position - snapshot.tag).squaredNorm());
      ++solved;
    }
  }
  state.counters["rms_m"] = std::sqrt(squares / static_cast<double>(solved));
  state.counters["refused"] = static_cast<double>(kCount - solved);
  state.SetItemsProcessed(state.iterations());
}

template <class S>
void chan(benchmark::State& state) {
  run<S>(state, [](const auto& s) { return tdoa_chan(s.reference, s.differences, S(0.1)); });
}
BENCHMARK(chan<float>);
BENCHMARK(chan<double>);

template <class S>
void locate_shared_reference(benchmark::State& state) {
  run<S>(state, [](const auto& s) { return locate(s.reference, s.differences, S(0.1)); });
}
BENCHMARK(locate_shared_reference<float>);
BENCHMARK(locate_shared_reference<double>);

template <class S>
void locate_bias(benchmark::State& state) {
  run<S>(state, [](const auto& s) { return locate_with_bias(s.pseudoranges); });
}
BENCHMARK(locate_bias<float>);
BENCHMARK(locate_bias<double>);

template <class S>
void locate_pairs(benchmark::State& state) {
  run<S>(state, [](const auto& s) { return locate(s.ring); });
}
BENCHMARK(locate_pairs<float>);
BENCHMARK(locate_pairs<double>);

template <class S>
void bancroft_closed_form(benchmark::State& state) {
  const auto all = snapshots<S>();
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(bancroft(all[i++ % kCount].pseudoranges));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(bancroft_closed_form<float>);
BENCHMARK(bancroft_closed_form<double>);

template <class S>
void fang_closed_form(benchmark::State& state) {
  auto all = snapshots<S>();
  for (auto& s : all) s.differences.resize(3);
  std::size_t i = 0;
  for (auto _ : state) {
    const auto& s = all[i++ % kCount];
    benchmark::DoNotOptimize(tdoa_fang(s.reference, s.differences));
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(fang_closed_form<float>);
BENCHMARK(fang_closed_form<double>);

}  // namespace
