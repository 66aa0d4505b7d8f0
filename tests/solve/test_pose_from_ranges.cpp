// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/solve/pose_from_ranges.hpp"

#include "pose/scenes.hpp"
#include "support/nees.hpp"
#include "support/statistics.hpp"

namespace tests::solve_pose_from_ranges {

using namespace uwbpos;

namespace {

// In standard deviations at sigma = 0.1 m: rounding of ranges of 25 m is 1e-6 m in float, the
// centred coordinates' as much again, and the descent stops within 1e-4 of a deviation.
template <class S>
constexpr double exactness() {
  return sizeof(S) == 4 ? 1e-2 : 1e-6;
}

// How far an answer is off, in standard deviations.
template <class S, int D, class Pose>
double misses(const test::Scene<S, D>& scene, const Pose& pose) {
  const double far = static_cast<double>(norm<S, D>(pose.position - scene.position));
  const double turn = std::abs(static_cast<double>(angle_difference(pose.heading, scene.heading)));
  const double place =
      std::sqrt(static_cast<double>(pose.covariance.template topLeftCorner<D, D>().trace()));
  return std::max(far / place, turn / std::sqrt(static_cast<double>(pose.covariance(D, D))));
}

// Noiseless scenes: never a mirrored or turned pose. 100,000 of each kind were run once.
template <class S, int D>
void check_scenes(int count) {
  sim::Random random{"pose scenes"};
  int wrong = 0;
  int refused = 0;
  for (int i = 0; i < count; ++i) {
    const auto scene = test::random_scene<S, D>(random, D + 1, 8);
    const auto pose = pose_from_ranges(scene.ranges);
    if (!pose) {
      CHECK(pose.error() == Error::AmbiguousSolution);
      ++refused;
    } else if (!(misses(scene, *pose) < exactness<S>())) {
      ++wrong;
    }
  }
  CHECK(wrong == 0);
  // Two tags and three anchors may leave a second pose that explains six ranges to half a
  // millimetre, which digits of a float do not rule out: twice in 100,000 scenes.
  CHECK(refused <= (sizeof(S) == 4 ? 1 : 0));
}

template <class S>
std::vector<Vec<S, 2>> corners() {
  return {{0, 0}, {10, 0}, {10, 8}, {0, 8}};
}

template <class S>
std::vector<Vec<S, 2>> two_arms() {
  return {{0, S(0.3)}, {0, S(-0.3)}};
}

template <class S, int D>
std::vector<Vec<S, 3>> in_space(const std::vector<Vec<S, D>>& plan, S z) {
  std::vector<Vec<S, 3>> result;
  for (const auto& v : plan) result.push_back({v[0], v[1], z});
  return result;
}

}  // namespace

TEST_CASE("noiseless ranges give the exact pose, never an image of it: double") {
  check_scenes<double, 2>(3'000);
  check_scenes<double, 3>(1'000);
}

TEST_CASE("noiseless ranges give the exact pose, never an image of it: float") {
  check_scenes<float, 2>(2'000);
  check_scenes<float, 3>(1'000);
}

TEST_CASE("noisy ranges of few anchors: an image is refused, hardly ever answered") {
  sim::Random random{"noisy pose scenes"};
  constexpr int count = 3'000;
  int refused = 0;
  int far = 0;
  for (int i = 0; i < count; ++i) {
    const auto scene = test::random_scene<double, 2>(random, 3, 8, 0.25);
    const auto bound = pose_bound(scene.ranges, scene.position, scene.heading);
    const auto pose = pose_from_ranges(test::noisy<double, 2>(random, scene.ranges));
    if (!pose) {
      CHECK(pose.error() == Error::AmbiguousSolution);
      ++refused;
      continue;
    }
    const double turn = angle_difference(pose->heading, scene.heading);
    if (turn * turn > 36 * (*bound)(2, 2)) ++far;
  }
  MESSAGE(refused, " refused, ", far, " beyond six standard deviations, of ", count);
  // Rooms of three anchors whose noise leaves two poses within Δχ² of 9: 2.4 % of the scenes.
  CHECK(refused <= count / 40);
  CHECK(far <= count / 1500);
}

TEST_CASE("headings on ±π and on every axis") {
  for (int k = -8; k <= 8; ++k) {
    const double heading = wrap_angle(k * std::numbers::pi / 8);
    test::Scene<double, 2> scene{{3, 5}, heading, {}};
    scene.ranges = test::tag_ranges({3, 5}, heading, two_arms<double>(), corners<double>());
    const auto pose = pose_from_ranges(scene.ranges);
    REQUIRE(pose);
    CHECK(misses(scene, *pose) < exactness<double>());
    CHECK(pose->heading > -std::numbers::pi);
    CHECK(pose->heading <= std::numbers::pi);
  }
}

TEST_CASE("in space the covariance predicts the errors, with and without a known height") {
  sim::Random random{"pose in space"};
  const auto anchors = [] {
    auto all = in_space<double, 2>(corners<double>(), 3);
    for (auto& low : in_space<double, 2>(corners<double>(), 0.3)) all.push_back(low);
    return all;
  }();
  const std::vector<Vec<double, 3>> arms{{0, 0.5, 0}, {0, -0.5, 0}, {0.5, 0, 0.2}};
  double free = 0;
  double known = 0;
  double plan = 0;
  constexpr int draws = 1500;
  for (int i = 0; i < draws; ++i) {
    const Vec<double, 3> place{random.uniform(2, 8), random.uniform(2, 6), random.uniform(0.5, 2)};
    const double heading = random.uniform(-3.1, 3.1);
    const auto ranges =
        test::noisy<double, 3>(random, test::tag_ranges<double, 3>(place, heading, arms, anchors));
    const Vec<double, 4> truth{place[0], place[1], place[2], 0};
    const auto stacked = [&](const LevelPose<double>& pose) {
      return Vec<double, 4>{pose.position[0], pose.position[1], pose.position[2],
                            angle_difference(pose.heading, heading)};
    };
    const auto pose = pose_from_ranges(ranges);
    REQUIRE(pose);
    free += test::normalised_squared_error<double, 4>(stacked(*pose), pose->covariance, truth);
    const double sigma = 0.05;
    const auto with_height = pose_from_ranges(
        ranges, {.height = Measured<double>{place[2] + sigma * random.normal(), sigma * sigma}});
    REQUIRE(with_height);
    known += test::normalised_squared_error<double, 4>(stacked(*with_height),
                                                       with_height->covariance, truth);
    // Exactly: nothing of z is left, the rest is a pose in the plane from slant ranges.
    const auto level = pose_from_ranges(ranges, {.height = Measured<double>{place[2], 0}});
    REQUIRE(level);
    CHECK(level->position[2] == doctest::Approx(place[2]).epsilon(1e-12));
    CHECK(level->covariance(2, 2) == 0);
    const Pose2<double> in_plane = in_plan(*level);
    plan += test::normalised_squared_error<double, 3>(
        {in_plane.position[0], in_plane.position[1], angle_difference(level->heading, heading)},
        in_plane.covariance, {place[0], place[1], 0});
  }
  CHECK(test::mean_nees_interval(4, draws).contains(free / draws));
  CHECK(test::mean_nees_interval(4, draws).contains(known / draws));
  CHECK(test::mean_nees_interval(3, draws).contains(plan / draws));
}

TEST_CASE_TEMPLATE("one ceiling: a side, a prior or the height tells above from below", S, float,
                   double) {
  const Vec<S, 3> place{4, 5, 1};
  const auto ranges = test::tag_ranges<S, 3>(place, S(2), in_space<S, 2>(two_arms<S>(), S(0)),
                                             in_space<S, 2>(corners<S>(), S(3)));
  CHECK(pose_from_ranges(ranges).error() == Error::AmbiguousSolution);
  const auto check = [&](const PoseOptions<S, 3>& options, double z) {
    const auto pose = pose_from_ranges(ranges, options);
    REQUIRE(pose);
    // z is the root of a difference of squares, known to some ε · 100 m² / 2 m.
    CHECK(pose->position[2] == doctest::Approx(z).epsilon(1e-3));
    CHECK(pose->position[0] == doctest::Approx(4).epsilon(1e-3));
    CHECK(pose->heading == doctest::Approx(2).epsilon(1e-3));
  };
  check({.side = {0, 0, -1}}, 1);
  check({.side = {0, 0, 1}}, 5);
  check({.prior = Vec<S, 3>{4, 5, 0}}, 1);
  check({.height = Measured<S>{S(1), S(0)}}, 1);
  check({.height = Measured<S>{S(1), S(0.25)}}, 1);
}

TEST_CASE_TEMPLATE("a known heading makes one tag enough, and weighs as its variance says", S,
                   float, double) {
  const Vec<S, 2> place{4, 5};
  const std::vector<Vec<S, 2>> arm{{S(0.5), S(0.2)}};
  const auto ranges = test::tag_ranges<S, 2>(place, S(2.5), arm, corners<S>());
  CHECK(pose_from_ranges(ranges).error() == Error::HeadingUndetermined);
  for (const S variance : {S(0), S(1e-30), S(1e-4)}) {
    const auto pose = pose_from_ranges(ranges, {.heading = Measured<S>{S(2.5), variance}});
    REQUIRE(pose);
    CHECK(norm<S, 2>(pose->position - place) < S(1e-4));
    CHECK(pose->heading == doctest::Approx(2.5));
    CHECK(pose->covariance(2, 2) == doctest::Approx(static_cast<double>(variance)));
    // The tag is known to σ²/2 or so; the arm carries the heading's error to the origin.
    CHECK(pose->covariance(0, 0) > S(0));
  }
  // Against ranges of two tags, half way when both are equally sure.
  const auto of_two = test::tag_ranges<S, 2>(place, S(0), two_arms<S>(), corners<S>());
  const auto alone = pose_from_ranges(of_two);
  REQUIRE(alone);
  const auto both =
      pose_from_ranges(of_two, {.heading = Measured<S>{S(0.1), alone->covariance(2, 2)}});
  REQUIRE(both);
  CHECK(both->heading == doctest::Approx(0.05).epsilon(0.02));
  CHECK(both->covariance(2, 2) ==
        doctest::Approx(static_cast<double>(alone->covariance(2, 2)) / 2).epsilon(0.02));
}

TEST_CASE("two tags see a row of anchors: mirrored, unless the caller knows better") {
  const std::vector<Vec<double, 2>> row{{0, 0}, {4, 0}, {9, 0}};
  const auto ranges = test::tag_ranges<double, 2>({3, 2}, 0.4, two_arms<double>(), row);
  CHECK(pose_from_ranges(ranges).error() == Error::AmbiguousSolution);
  const auto above = pose_from_ranges(ranges, {.side = {0, 1}});
  REQUIRE(above);
  CHECK(above->heading == doctest::Approx(0.4));
  const auto below = pose_from_ranges(ranges, {.prior = Vec<double, 2>{3, -3}});
  REQUIRE(below);
  CHECK(below->position[1] == doctest::Approx(-2));
  CHECK(std::abs(angle_difference(below->heading, std::numbers::pi - 0.4)) < 1e-6);
}

TEST_CASE("three ranges and no more have several poses; the fourth decides") {
  auto ranges = test::tag_ranges<double, 2>({3, 2}, 0.4, two_arms<double>(), corners<double>());
  const auto all = ranges;
  ranges = {all[0], all[1], all[6]};
  CHECK(pose_from_ranges(ranges).error() == Error::AmbiguousSolution);
  ranges = {all[0], all[1], all[4], all[6], all[7]};
  const auto pose = pose_from_ranges(ranges);
  REQUIRE(pose);
  CHECK(pose->heading == doctest::Approx(0.4));
}

TEST_CASE_TEMPLATE("what gives no pose is refused by name", S, float, double) {
  constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  constexpr S infinity = std::numeric_limits<S>::infinity();
  const auto good = test::tag_ranges<S, 2>({3, 2}, S(0.4), two_arms<S>(), corners<S>());
  const auto error = [](const std::vector<TagRange<S, 2>>& ranges,
                        const PoseOptions<S, 2>& options = {}) {
    const auto pose = pose_from_ranges(ranges, options);
    REQUIRE_FALSE(pose);
    return pose.error();
  };
  CHECK(error({}) == Error::TooFewMeasurements);
  CHECK(error({good[0], good[5]}) == Error::TooFewMeasurements);
  CHECK(error(std::vector<TagRange<S, 2>>(65, good[0])) == Error::TooManyMeasurements);
  // Tags in one place; anchors in one place; tags apart in height only.
  CHECK(error({good[0], good[1], good[2], good[3]}) == Error::HeadingUndetermined);
  CHECK(error({good[0], good[0], good[4], good[4]}) == Error::DegenerateGeometry);
  for (const S bad : {nan, infinity}) {
    auto ranges = good;
    ranges[3].range = bad;
    CHECK(error(ranges) == Error::NotFinite);
    ranges = good;
    ranges[3].lever_arm[1] = bad;
    CHECK(error(ranges) == Error::NotFinite);
    ranges = good;
    ranges[3].anchor[1] = bad;
    CHECK(error(ranges) == Error::NotFinite);
    ranges = good;
    ranges[3].sigma = bad;
    CHECK(error(ranges) == Error::NotFinite);
    CHECK(error(good, {.heading = Measured<S>{bad, S(1)}}) == Error::NotFinite);
    CHECK(error(good, {.heading = Measured<S>{S(1), bad}}) == Error::NotFinite);
    CHECK(error(good, {.prior = Vec<S, 2>{bad, 0}}) == Error::NotFinite);
    CHECK(error(good, {.side = {bad, 0}}) == Error::NotFinite);
    CHECK(error(good, {.robust = {Loss::Huber, bad}}) == Error::NotFinite);
  }
  auto ranges = good;
  ranges[3].sigma = S(0);
  CHECK(error(ranges) == Error::NonPositiveSigma);
  ranges = good;
  ranges[3].range = S(-1);
  CHECK(error(ranges) == Error::NegativeRange);
  CHECK(error(good, {.heading = Measured<S>{S(1), S(-1)}}) == Error::InvalidOption);
  CHECK(error(good, {.height = Measured<S>{S(1), S(0)}}) == Error::InvalidOption);
  CHECK(error(good, {.robust = {Loss::Huber, S(-1)}}) == Error::InvalidOption);
  // Tags 2.6 m apart on a body that is taken for one of 0.6 m: the pose with χ² is the caller's to
  // judge, the pose alone is not.
  std::vector<Vec<S, 2>> wide = two_arms<S>();
  for (auto& arm : wide) arm *= S(1.3) / norm(arm);
  ranges = test::tag_ranges<S, 2>({3, 2}, S(0.4), wide, corners<S>());
  for (std::size_t i = 0; i < ranges.size(); ++i) ranges[i].lever_arm = good[i].lever_arm;
  CHECK(error(ranges) == Error::InconsistentRanges);
  CHECK(solve_pose(ranges)->chi_squared > S(100));
  CHECK(pose_from_ranges(ranges, {.robust = {Loss::Cauchy, S(0)}}));
  // A body 6 m across between circles of 1 m.
  CHECK(error({{{0, 3}, {0, 0}, 1}, {{0, -3}, {20, 0}, 1}, {{0, 3}, {20, 8}, 1}}) ==
        Error::InconsistentRanges);
}

TEST_CASE("a tag at an anchor, whose noisy range may be below zero") {
  auto ranges =
      test::tag_ranges<double, 2>({0, 0}, 0, two_arms<double>(), {{0, 0}, {8, 0}, {0, 8}, {8, 8}});
  const std::array measured{7.76224, 0.547475,   10.7495, 7.47593,
                            7.87412, -0.0612745, 11.3864, 7.86611};
  for (std::size_t i = 0; i < ranges.size(); ++i) ranges[i].range = measured[i];
  const auto pose = pose_from_ranges(ranges);
  REQUIRE(pose);
  CHECK((pose->position - Vec<double, 2>{7.9357, 0.2452}).norm() < 0.2);
}

}  // namespace tests::solve_pose_from_ranges
