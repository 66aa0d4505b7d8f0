// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/filter/motion/constant_velocity.hpp"
#include "uwbpos/filter/motion/planar_body.hpp"
#include "uwbpos/filter/tracker.hpp"

#include "support/data.hpp"
#include "support/recordings.hpp"
#include "support/statistics.hpp"

namespace tests::filter_recordings {

// Trackers on recordings of real radios, causally: what they say is what they knew then.

namespace {

using namespace uwbpos;
using test::points;
using test::Row;
using test::rows;
using test::TruePose;
using test::Truth;
std::int64_t microseconds(double t) { return std::llround(t * 1e6); }

}  // namespace

TEST_CASE(
    "recordings: a trolley with three tags, biases of its links known from a recording at rest") {
  const auto folder = test::data_or_skip("lias", "a trolley followed by its three tags");
  if (!folder) return;
  const auto anchors = points(*folder / "anchors.csv");
  const auto tags = points(*folder / "tags.csv");
  const Truth still{*folder / "static/truth.tum"};
  std::map<std::pair<int, int>, std::vector<double>> errors;
  for (const Row& r : rows(*folder / "static/ranges.csv")) {
    if (!still.covers(r[0]) || still.spacing(r[0]) > 3) continue;  // on the way between poses
    const TruePose pose = still.at(r[0]);
    const int tag = static_cast<int>(r[1]);
    const int anchor = static_cast<int>(r[2]);
    const Vec<double, 3> arm = turned<double, 3>(turn_of(pose.heading), tags.at(tag));
    const Vec<double, 3> place{pose.x + arm[0], pose.y + arm[1], pose.z + arm[2]};
    errors[{tag, anchor}].push_back(r[3] - (place - anchors.at(anchor)).norm());
  }
  std::map<std::pair<int, int>, double> bias;
  for (const auto& [link, e] : errors) bias[link] = test::median(e);

  TrackerOptions<PlanarBody<double>> options;
  // A heavy trolley pushed at a walk: it gains 2 cm/s in a second, and hardly sidewards.
  options.model.motion.acceleration = 0.02;
  options.model.motion.sideward_acceleration = 0.001;
  options.model.motion.turn_acceleration = 0.1;
  options.model.motion.height = 0.96;
  // Echoes make long ranges, not wild ones.
  options.model.gate.sigmas = 2;
  Tracker<PlanarBody<double>> tracker{options};
  for (const auto& [id, p] : anchors) {
    REQUIRE(tracker.add_anchor(static_cast<std::uint32_t>(id), p));
  }
  for (const auto& [id, p] : tags) REQUIRE(tracker.add_tag(static_cast<std::uint32_t>(id), p));

  const Truth truth{*folder / "mid/truth.tum"};
  const auto readings = rows(*folder / "mid/ranges.csv");
  std::vector<double> off;
  std::vector<double> turned;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const Row& r = readings[i];
    const int tag = static_cast<int>(r[1]);
    const int anchor = static_cast<int>(r[2]);
    static_cast<void>(tracker.update(
        TimedRange<double>{microseconds(r[0]), static_cast<std::uint32_t>(anchor),
                           r[3] - bias.at({tag, anchor}), 0.08, static_cast<std::uint32_t>(tag)}));
    const bool last_of_epoch = i + 1 == readings.size() || readings[i + 1][0] != r[0];
    if (!last_of_epoch || !truth.covers(r[0])) continue;
    const auto pose = tracker.pose();
    REQUIRE(pose);
    const TruePose was = truth.at(r[0]);
    off.push_back(std::hypot(pose->pose.position[0] - was.x, pose->pose.position[1] - was.y));
    turned.push_back(radians_to_degrees(angle_difference(pose->pose.heading, was.heading)));
  }
  MESSAGE("lias/mid, causal: position rmse " << test::root_mean_square(off) << " m, heading rmse "
                                             << test::root_mean_square(turned) << " deg");
  CHECK(off.size() > 1190);
  CHECK(test::root_mean_square(off) <= 0.035);
  CHECK(test::root_mean_square(turned) <= 3.6);
}

TEST_CASE("recordings: a robot outside its box of four anchors") {
  const auto folder =
      test::data_or_skip("hanyang/los_trajectory_b_case_4", "a robot outside four anchors");
  if (!folder) return;
  TrackerOptions<ConstantVelocity<double, 2>> options;
  options.model.motion = {.acceleration = 0.5, .height = 1.0};
  Tracker<ConstantVelocity<double, 2>> tracker{options};
  for (const auto& [id, p] : points(*folder / "anchors.csv")) {
    REQUIRE(tracker.add_anchor(static_cast<std::uint32_t>(id), p));
  }
  const Truth truth{*folder / "truth.tum"};
  std::vector<double> off;
  int reopened = 0;
  for (const Row& r : rows(*folder / "ranges.csv")) {
    const auto told = tracker.update(
        TimedRange<double>{microseconds(r[0]), static_cast<std::uint32_t>(r[2]), r[3], 0.15});
    if (told && told->event == TrackEvent::Reopened) ++reopened;
    const auto pose = tracker.pose();
    if (!pose || !truth.covers(r[0])) continue;
    const TruePose was = truth.at(r[0]);
    off.push_back(std::hypot(pose->position[0] - was.x, pose->position[1] - was.y));
  }
  MESSAGE("hanyang, causal: rmse " << test::root_mean_square(off) << " m, " << reopened
                                   << " times reopened");
  CHECK(off.size() > 7000);
  CHECK(test::root_mean_square(off) <= 0.40);
}

}  // namespace tests::filter_recordings
