// SPDX-License-Identifier: MIT
// A robot with two tags: its pose from all ranges at once, beside a fix per tag and the arctangent;
// its velocity between two poses; where a target is.
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>
#include <vector>

#include <uwbpos/sim/noise.hpp>
#include <uwbpos/uwbpos.hpp>

namespace {

using namespace uwbpos;
using FloatPoint = Vec<float, 2>;

constexpr float kBaseline = 0.6f;     // between the tags, across the robot's front [m]
constexpr float kRangeSigma = 0.03f;  // of a range [m]

// The ranges of both tags to four anchors, left tag first.
std::vector<TagRange<float, 2>> measure(const FloatPoint& position, float heading,
                                        sim::Random& random) {
  const std::array anchors{FloatPoint{0, 0}, FloatPoint{10, 0}, FloatPoint{10, 8},
                           FloatPoint{0, 8}};
  const std::array arms{FloatPoint{0, kBaseline / 2}, FloatPoint{0, -kBaseline / 2}};
  std::vector<TagRange<float, 2>> ranges;
  for (const FloatPoint& arm : arms) {
    for (const FloatPoint& anchor : anchors) {
      const float range = predict_tag_range(position, turn_of(heading), arm, anchor).range;
      ranges.push_back(
          {arm, anchor, range + kRangeSigma * static_cast<float>(random.normal()), kRangeSigma});
    }
  }
  return ranges;
}

Result<Pose2<float>> tag_by_tag(const std::vector<TagRange<float, 2>>& ranges) {
  std::array<Fix<float, 2>, 2> fixes;
  for (std::size_t tag = 0; tag < 2; ++tag) {
    std::vector<RangeTo<float, 2>> of_tag;
    for (std::size_t i = 4 * tag; i < 4 * tag + 4; ++i) {
      of_tag.push_back({ranges[i].anchor, ranges[i].range, ranges[i].sigma});
    }
    const auto fix = locate(of_tag);
    if (!fix) return std::unexpected(fix.error());
    fixes[tag] = *fix;
  }
  return two_tag_pose(fixes[0], fixes[1], kBaseline);
}

void print(const char* how, const Result<Pose2<float>>& pose) {
  if (!pose) {
    const std::string_view why = describe(pose.error());
    std::printf("%-24s %.*s\n", how, static_cast<int>(why.size()), why.data());
    return;
  }
  std::printf("%-24s x = %.2f m, y = %.2f m, heading %.1f +-%.1f deg\n", how,
              static_cast<double>(pose->position[0]), static_cast<double>(pose->position[1]),
              static_cast<double>(radians_to_degrees(pose->heading)),
              static_cast<double>(radians_to_degrees(std::sqrt(pose->covariance(2, 2)))));
}

}  // namespace

int main() {
  sim::Random random{"posture"};
  const float heading = degrees_to_radians(45.0f);
  const auto ranges = measure({4, 4}, heading, random);
  std::puts("the truth:               x = 4.00 m, y = 4.00 m, heading 45.0 deg");
  print("all ranges at once:", pose_from_ranges(ranges));
  print("tag by tag:", tag_by_tag(ranges));

  // One anchor's echo, two metres late: a robust loss takes little notice.
  auto late = ranges;
  late[2].range += 2;
  print("one range 2 m late:", pose_from_ranges(late));
  print("the same, Cauchy's loss:", pose_from_ranges(late, {.robust = {Loss::Cauchy}}));

  const auto first = pose_from_ranges(ranges);
  const auto second = pose_from_ranges(measure({4.5f, 4.5f}, heading + 0.1f, random));
  if (!first || !second) return 1;
  if (const auto twist = twist_between(*first, *second, 1.0f)) {
    std::printf("a second later: %.2f m/s forward, %.2f m/s to the left, turning %.0f deg/s\n",
                static_cast<double>(twist->body_velocity[0]),
                static_cast<double>(twist->body_velocity[1]),
                static_cast<double>(radians_to_degrees(twist->turn_rate)));
  }
  if (const auto target = bearing_to(*first, {8, 8})) {
    std::printf("target: %.2f m away, %.1f +-%.1f deg to the left, %s\n",
                static_cast<double>(target->distance),
                static_cast<double>(radians_to_degrees(target->bearing)),
                static_cast<double>(radians_to_degrees(std::sqrt(target->bearing_variance))),
                target->ahead ? "ahead" : "behind");
  }
  return 0;
}
