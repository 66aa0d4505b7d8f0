// SPDX-License-Identifier: MIT
// Cost of a transform from shared points, of bringing a fix to the map, and of fusing those of
// several subnets. `error_over_bound` is the error of a place of the map over its covariance's.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <benchmark/benchmark.h>

#include <uwbpos/frames/fit_transform.hpp>
#include <uwbpos/frames/fuse_fixes.hpp>

#include "scenes.hpp"

namespace {

using namespace benches;

/// A yaw and a translation anywhere.
template <class S, int D>
Transform<S, D> anywhere(sim::Random& random) {
  const double yaw = random.uniform(-3.1, 3.1);
  Transform<S, D> map_T_room;
  map_T_room.rotation(0, 0) = map_T_room.rotation(1, 1) = static_cast<S>(std::cos(yaw));
  map_T_room.rotation(1, 0) = static_cast<S>(std::sin(yaw));
  map_T_room.rotation(0, 1) = -map_T_room.rotation(1, 0);
  for (int k = 0; k < D; ++k) map_T_room.translation[k] = static_cast<S>(random.uniform(-30, 30));
  return map_T_room;
}

template <class S, int D>
struct Surveyed {
  std::vector<SharedPoint<S, D>> points;
  Transform<S, D> truth;
};

// Points surveyed in both frames, σ = 0.1 m on each axis.
template <class S, int D>
void fitted_transform(benchmark::State& state) {
  sim::Random random{"bench fits"};
  const auto n = static_cast<int>(state.range(0));
  std::vector<Surveyed<S, D>> all(scene_count(static_cast<std::size_t>(n)));
  for (auto& s : all) {
    s.truth = anywhere<S, D>(random);
    for (int i = 0; i < n; ++i) {
      const Vec<S, D> room = anchor_at<D>(random, i, n).template cast<S>();
      Vec<S, D> map = apply(s.truth, room);
      for (int k = 0; k < D; ++k) map[k] += static_cast<S>(random.normal(0, kSigma));
      s.points.push_back({room, map, S(kSigma)});
    }
  }
  take_time(state, all, [](const auto& s) { return fit_transform(s.points); });
  double squares = 0;
  double variances = 0;
  for (const auto& s : all) {
    const auto fit = fit_transform(s.points);
    if (!fit) continue;
    const Fix<S, D> place{Vec<S, D>::Constant(S(5)), Mat<S, D>::Zero(), S(0), 0};
    const Fix<S, D> brought = apply(fit->a_T_b, place);
    squares +=
        static_cast<double>(squared_norm<S, D>(brought.position - apply(s.truth, place.position)));
    variances += static_cast<double>(brought.covariance.trace());
  }
  state.counters["error_over_bound"] = std::sqrt(squares / variances);
  tell_growth(state);
}
BENCHMARK(fitted_transform<float, 2>)->Apply(by_anchors<3>);
BENCHMARK(fitted_transform<double, 2>)->Apply(by_anchors<3>);
BENCHMARK(fitted_transform<float, 3>)->Apply(by_anchors<3>);
BENCHMARK(fitted_transform<double, 3>)->Apply(by_anchors<3>);

template <class S, int D>
struct Overlap {
  Subnets<S, D, 4> subnets;
  std::vector<SubnetFix<S, D>> fixes;
  Vec<S, D> tag;
};

/// Subnets known to 2 cm and 2 mrad hear a tag, each fix good to 0.1 m.
template <class S, int D>
std::vector<Overlap<S, D>> overlaps(int heard) {
  sim::Random random{"bench overlaps"};
  std::vector<Overlap<S, D>> all(256);
  for (auto& o : all) {
    o.tag = tag_in_hall<D>(random).template cast<S>();
    for (int i = 0; i < heard; ++i) {
      const Transform<S, D> truth = anywhere<S, D>(random);
      Transform<S, D> known = truth;
      known.covariance.diagonal().setConstant(S(4e-6));
      known.covariance.diagonal().template head<D>().setConstant(S(4e-4));
      for (int k = 0; k < D; ++k) known.translation[k] += static_cast<S>(random.normal(0, 0.02));
      const auto id = static_cast<std::uint32_t>(i);
      static_cast<void>(o.subnets.add({id, id, known}));
      const Transform<S, D> back = inverse(exact(truth));
      Vec<S, D> seen = apply(back, o.tag);
      for (int k = 0; k < D; ++k) seen[k] += static_cast<S>(random.normal(0, kSigma));
      o.fixes.push_back({id, {seen, Mat<S, D>::Identity() * S(kSigma * kSigma), S(0), 0}});
    }
  }
  return all;
}

template <class S, int D>
void fused_fixes(benchmark::State& state) {
  const auto all = overlaps<S, D>(static_cast<int>(state.range(0)));
  const auto fuse = [](const auto& o) { return fuse_fixes<S, D, 4>(o.subnets, o.fixes); };
  take_time(state, all, fuse);
  double squares = 0;
  double variances = 0;
  for (const auto& o : all) {
    const auto fused = fuse(o);
    if (!fused) continue;
    squares += static_cast<double>(squared_norm<S, D>(fused->fix.position - o.tag));
    variances += static_cast<double>(fused->fix.covariance.trace());
  }
  state.counters["error_over_bound"] = std::sqrt(squares / variances);
}
BENCHMARK(fused_fixes<float, 2>)->ArgName("subnets")->DenseRange(1, 4);
BENCHMARK(fused_fixes<double, 2>)->ArgName("subnets")->DenseRange(1, 4);
BENCHMARK(fused_fixes<float, 3>)->ArgName("subnets")->DenseRange(1, 4);
BENCHMARK(fused_fixes<double, 3>)->ArgName("subnets")->DenseRange(1, 4);

template <class S, int D>
void fused_and_learned(benchmark::State& state) {
  auto all = overlaps<S, D>(static_cast<int>(state.range(0)));
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(fuse_and_learn<S, D, 4>(all[i].subnets, all[i].fixes));
    i = i + 1 < all.size() ? i + 1 : 0;
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(fused_and_learned<float, 2>)->ArgName("subnets")->Arg(2)->Arg(4);
BENCHMARK(fused_and_learned<double, 2>)->ArgName("subnets")->Arg(2)->Arg(4);

template <class S, int D>
void fix_to_map(benchmark::State& state) {
  take_time(state, overlaps<S, D>(1),
            [](const auto& o) { return apply(o.subnets[0].map_T_subnet, o.fixes[0].fix); });
}
BENCHMARK(fix_to_map<float, 2>);
BENCHMARK(fix_to_map<double, 2>);
BENCHMARK(fix_to_map<float, 3>);
BENCHMARK(fix_to_map<double, 3>);

}  // namespace
