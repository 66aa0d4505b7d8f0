// SPDX-License-Identifier: MIT
// Cost of a pose: all ranges at once, with and without a robust loss, beside a fix per tag and the
// arctangent; what is made of poses, and the bound. `error_over_bound` is the position's,
// `heading_over_bound` the heading's.
#include <cmath>
#include <cstddef>
#include <vector>

#include <benchmark/benchmark.h>

#include <uwbpos/pose/target.hpp>
#include <uwbpos/pose/twist.hpp>
#include <uwbpos/pose/two_tag.hpp>
#include <uwbpos/solve/locate.hpp>
#include <uwbpos/solve/pose_from_ranges.hpp>

#include "scenes.hpp"

namespace {

using namespace benches;

template <class S, int D, class Solve>
void solve_poses(benchmark::State& state, const std::vector<Body<S, D>>& all, const Solve& solve) {
  take_time(state, all, solve);
  double squares = 0;
  double turns = 0;
  double bounds = 0;
  double turn_bounds = 0;
  double refused = 0;
  for (const auto& body : all) {
    if (const auto pose = solve(body)) {
      squares += static_cast<double>(squared_norm<S, D>(pose->position - body.position));
      const auto turn = static_cast<double>(angle_difference(pose->heading, body.heading));
      turns += turn * turn;
      bounds += body.bound;
      turn_bounds += body.heading_bound;
    } else {
      ++refused;
    }
  }
  state.counters["error_over_bound"] = std::sqrt(squares / bounds);
  state.counters["heading_over_bound"] = std::sqrt(turns / turn_bounds);
  state.counters["refused"] = refused / static_cast<double>(all.size());
  tell_growth(state);
}

/// Up to what 64 ranges of two tags allow.
void by_anchors_of_two_tags(benchmark::internal::Benchmark* bench) {
  bench->ArgName("anchors")->Arg(4)->Arg(8)->Arg(16)->Arg(32);
}

template <class S, int D, Loss Kind = Loss::Squares>
void pose(benchmark::State& state) {
  const PoseOptions<S, D> options{.robust = {Kind}};
  solve_poses(state, bodies<S, D>(2, static_cast<int>(state.range(0))),
              [&](const auto& b) { return pose_from_ranges(b.ranges, options); });
}
BENCHMARK(pose<float, 2>)->ArgName("anchors")->Arg(3)->Apply(by_anchors_of_two_tags);
BENCHMARK(pose<double, 2>)->ArgName("anchors")->Arg(3)->Apply(by_anchors_of_two_tags);
BENCHMARK(pose<float, 3>)->Apply(by_anchors_of_two_tags);
BENCHMARK(pose<double, 3>)->Apply(by_anchors_of_two_tags);
BENCHMARK(pose<float, 2, Loss::Huber>)->Apply(by_anchors_of_two_tags);
BENCHMARK(pose<double, 2, Loss::Huber>)->Apply(by_anchors_of_two_tags);
BENCHMARK(pose<float, 2, Loss::Cauchy>)->Apply(by_anchors_of_two_tags);
BENCHMARK(pose<double, 2, Loss::Cauchy>)->Apply(by_anchors_of_two_tags);

template <class S>
void pose_of_three_tags(benchmark::State& state) {
  solve_poses(state, bodies<S, 2>(3, static_cast<int>(state.range(0))),
              [](const auto& b) { return pose_from_ranges(b.ranges); });
}
BENCHMARK(pose_of_three_tags<float>)->ArgName("anchors")->Arg(4)->Arg(8)->Arg(16);
BENCHMARK(pose_of_three_tags<double>)->ArgName("anchors")->Arg(4)->Arg(8)->Arg(16);

template <class S>
Result<Fix<S, 2>> fix_of_tag(const Body<S, 2>& body, std::size_t tag) {
  const std::size_t n = body.ranges.size() / 2;
  std::vector<RangeTo<S, 2>> ranges;
  for (std::size_t i = tag * n; i < (tag + 1) * n; ++i) {
    ranges.push_back({body.ranges[i].anchor, body.ranges[i].range, body.ranges[i].sigma});
  }
  return locate(ranges);
}

template <class S>
void two_fixes_and_atan2(benchmark::State& state) {
  solve_poses(state, bodies<S, 2>(2, static_cast<int>(state.range(0))),
              [](const auto& b) -> Result<Pose2<S>> {
                const auto left = fix_of_tag<S>(b, 0);
                const auto right = fix_of_tag<S>(b, 1);
                if (!left || !right) return std::unexpected(Error::NotYetLocated);
                return two_tag_pose(*left, *right, S(kBaseline));
              });
}
BENCHMARK(two_fixes_and_atan2<float>)->Apply(by_anchors_of_two_tags);
BENCHMARK(two_fixes_and_atan2<double>)->Apply(by_anchors_of_two_tags);

// Two fixes as four anchors give them, and the pose made of them.
template <class S>
struct Fixes {
  Fix<S, 2> left, right;
  Pose2<S> pose;
};

template <class S>
std::vector<Fixes<S>> fixes() {
  std::vector<Fixes<S>> all;
  for (const auto& body : bodies<S, 2>(2, 4)) {
    const auto left = fix_of_tag<S>(body, 0);
    const auto right = fix_of_tag<S>(body, 1);
    if (!left || !right) continue;
    const auto pose = two_tag_pose(*left, *right, S(kBaseline));
    if (pose) all.push_back({*left, *right, *pose});
  }
  return all;
}

template <class S>
void two_tags(benchmark::State& state) {
  take_time(state, fixes<S>(),
            [](const auto& f) { return two_tag_pose(f.left, f.right, S(kBaseline)); });
}
BENCHMARK(two_tags<float>);
BENCHMARK(two_tags<double>);

template <class S>
void twist(benchmark::State& state) {
  const auto all = fixes<S>();
  const Pose2<S>* last = &all.front().pose;
  take_time(state, all, [&](const auto& f) {
    const auto result = twist_between(*last, f.pose, S(0.1));
    last = &f.pose;
    return result;
  });
}
BENCHMARK(twist<float>);
BENCHMARK(twist<double>);

template <class S>
void target(benchmark::State& state) {
  take_time(state, fixes<S>(), [](const auto& f) { return bearing_to(f.pose, Vec<S, 2>{8, 8}); });
}
BENCHMARK(target<float>);
BENCHMARK(target<double>);

template <class S, int D>
void bound_of_pose(benchmark::State& state) {
  take_time(state, bodies<S, D>(2, static_cast<int>(state.range(0))),
            [](const auto& b) { return pose_bound(b.ranges, b.position, b.heading); });
  tell_growth(state);
}
BENCHMARK(bound_of_pose<float, 2>)->Apply(by_anchors_of_two_tags);
BENCHMARK(bound_of_pose<double, 2>)->Apply(by_anchors_of_two_tags);

}  // namespace
