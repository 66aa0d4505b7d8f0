// SPDX-License-Identifier: MIT
#include <cmath>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/solve/pose_from_ranges.hpp"

#include "pose/scenes.hpp"
#include "support/nees.hpp"
#include "support/statistics.hpp"

namespace tests::solve_pose_consistency {

using namespace uwbpos;

namespace {

using Arms = std::vector<Vec<double, 2>>;
using Ranges = std::vector<TagRange<double, 2>>;

const std::vector<Vec<double, 2>> kAnchors{{0, 0}, {10, 0}, {10, 8}, {0, 8}};
const Arms kArms{{0, 0.3}, {0, -0.3}};
const Vec<double, 2> kPlace{4, 3};
constexpr double kHeading = 0.7;

// The share of noncentral χ² beyond `bound`: central ones, mixed by Poisson's weights.
double power(double bound, int freedom, double noncentrality) {
  double weight = std::exp(-noncentrality / 2);
  double sum = 0;
  for (int j = 0; j < 500; ++j) {
    sum += weight * (1 - test::chi_squared_cdf(bound, freedom + 2 * j));
    weight *= noncentrality / 2 / (j + 1);
  }
  return sum;
}

struct Mistake {
  std::string what;
  Arms given = kArms;
  double late = 0;  ///< of the second range [m]
};

Ranges with_mistake(Ranges ranges, const Mistake& mistake) {
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    ranges[i].lever_arm = mistake.given[i / kAnchors.size()];
  }
  ranges[1].range += mistake.late;
  return ranges;
}

}  // namespace

TEST_CASE("wrong arms and late ranges are refused as often as noise lets any test see them") {
  const Ranges exact = test::tag_ranges<double, 2>(kPlace, kHeading, kArms, kAnchors);
  const double bound = chi_squared_gate(5, static_cast<double>(kPoseSigmas));
  const Mistake mistakes[] = {
      {"none"},
      {"baseline given as 0.8 m", {{0, 0.4}, {0, -0.4}}},
      {"baseline given as 1 m", {{0, 0.5}, {0, -0.5}}},
      {"baseline given as 1.2 m", {{0, 0.6}, {0, -0.6}}},
      {"baseline given as 1.5 m", {{0, 0.75}, {0, -0.75}}},
      {"baseline given as 0.1 m", {{0, 0.05}, {0, -0.05}}},
      {"one arm 0.3 m too far forward", {{0.3, 0.3}, {0, -0.3}}},
      {"one arm 0.6 m too far forward", {{0.6, 0.3}, {0, -0.3}}},
      {"one arm 1 m too far forward", {{1.0, 0.3}, {0, -0.3}}},
      {"tags exchanged", {{0, -0.3}, {0, 0.3}}},
      {"one range 0.5 m late", kArms, 0.5},
      {"one range 1 m late", kArms, 1},
      {"one range 1.5 m late", kArms, 1.5},
  };
  for (const Mistake& mistake : mistakes) {
    CAPTURE(mistake.what);
    // What of the mistake no pose takes up: the χ² that it leaves without noise.
    const auto clean = solve_pose(with_mistake(exact, mistake));
    REQUIRE(clean);
    const double hidden = clean->chi_squared;
    const double expected = power(bound, 5, hidden);
    sim::Random random{"wrong arms"};
    constexpr int draws = 2'000;
    int refused = 0;
    int answered_wrong = 0;
    for (int i = 0; i < draws; ++i) {
      const auto ranges = with_mistake(test::noisy<double, 2>(random, exact), mistake);
      const auto pose = pose_from_ranges(ranges);
      if (!pose) {
        CHECK((pose.error() == Error::InconsistentRanges ||
               pose.error() == Error::AmbiguousSolution));
        ++refused;
        continue;
      }
      const double turn = angle_difference(pose->heading, kHeading);
      const double nees =
          test::normalised_squared_error<double, 3>({pose->position[0], pose->position[1], turn},
                                                    pose->covariance, {kPlace[0], kPlace[1], 0});
      if (nees > 25) ++answered_wrong;
    }
    const double share = static_cast<double>(refused) / draws;
    MESSAGE(mistake.what, ": λ = ", hidden, ", refused ", share, ", by theory ", expected,
            "; answered with NEES above 25: ", static_cast<double>(answered_wrong) / draws);
    // Four deviations of a share of 2,000, and what the gate's formula (6 % of the quantile) and
    // the curvature of ranges over some decimetres of heading add.
    const double spread = std::sqrt(expected * (1 - expected) / draws);
    CHECK(std::abs(share - expected) < 4 * spread + 0.05);
    // Where the noise does not hide it, it is refused.
    if (hidden > 60) CHECK(share > 0.97);
    // Sound ranges are answered.
    if (hidden < 1e-6) CHECK(refused == 0);
  }
}

