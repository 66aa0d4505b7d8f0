// SPDX-License-Identifier: MIT
// Cost of one position from range differences or pseudoranges, for each solver.
#include <cstddef>
#include <vector>

#include <benchmark/benchmark.h>

#include <uwbpos/solve/bancroft.hpp>
#include <uwbpos/solve/exclude_outliers.hpp>
#include <uwbpos/solve/locate.hpp>
#include <uwbpos/solve/tdoa_chan.hpp>
#include <uwbpos/solve/tdoa_fang.hpp>

#include "scenes.hpp"

namespace {

using namespace benches;

constexpr double kBias = 5;

template <class S, int D>
struct Shared {
  Vec<S, D> tag;
  Vec<S, D> reference;
  std::vector<DifferenceTo<S, D>> differences;
  double bound;
};

template <class S, int D>
std::vector<Shared<S, D>> shared(benchmark::State& state) {
  std::vector<Shared<S, D>> all;
  for (const auto& e : epochs<S, D>(static_cast<int>(state.range(0)), kBias)) {
    all.push_back({e.tag, e.ranges[0].anchor, e.differences(), e.bound});
  }
  return all;
}

template <class S, int D>
void locate_shared_reference(benchmark::State& state) {
  solve_all(state, shared<S, D>(state),
            [](const auto& s) { return locate(s.reference, s.differences, S(kSigma)); });
}
BENCHMARK(locate_shared_reference<float, 2>)->Apply(by_anchors<4>);
BENCHMARK(locate_shared_reference<double, 2>)->Apply(by_anchors<4>);
BENCHMARK(locate_shared_reference<float, 3>)->Apply(by_anchors<5>);
BENCHMARK(locate_shared_reference<double, 3>)->Apply(by_anchors<5>);

template <class S, int D>
void chan(benchmark::State& state) {
  solve_all(state, shared<S, D>(state),
            [](const auto& s) { return tdoa_chan(s.reference, s.differences, S(kSigma)); });
}
BENCHMARK(chan<float, 3>)->Apply(by_anchors<5>);
BENCHMARK(chan<double, 3>)->Apply(by_anchors<5>);

template <class S, int D>
void locate_bias(benchmark::State& state) {
  solve_all(state, epochs<S, D>(static_cast<int>(state.range(0)), kBias),
            [](const auto& e) { return locate_with_bias(e.ranges); });
}
BENCHMARK(locate_bias<float, 3>)->Apply(by_anchors<5>);
BENCHMARK(locate_bias<double, 3>)->Apply(by_anchors<5>);

// Of two positions the one nearer to the tag.
template <class S, int D>
struct Nearer {
  Vec<S, D> position;

  Nearer(const Vec<S, D>& tag, const Vec<S, D>& a, const Vec<S, D>& b)
      : position{squared_norm<S, D>(a - tag) <= squared_norm<S, D>(b - tag) ? a : b} {}
};

template <class S, int D>
void bancroft_closed_form(benchmark::State& state) {
  solve_all(state, epochs<S, D>(static_cast<int>(state.range(0)), kBias),
            [](const auto& e) -> Result<Nearer<S, D>> {
              const auto both = bancroft(e.ranges);
              if (!both) return std::unexpected(both.error());
              return Nearer<S, D>{e.tag, both->first.position, both->second.position};
            });
}
BENCHMARK(bancroft_closed_form<float, 3>)->Apply(by_anchors<4>);
BENCHMARK(bancroft_closed_form<double, 3>)->Apply(by_anchors<4>);

template <class S, int D>
void fang_closed_form(benchmark::State& state) {
  solve_all(state, shared<S, D>(state), [](const auto& s) -> Result<Nearer<S, D>> {
    const auto both = tdoa_fang(s.reference, s.differences);
    if (!both) return std::unexpected(both.error());
    return Nearer<S, D>{s.tag, both->first, both->second};
  });
}
BENCHMARK(fang_closed_form<float, 3>)->ArgName("anchors")->Arg(4);
BENCHMARK(fang_closed_form<double, 3>)->ArgName("anchors")->Arg(4);

// As many pairs as anchors, round the hall; their potentials cost O(n²).
template <class S, int D>
void locate_pairs(benchmark::State& state) {
  solve_all(state, rings<S, D>(static_cast<int>(state.range(0))),
            [](const auto& r) { return locate(r.pairs); });
}
BENCHMARK(locate_pairs<float, 3>)->Apply(by_anchors<5>);
BENCHMARK(locate_pairs<double, 3>)->Apply(by_anchors<5>);

// One difference is 2 m too long; every pair is tried.
template <class S, int D>
void locate_pairs_without_outlier(benchmark::State& state) {
  auto all = rings<S, D>(static_cast<int>(state.range(0)));
  sim::Random random{"bench outliers"};
  for (auto& r : all) {
    r.pairs[static_cast<std::size_t>(random.integer(0, static_cast<int>(state.range(0)) - 1))]
        .difference += S(2);
  }
  solve_all(state, all, [](const auto& r) -> Result<Fix<S, D>> {
    const auto found = locate_excluding(r.pairs);
    if (!found) return std::unexpected(found.error());
    return found->fix;
  });
}
BENCHMARK(locate_pairs_without_outlier<float, 3>)->ArgName("anchors")->Arg(8)->Arg(16);
BENCHMARK(locate_pairs_without_outlier<double, 3>)->ArgName("anchors")->Arg(8)->Arg(16);

}  // namespace
