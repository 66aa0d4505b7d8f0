// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <numbers>

#include <doctest/doctest.h>

#include "uwbpos/pose/two_tag.hpp"

#include "support/nees.hpp"
#include "support/random_geometry.hpp"
#include "support/statistics.hpp"

namespace tests::pose_two_tag {

using namespace uwbpos;

namespace {

template <class S>
Fix<S, 2> tag_at(S x, S y, S sigma = S(0.02)) {
  return {{x, y}, Mat<S, 2>::Identity() * (sigma * sigma), S(0), 0};
}

// The tags of a robot whose centre is at `centre`.
template <class S>
std::pair<Fix<S, 2>, Fix<S, 2>> tags_of(const Vec<S, 2>& centre, S heading, S baseline) {
  const Vec<S, 2> left{-std::sin(heading) * baseline / 2, std::cos(heading) * baseline / 2};
  return {tag_at<S>(centre[0] + left[0], centre[1] + left[1]),
          tag_at<S>(centre[0] - left[0], centre[1] - left[1])};
}

}  // namespace

TEST_CASE_TEMPLATE("all four quadrants and the axes between them", S, float, double) {
  // Rounding of coordinates of some metres, over a baseline of 0.6 m.
  const S tolerance = S(50) * std::numeric_limits<S>::epsilon();
  for (int degrees = -179; degrees <= 180; ++degrees) {
    const S heading = degrees_to_radians(S(degrees));
    const auto [left, right] = tags_of<S>({4, S(-3)}, heading, S(0.6));
    const auto pose = two_tag_pose(left, right, S(0.6));
    REQUIRE(pose);
    CHECK(std::abs(angle_difference(pose->heading, heading)) < tolerance);
    CHECK(norm<S, 2>(pose->position - Vec<S, 2>{4, S(-3)}) < tolerance);
    CHECK(pose->heading > -std::numbers::pi_v<S>);
    CHECK(pose->heading <= std::numbers::pi_v<S>);
  }
}

TEST_CASE_TEMPLATE("left and right as the robot has them: a tag to the left of forward", S, float,
                   double) {
  // Facing +x the left tag is at greater y; facing −x, at smaller y: heading +π, not −π.
  CHECK(two_tag_pose(tag_at<S>(0, 1), tag_at<S>(0, -1), S(2))->heading == S(0));
  CHECK(two_tag_pose(tag_at<S>(0, -1), tag_at<S>(0, 1), S(2))->heading == std::numbers::pi_v<S>);
  CHECK(two_tag_pose(tag_at<S>(-1, 0), tag_at<S>(1, 0), S(2))->heading ==
        doctest::Approx(std::numbers::pi / 2));
  CHECK(two_tag_pose(tag_at<S>(1, 0), tag_at<S>(-1, 0), S(2))->heading ==
        doctest::Approx(-std::numbers::pi / 2));
}

TEST_CASE_TEMPLATE("equal isotropic errors: var ψ = 2σ²/d², the centre's σ²/2, no correlation", S,
                   float, double) {
  const auto pose = two_tag_pose(tag_at<S>(1, 2), tag_at<S>(S(1.6), 2), S(0.6));
  REQUIRE(pose);
  CHECK(pose->covariance(2, 2) == doctest::Approx(2 * 0.02 * 0.02 / (0.6 * 0.6)));
  CHECK(pose->covariance(0, 0) == doctest::Approx(0.02 * 0.02 / 2));
  CHECK(pose->covariance(0, 2) == S(0));
  CHECK(pose->covariance == pose->covariance.transpose());
}

TEST_CASE("unequal, correlated errors: the covariance predicts the errors") {
  sim::Random random{"two tags"};
  double nees = 0;
  constexpr int draws = 4000;
  for (int i = 0; i < draws; ++i) {
    const double heading = random.uniform(-3.1, 3.1);
    auto [left, right] = tags_of<double>({3, 5}, heading, 0.6);
    left.covariance << 4e-4, 2e-4, 2e-4, 3e-4;
    right.covariance << 1e-4, -5e-5, -5e-5, 2e-4;
    for (Fix<double, 2>* tag : {&left, &right}) {
      // A root of the covariance, by Cholesky.
      const Mat<double, 2>& c = tag->covariance;
      const double a = std::sqrt(c(0, 0));
      const double b = c(1, 0) / a;
      const double u = random.normal();
      tag->position += Vec<double, 2>{a * u, b * u + std::sqrt(c(1, 1) - b * b) * random.normal()};
    }
    const auto pose = two_tag_pose(left, right, 0.6);
    REQUIRE(pose);
    const double turn = angle_difference(pose->heading, heading);
    nees += test::normalised_squared_error<double, 3>({pose->position[0], pose->position[1], turn},
                                                      pose->covariance, {3, 5, 0});
  }
  CHECK(test::mean_nees_interval(3, draws).contains(nees / draws));
}

TEST_CASE_TEMPLATE("a baseline within noise is passed, one beyond it is named", S, float, double) {
  // σ of the distance: √2 · 2 cm; five of them, and (5 · 2.83 cm)²/2d for the sideways part.
  const auto left = tag_at<S>(0, S(0.3));
  const auto right = tag_at<S>(0, S(-0.3));
  CHECK(two_tag_pose(left, right, S(0.6)));
  CHECK(two_tag_pose(left, right, S(0.72)));
  CHECK(two_tag_pose(left, right, S(0.5)));
  CHECK(two_tag_pose(left, right, S(0.9)).error() == Error::BaselineMismatch);
  CHECK(two_tag_pose(left, right, S(0.3)).error() == Error::BaselineMismatch);
  // Exact tags: rounding is all that is allowed.
  const auto exact_left = tag_at<S>(0, S(0.3), S(0));
  const auto exact_right = tag_at<S>(0, S(-0.3), S(0));
  CHECK(two_tag_pose(exact_left, exact_right, S(0.6)));
  CHECK(two_tag_pose(exact_left, exact_right, S(0.61)).error() == Error::BaselineMismatch);
}

TEST_CASE("tags that noise brought together say less of the heading, and the variance says so") {
  // σ = 0.15 m at 0.6 m: with var ψ = 2σ²/d² one answer in 700 is beyond five deviations.
  sim::Random random{"near tags"};
  constexpr int draws = 20'000;
  int far = 0;
  double sum = 0;
  int answered = 0;
  for (int i = 0; i < draws; ++i) {
    const double heading = random.uniform(-3.1, 3.1);
    auto [left, right] = tags_of<double>({3, 5}, heading, 0.6);
    for (Fix<double, 2>* tag : {&left, &right}) {
      tag->position += test::random_normal<double, 2>(random, 0.15);
      tag->covariance = Mat<double, 2>::Identity() * (0.15 * 0.15);
    }
    const auto pose = two_tag_pose(left, right, 0.6);
    if (!pose) {
      CHECK(
          (pose.error() == Error::BaselineMismatch || pose.error() == Error::HeadingUndetermined));
      continue;
    }
    ++answered;
    const double turn = angle_difference(pose->heading, heading);
    const double nees = turn * turn / pose->covariance(2, 2);
    sum += nees;
    if (nees > 25) ++far;
  }
  CHECK(answered > draws * 0.999);
  CHECK(far <= draws / 5000);
  // Second order of 20° of noise: 1.08 by 200,000 draws; 1.22 with the baseline alone.
  CHECK(sum / answered < 1.12);
}

TEST_CASE_TEMPLATE("tags nearer to each other than their noise lets tell have no heading", S, float,
                   double) {
  // 2 · 0.04 m² / (0.6 m · length) is π²/3 at 4 cm.
  const auto pair = [](S length) {
    return two_tag_pose(tag_at<S>(0, length / 2, S(0.2)), tag_at<S>(0, -length / 2, S(0.2)),
                        S(0.6));
  };
  CHECK(pair(S(0.03)).error() == Error::HeadingUndetermined);
  REQUIRE(pair(S(0.05)));
  CHECK(pair(S(0.05))->covariance(2, 2) == doctest::Approx(0.08 / (0.6 * 0.05)));
  CHECK(pair(S(0.6))->covariance(2, 2) == doctest::Approx(0.08 / 0.36));
}

TEST_CASE_TEMPLATE("what has no pose is refused by name", S, float, double) {
  constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  constexpr S infinity = std::numeric_limits<S>::infinity();
  const auto left = tag_at<S>(1, 2);
  const auto right = tag_at<S>(1, S(1.4));
  const auto error = [](const Fix<S, 2>& l, const Fix<S, 2>& r, S baseline) {
    const auto pose = two_tag_pose(l, r, baseline);
    REQUIRE_FALSE(pose);
    return pose.error();
  };
  CHECK(error(left, left, S(0.6)) == Error::HeadingUndetermined);
  CHECK(error(left, right, S(0)) == Error::InvalidOption);
  CHECK(error(left, right, S(-0.6)) == Error::InvalidOption);
  CHECK(error(left, right, nan) == Error::NotFinite);
  CHECK(error(left, right, infinity) == Error::NotFinite);
  CHECK(error(tag_at<S>(nan, 2), right, S(0.6)) == Error::NotFinite);
  CHECK(error(left, tag_at<S>(1, infinity), S(0.6)) == Error::NotFinite);
  Fix<S, 2> bad = right;
  bad.covariance(0, 0) = -bad.covariance(0, 0);
  CHECK(error(left, bad, S(0.6)) == Error::InvalidCovariance);
  bad.covariance(0, 0) = nan;
  CHECK(error(left, bad, S(0.6)) == Error::NotFinite);
  constexpr S huge = std::numeric_limits<S>::max();
  CHECK(error(tag_at<S>(-huge, 0), tag_at<S>(huge, 0), S(0.6)) == Error::NumericOverflow);
}

// Paper 002: position errors of radius uniform in [0, R] cm in any direction, robot at (4, 4) m,
// heading 45°.
TEST_CASE("the paper's case: MAE and RMSE of heading, and how they go with error and baseline") {
  struct Errors {
    double mae;
    double rmse;
  };
  const auto run = [](double radius, double baseline) {
    sim::Random random{"paper 002"};
    constexpr int draws = 10'000;
    const double heading = std::numbers::pi / 4;
    double sum = 0;
    double squares = 0;
    for (int i = 0; i < draws; ++i) {
      auto [left, right] = tags_of<double>({4, 4}, heading, baseline);
      for (Fix<double, 2>* tag : {&left, &right}) {
        const double off = random.uniform(0, radius);
        const double angle = random.uniform(-std::numbers::pi, std::numbers::pi);
        tag->position += Vec<double, 2>{off * std::cos(angle), off * std::sin(angle)};
        tag->covariance = Mat<double, 2>::Identity() * (radius * radius / 6);
      }
      const auto pose = two_tag_pose(left, right, baseline);
      REQUIRE(pose);
      const double error = radians_to_degrees(angle_difference(pose->heading, heading));
      sum += std::abs(error);
      squares += error * error;
    }
    return Errors{sum / draws, std::sqrt(squares / draws)};
  };
  const Errors paper = run(0.02, 0.6);
  MESSAGE("2 cm at 60 cm: MAE ", paper.mae, "° (paper 0.951°), RMSE ", paper.rmse, "° (1.169°)");
  CHECK(paper.mae <= 0.951);
  CHECK(paper.rmse <= 1.169);
  // Per axis the variance is R²/6: var ψ = 2 · R²/6 / d², 1.103°; RMSE of 10⁴ draws to 1 %.
  CHECK(paper.rmse ==
        doctest::Approx(radians_to_degrees(0.02 / 0.6 / std::sqrt(3.0))).epsilon(0.03));
  double last = 1e9;
  for (const double radius : {0.08, 0.06, 0.04, 0.02}) {
    const Errors errors = run(radius, 0.6);
    CHECK(errors.mae < last);
    last = errors.mae;
  }
  last = 1e9;
  for (const double baseline : {0.5, 0.6, 0.7, 0.8}) {
    const Errors errors = run(0.02, baseline);
    CHECK(errors.mae < last);
    last = errors.mae;
  }
}

}  // namespace tests::pose_two_tag