TEST_CASE("with more anchors the same mistakes leave more to see") {
  // Twelve anchors around: λ grows as their number.
  std::vector<Vec<double, 2>> around;
  for (int k = 0; k < 12; ++k) {
    const double angle = k * std::numbers::pi / 6;
    around.emplace_back(5 + 6 * std::cos(angle), 4 + 6 * std::sin(angle));
  }
  Ranges ranges = test::tag_ranges<double, 2>(kPlace, kHeading, kArms, around);
  for (auto& r : ranges) r.lever_arm *= 2;
  const auto fix = solve_pose(ranges);
  REQUIRE(fix);
  // 0.3 m along the baseline per tag, seen by cos² of the ranges' directions: half of 24.
  CHECK(fix->chi_squared == doctest::Approx(0.09 / 0.01 * 12).epsilon(0.15));
  CHECK(pose_from_ranges(ranges).error() == Error::InconsistentRanges);
}

TEST_CASE_TEMPLATE("tags nearer to each other than noise lets tell have no heading", S, float,
                   double) {
  sim::Random random{"near tags"};
  std::vector<Vec<S, 2>> anchors;
  for (const auto& anchor : kAnchors) anchors.push_back(anchor.cast<S>());
  for (const double arm : {1e-2, 1e-4, 1e-6, 1e-9}) {
    const std::vector<Vec<S, 2>> arms{{0, S(arm)}, {0, S(-arm)}};
    const auto ranges = test::noisy<S, 2>(
        random, test::tag_ranges<S, 2>(kPlace.cast<S>(), S(kHeading), arms, anchors));
    const auto pose = pose_from_ranges(ranges);
    REQUIRE_FALSE(pose);
    CHECK(pose.error() == Error::HeadingUndetermined);
    // A compass has one.
    const auto known = pose_from_ranges(ranges, {.heading = Measured<S>{S(0.7), S(0.01)}});
    REQUIRE(known);
    CHECK(known->covariance(2, 2) == doctest::Approx(0.01).epsilon(0.05));
    // One that says nothing does not help.
    CHECK(pose_from_ranges(ranges, {.heading = Measured<S>{S(0.7), S(100)}}).error() ==
          Error::HeadingUndetermined);
  }
  // Ranges a hundred times as good, a hundred times nearer.
  const std::vector<Vec<S, 2>> arms{{0, S(0.02)}, {0, S(-0.02)}};
  const auto sharp = test::tag_ranges<S, 2>(kPlace.cast<S>(), S(kHeading), arms, anchors, S(0.001));
  const auto pose = pose_from_ranges(sharp);
  REQUIRE(pose);
  CHECK(pose->heading == doctest::Approx(kHeading).epsilon(0.01));
}

TEST_CASE_TEMPLATE("absurd lengths are named for what they are", S, float, double) {
  std::vector<Vec<S, 2>> anchors;
  for (const auto& anchor : kAnchors) anchors.push_back(anchor.cast<S>());
  const std::vector<Vec<S, 2>> arms{{0, S(0.3)}, {0, S(-0.3)}};
  const auto good = test::tag_ranges<S, 2>(kPlace.cast<S>(), S(kHeading), arms, anchors);
  const auto error = [](const std::vector<TagRange<S, 2>>& ranges) {
    const auto pose = pose_from_ranges(ranges);
    REQUIRE_FALSE(pose);
    return pose.error();
  };
  const auto far = [](double in_double, double in_float) {
    return static_cast<S>(sizeof(S) == 4 ? in_float : in_double);
  };
  for (const S huge : {far(1e160, 1e20), far(1e308, 3e38), far(1e30, 1e12)}) {
    auto ranges = good;
    ranges[3].range = huge;
    CHECK(error(ranges) == Error::NumericOverflow);
    ranges = good;
    for (auto& r : ranges) r.lever_arm *= huge;
    CHECK(error(ranges) == Error::NumericOverflow);
  }
  // Millimetres for metres, and worse: both images miss the ranges by far.
  for (const S units : {S(1e3), S(1e5), S(1e6)}) {
    auto ranges = good;
    for (auto& r : ranges) r.lever_arm *= units;
    CHECK(error(ranges) == Error::InconsistentRanges);
  }
  // Anchors in one place are that at any scale.
  auto ranges = good;
  for (auto& r : ranges) r.anchor = {S(1), S(2)};
  CHECK(error(ranges) == Error::DegenerateGeometry);
  // A range of no weight is no harm.
  ranges = good;
  ranges[3].sigma = far(1e100, 1e30);
  CHECK(pose_from_ranges(ranges));
}

}  // namespace tests::solve_pose_consistency
