// SPDX-License-Identifier: MIT
// The benches' inputs, all from one seed: a hall of 20 m × 15 m, 3 to 64 anchors around it, tags
// anywhere in it, σ = 0.1 m. Each bench goes round many of them, so that no branch predictor learns
// one by heart, and compares the answers with the bound when it has taken the time.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include <benchmark/benchmark.h>

#include <uwbpos/accuracy/pose_bound.hpp>
#include <uwbpos/sim/noise.hpp>

namespace benches {

using namespace uwbpos;

inline constexpr double kSigma = 0.1;

/// How many scenes of so many measurements: what the second-level cache holds.
inline std::size_t scene_count(std::size_t measurements) {
  return std::clamp<std::size_t>(8192 / measurements, 64, 1024);
}

/// Anchor `i` of `n`: evenly round the hall, every other one high, or all of them on the ceiling.
template <int D>
Vec<double, D> anchor_at(sim::Random& random, int i, int n, bool ceiling = false) {
  // Once round, begun in a corner; 4 anchors are the corners.
  const double way = 4.0 * i / n;
  const int side = static_cast<int>(way);
  const double part = way - side;
  const double x[4] = {20 * part, 20, 20 * (1 - part), 0};
  const double y[4] = {0, 15 * part, 15, 15 * (1 - part)};
  Vec<double, D> place;
  place[0] = x[side] + random.normal(0, 0.3);
  place[1] = y[side] + random.normal(0, 0.3);
  if constexpr (D == 3) {
    place[2] = ceiling ? 3 : (i % 2 == 0 ? 0.5 : 3) + random.normal(0, 0.3);
  }
  return place;
}

template <int D>
Vec<double, D> tag_in_hall(sim::Random& random) {
  Vec<double, D> tag;
  tag[0] = random.uniform(1, 19);
  tag[1] = random.uniform(1, 14);
  if constexpr (D == 3) tag[2] = random.uniform(0.5, 2);
  return tag;
}

/// One epoch: ranges, or with `bias` pseudoranges, of a tag.
template <class S, int D>
struct Epoch {
  Vec<S, D> tag;
  std::vector<RangeTo<S, D>> ranges;
  double bound;  ///< of the squared error [m²]

  /// Differences against the first anchor.
  [[nodiscard]] std::vector<DifferenceTo<S, D>> differences() const {
    std::vector<DifferenceTo<S, D>> all;
    for (std::size_t i = 1; i < ranges.size(); ++i) {
      all.push_back({ranges[i].anchor, ranges[i].range - ranges[0].range});
    }
    return all;
  }
};

template <class S, int D>
std::vector<Epoch<S, D>> epochs(int anchors, double bias = 0, bool ceiling = false) {
  sim::Random random{"bench scenes"};
  std::vector<Epoch<S, D>> all(scene_count(static_cast<std::size_t>(anchors)));
  for (auto& epoch : all) {
    const Vec<double, D> tag = tag_in_hall<D>(random);
    std::vector<RangeTo<double, D>> exact;
    std::vector<DifferenceTo<double, D>> others;
    for (int i = 0; i < anchors; ++i) {
      const Vec<double, D> anchor = anchor_at<D>(random, i, anchors, ceiling);
      const double range = (tag - anchor).norm();
      exact.push_back({anchor, range, kSigma});
      if (i > 0) others.push_back({anchor, 0});
      const double measured = std::max(range + bias + random.normal(0, kSigma), 0.0);
      epoch.ranges.push_back({anchor.template cast<S>(), static_cast<S>(measured), S(kSigma)});
    }
    epoch.tag = tag.template cast<S>();
    const auto bound = bias == 0 ? cramer_rao_bound(exact, tag)
                                 : cramer_rao_bound(exact[0].anchor, others, kSigma, tag);
    epoch.bound = bound ? bound->trace() : 0;
  }
  return all;
}

/// Differences round the ring of anchors, each with noise of its own, √2 σ.
template <class S, int D>
struct Ring {
  Vec<S, D> tag;
  std::vector<PairDifference<S, D>> pairs;
  double bound;  ///< of the squared error [m²]
};

template <class S, int D>
std::vector<Ring<S, D>> rings(int anchors) {
  sim::Random random{"bench rings"};
  std::vector<Ring<S, D>> all(scene_count(static_cast<std::size_t>(anchors)));
  constexpr double kPairSigma = kSigma * std::numbers::sqrt2;
  for (auto& ring : all) {
    const Vec<double, D> tag = tag_in_hall<D>(random);
    std::vector<Vec<double, D>> places;
    for (int i = 0; i < anchors; ++i) places.push_back(anchor_at<D>(random, i, anchors));
    std::vector<PairDifference<double, D>> exact;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const Vec<double, D>& a = places[i];
      const Vec<double, D>& b = places[(i + 1) % places.size()];
      const double difference = (tag - b).norm() - (tag - a).norm();
      exact.push_back({a, b, difference, kPairSigma});
      ring.pairs.push_back({a.template cast<S>(), b.template cast<S>(),
                            static_cast<S>(difference + random.normal(0, kPairSigma)),
                            S(kPairSigma)});
    }
    ring.tag = tag.template cast<S>();
    const auto bound = cramer_rao_bound(exact, tag);
    ring.bound = bound ? bound->trace() : 0;
  }
  return all;
}

