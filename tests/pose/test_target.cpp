// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <numbers>

#include <doctest/doctest.h>

#include "uwbpos/pose/target.hpp"

#include "support/numeric_jacobian.hpp"

namespace tests::pose_target {

using namespace uwbpos;

namespace {

template <class S>
Pose2<S> pose_at(S x, S y, S heading) {
  Mat<S, 3> covariance;
  covariance << S(4e-4), S(1e-4), S(-1e-4), S(1e-4), S(9e-4), S(2e-4), S(-1e-4), S(2e-4), S(1e-3);
  return {{x, y}, heading, covariance};
}

}  // namespace

TEST_CASE_TEMPLATE("the paper's target: 5.66 m straight ahead", S, float, double) {
  const auto seen = bearing_to(pose_at<S>(4, 4, std::numbers::pi_v<S> / 4), Vec<S, 2>{8, 8});
  REQUIRE(seen);
  CHECK(seen->distance == doctest::Approx(4 * std::numbers::sqrt2));
  CHECK(std::abs(seen->bearing) < S(1e-6));
  CHECK(seen->ahead);
  // `Target { distance, bearing, ahead }` first.
  const auto& [distance, bearing, ahead, distance_variance, bearing_variance] = *seen;
  CHECK(distance == seen->distance);
  CHECK(bearing == seen->bearing);
  CHECK(ahead);
  CHECK(distance_variance > S(0));
  CHECK(bearing_variance > S(0));
}

TEST_CASE_TEMPLATE("all around: left is positive, beside is ahead, behind is behind", S, float,
                   double) {
  const S pi = std::numbers::pi_v<S>;
  for (const S heading : {S(0), S(2), S(-3), pi}) {
    for (int degrees = -179; degrees <= 180; ++degrees) {
      if (std::abs(degrees) == 90) continue;  // to rounding either
      const S angle = heading + degrees_to_radians(S(degrees));
      const auto seen = bearing_to(pose_at<S>(1, 2, heading),
                                   Vec<S, 2>{1 + 3 * std::cos(angle), 2 + 3 * std::sin(angle)});
      REQUIRE(seen);
      CHECK(std::abs(angle_difference(seen->bearing, degrees_to_radians(S(degrees)))) < S(1e-5));
      CHECK(seen->bearing > -pi);
      CHECK(seen->bearing <= pi);
      CHECK(seen->ahead == (std::abs(degrees) < 90));
    }
  }
  CHECK(bearing_to(pose_at<S>(0, 0, 0), Vec<S, 2>{0, 1})->ahead);
  CHECK(bearing_to(pose_at<S>(0, 0, 0), Vec<S, 2>{0, -1})->ahead);
  CHECK(bearing_to(pose_at<S>(0, 0, 0), Vec<S, 2>{-1, 0})->bearing == pi);
  CHECK_FALSE(bearing_to(pose_at<S>(0, 0, 0), Vec<S, 2>{-1, 0})->ahead);
}

TEST_CASE("the variances are those of the numeric Jacobian") {
  const Pose2<double> pose = pose_at<double>(1, 2, 0.7);
  const Vec<double, 2> target{3, -1};
  const auto seen = bearing_to(pose, target);
  REQUIRE(seen);
  const auto j = test::numeric_jacobian<2>(
      [&](const Vec<double, 3>& x) {
        const auto at = bearing_to(Pose2<double>{{x[0], x[1]}, x[2], pose.covariance}, target);
        return Vec<double, 2>{at->distance, at->bearing};
      },
      Vec<double, 3>{pose.position[0], pose.position[1], pose.heading});
  const Mat<double, 2> expected = j * pose.covariance * j.transpose();
  CHECK(seen->distance_variance == doctest::Approx(expected(0, 0)).epsilon(1e-6));
  CHECK(seen->bearing_variance == doctest::Approx(expected(1, 1)).epsilon(1e-6));
}

TEST_CASE_TEMPLATE("a target on the robot, and what is no pose, are refused by name", S, float,
                   double) {
  constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(bearing_to(pose_at<S>(1, 2, 0), Vec<S, 2>{1, 2}).error() == Error::BearingUndefined);
  CHECK(bearing_to(pose_at<S>(0, 0, 0), Vec<S, 2>{0, 0}).error() == Error::BearingUndefined);
  CHECK(bearing_to(pose_at<S>(1, 2, 0), Vec<S, 2>{nan, 2}).error() == Error::NotFinite);
  CHECK(bearing_to(pose_at<S>(1, 2, nan), Vec<S, 2>{3, 2}).error() == Error::NotFinite);
  constexpr S huge = std::numeric_limits<S>::max();
  CHECK(bearing_to(pose_at<S>(-huge, 2, 0), Vec<S, 2>{huge, 2}).error() == Error::NumericOverflow);
  auto bad = pose_at<S>(1, 2, 0);
  bad.covariance(0, 0) = S(-1);
  CHECK(bearing_to(bad, Vec<S, 2>{3, 2}).error() == Error::InvalidCovariance);
}

TEST_CASE_TEMPLATE("a target within the position's own error has no bearing", S, float, double) {
  Pose2<S> pose{{1, 2}, S(0.3), Mat<S, 3>::Zero()};
  pose.covariance.diagonal() << S(0.01), S(0.01), S(0.001);
  // (0.1 m / r)² is π²/3 at r = 5.5 cm.
  CHECK(bearing_to(pose, Vec<S, 2>{S(1.05), 2}).error() == Error::BearingUndefined);
  CHECK(bearing_to(pose, Vec<S, 2>{S(1.06), 2}));
  // Errors along the line of sight alone leave the bearing.
  pose.covariance(1, 1) = S(0);
  CHECK(bearing_to(pose, Vec<S, 2>{S(1.05), 2}));
  // A heading of which nothing is known leaves the distance.
  pose.covariance(2, 2) = S(100);
  CHECK(bearing_to(pose, Vec<S, 2>{S(3), 2})->distance == S(2));
}

}  // namespace tests::pose_target
