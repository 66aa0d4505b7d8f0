// SPDX-License-Identifier: MIT
// Cost of a pose: all ranges at once, with and without a robust loss, beside a fix per tag and the
// arctangent. The columns `rms_m` and `rms_deg` show what each makes of the same ranges.
#include <cmath>
#include <cstddef>
#include <vector>

#include <benchmark/benchmark.h>

#include <uwbpos/pose/target.hpp>
#include <uwbpos/pose/twist.hpp>
#include <uwbpos/pose/two_tag.hpp>
#include <uwbpos/sim/noise.hpp>
#include <uwbpos/solve/locate.hpp>
#include <uwbpos/solve/pose_from_ranges.hpp>

namespace {

using namespace uwbpos;

constexpr std::size_t kCount = 1024;
constexpr double kBaseline = 0.6;

template <class S, int D>
struct Snapshot {
  Vec<S, D> position;
  S heading;
  std::vector<TagRange<S, D>> ranges;  // tag by tag
};

// `tags` on a robot 0.6 m across, `anchors` around a hall of 20 m × 15 m, σ = 0.1 m.
template <class S, int D>
std::vector<Snapshot<S, D>> snapshots(int tags, int anchors) {
  sim::Random random{"bench pose"};
  const double arms[3][3] = {{0, kBaseline / 2, 0}, {0, -kBaseline / 2, 0}, {0.3, 0, 0.1}};
  std::vector<Snapshot<S, D>> all(kCount);
  for (auto& snapshot : all) {
    const double place[3] = {random.uniform(1, 19), random.uniform(1, 14), 1};
    for (int k = 0; k < D; ++k) snapshot.position[k] = static_cast<S>(place[k]);
    snapshot.heading = static_cast<S>(random.uniform(-3.1, 3.1));
    for (int t = 0; t < tags; ++t) {
      for (int i = 0; i < anchors; ++i) {
        const double corner[3] = {((i & 1) ^ (i >> 1 & 1)) != 0 ? 20.0 : 0.0,
                                  (i & 2) != 0 ? 15.0 : 0.0, (i & 4) != 0 ? 3.0 : 0.5};
        TagRange<S, D> r{};
        for (int k = 0; k < D; ++k) {
          r.lever_arm[k] = static_cast<S>(arms[t][k]);
          r.anchor[k] = static_cast<S>(corner[k] + (k < 2 && (i & 4) != 0 ? 1.5 : 0.0));
        }
        const auto exact = predict_tag_range<S, D>(snapshot.position, turn_of(snapshot.heading),
                                                   r.lever_arm, r.anchor);
        r.range = exact.range + static_cast<S>(random.normal(0, 0.1));
        r.sigma = S(0.1);
        snapshot.ranges.push_back(r);
      }
    }
  }
  return all;
}

template <class S, int D, class Solve>
void run(benchmark::State& state, const std::vector<Snapshot<S, D>>& all, const Solve& solve) {
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(solve(all[i++ % kCount]));
  double squares = 0;
  double turns = 0;
  std::size_t solved = 0;
  for (const auto& snapshot : all) {
    if (const auto pose = solve(snapshot)) {
      squares += static_cast<double>(squared_norm<S, D>(pose->position - snapshot.position));
      const S turn = angle_difference(pose->heading, snapshot.heading);
      turns += static_cast<double>(turn * turn);
      ++solved;
    }
  }
  const auto count = static_cast<double>(solved);
  state.counters["rms_m"] = std::sqrt(squares / count);
  state.counters["rms_deg"] = radians_to_degrees(std::sqrt(turns / count));
  state.counters["refused"] = static_cast<double>(kCount - solved);
  state.SetItemsProcessed(state.iterations());
}

template <class S>
Result<Pose2<S>> tag_by_tag(const Snapshot<S, 2>& snapshot) {
  std::vector<RangeTo<S, 2>> ranges;
  Result<Fix<S, 2>> fixes[2] = {std::unexpected(Error::TooFewMeasurements),
                                std::unexpected(Error::TooFewMeasurements)};
  const std::size_t half = snapshot.ranges.size() / 2;
  for (std::size_t tag = 0; tag < 2; ++tag) {
    ranges.clear();
    for (std::size_t i = 0; i < half; ++i) {
      const auto& r = snapshot.ranges[tag * half + i];
      ranges.push_back({r.anchor, r.range, r.sigma});
    }
    fixes[tag] = locate(ranges);
    if (!fixes[tag]) return std::unexpected(fixes[tag].error());
  }
  return two_tag_pose(*fixes[0], *fixes[1], S(kBaseline));
}

template <class S>
void two_tags_four_anchors_by_atan2(benchmark::State& state) {
  run(state, snapshots<S, 2>(2, 4), [](const auto& s) { return tag_by_tag<S>(s); });
}
BENCHMARK(two_tags_four_anchors_by_atan2<float>);
BENCHMARK(two_tags_four_anchors_by_atan2<double>);

template <class S, int D, int Tags, int Anchors, Loss Kind = Loss::Squares>
void pose(benchmark::State& state) {
  const PoseOptions<S, D> options{.robust = {Kind}};
  run(state, snapshots<S, D>(Tags, Anchors),
      [&](const auto& s) { return pose_from_ranges(s.ranges, options); });
}
BENCHMARK(pose<float, 2, 2, 4>);
BENCHMARK(pose<double, 2, 2, 4>);
BENCHMARK(pose<float, 2, 3, 8>);
BENCHMARK(pose<double, 2, 3, 8>);
BENCHMARK(pose<double, 2, 3, 8, Loss::Cauchy>);
BENCHMARK(pose<double, 3, 3, 8>);

template <class S>
void twist_and_target(benchmark::State& state) {
  Pose2<S> a{{1, 2}, S(0.3), Mat<S, 3>::Identity() * S(1e-4)};
  const Pose2<S> b{{S(1.1), S(2.05)}, S(0.35), a.covariance};
  for (auto _ : state) {
    benchmark::DoNotOptimize(a);
    benchmark::DoNotOptimize(twist_between(a, b, S(0.1)));
    benchmark::DoNotOptimize(bearing_to(a, Vec<S, 2>{8, 8}));
  }
}
BENCHMARK(twist_and_target<float>);
BENCHMARK(twist_and_target<double>);

}  // namespace