/// A body of two or three tags 0.6 m apart, the ranges tag by tag.
template <class S, int D>
struct Body {
  Vec<S, D> position;
  S heading;
  std::vector<TagRange<S, D>> ranges;
  double bound;          ///< of the position's squared error [m²]
  double heading_bound;  ///< of the heading's [rad²]
};

inline constexpr double kBaseline = 0.6;

template <class S, int D>
std::vector<Body<S, D>> bodies(int tags, int anchors) {
  sim::Random random{"bench bodies"};
  const double arms[3][3] = {{0, kBaseline / 2, 0}, {0, -kBaseline / 2, 0}, {0.3, 0, 0.1}};
  std::vector<Body<S, D>> all(scene_count(static_cast<std::size_t>(tags * anchors)));
  for (auto& body : all) {
    const Vec<double, D> position = tag_in_hall<D>(random);
    const double heading = random.uniform(-3.1, 3.1);
    std::vector<Vec<double, D>> places;
    for (int i = 0; i < anchors; ++i) places.push_back(anchor_at<D>(random, i, anchors));
    std::vector<TagRange<double, D>> exact;
    for (int t = 0; t < tags; ++t) {
      Vec<double, D> arm;
      for (int k = 0; k < D; ++k) arm[k] = arms[t][k];
      for (const auto& place : places) {
        const double range =
            predict_tag_range<double, D>(position, turn_of(heading), arm, place).range;
        exact.push_back({arm, place, range, kSigma});
        body.ranges.push_back({arm.template cast<S>(), place.template cast<S>(),
                               static_cast<S>(std::max(range + random.normal(0, kSigma), 0.0)),
                               S(kSigma)});
      }
    }
    body.position = position.template cast<S>();
    body.heading = static_cast<S>(heading);
    const auto bound = pose_bound(exact, position, heading);
    body.heading_bound = bound ? (*bound)(D, D) : 0;
    body.bound = bound ? bound->trace() - body.heading_bound : 0;
  }
  return all;
}

/// By the benchmark's argument, the number of anchors: the time that each of them takes, which
/// where the cost is linear falls to a constant.
inline void tell_growth(benchmark::State& state) {
  state.counters["per_anchor"] = benchmark::Counter(
      static_cast<double>(state.range(0)),
      benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

/// Calls `work(scene)` for one scene after the other. An item is a call.
template <class Scenes, class Work>
void take_time(benchmark::State& state, const Scenes& scenes, const Work& work) {
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(work(scenes[i]));
    i = i + 1 < scenes.size() ? i + 1 : 0;
  }
  state.SetItemsProcessed(state.iterations());
}

/// The same for a solver of positions; `error_over_bound` is the root mean square error over the
/// Cramér-Rao bound's, `refused` the share of scenes without an answer. Scenes have `tag` and
/// `bound`.
template <class Scenes, class Solve>
void solve_all(benchmark::State& state, const Scenes& scenes, const Solve& solve) {
  take_time(state, scenes, solve);
  double squares = 0;
  double bounds = 0;
  double refused = 0;
  for (const auto& scene : scenes) {
    if (const auto fix = solve(scene)) {
      squares += static_cast<double>((fix->position - scene.tag).squaredNorm());
      bounds += scene.bound;
    } else {
      ++refused;
    }
  }
  state.counters["error_over_bound"] = std::sqrt(squares / bounds);
  state.counters["refused"] = refused / static_cast<double>(scenes.size());
  tell_growth(state);
}

/// From the fewest anchors to the most.
template <int Least>
void by_anchors(benchmark::internal::Benchmark* bench) {
  bench->ArgName("anchors");
  bench->Arg(Least);
  for (const int anchors : {4, 8, 16, 32, 64}) {
    if (anchors > Least) bench->Arg(anchors);
  }
}

}  // namespace benches
