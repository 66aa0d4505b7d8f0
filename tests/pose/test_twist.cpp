// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <numbers>

#include <doctest/doctest.h>

#include "uwbpos/pose/twist.hpp"
#include "uwbpos/sim/noise.hpp"

#include "support/nees.hpp"
#include "support/statistics.hpp"

namespace tests::pose_twist {

using namespace uwbpos;

namespace {

template <class S>
Pose2<S> pose_at(S x, S y, S heading, S sigma = S(0)) {
  Mat<S, 3> covariance = Mat<S, 3>::Identity() * (sigma * sigma);
  return {{x, y}, heading, covariance};
}

}  // namespace

TEST_CASE_TEMPLATE("straight ahead, sideways, and turning on the spot", S, float, double) {
  const S quarter = std::numbers::pi_v<S> / 2;
  auto twist = twist_between(pose_at<S>(1, 1, quarter), pose_at<S>(1, 2, quarter), S(0.5));
  REQUIRE(twist);
  CHECK(twist->global_velocity[0] == S(0));
  CHECK(twist->global_velocity[1] == S(2));
  CHECK(twist->body_velocity[0] == doctest::Approx(2));
  CHECK(std::abs(twist->body_velocity[1]) < S(1e-6));
  CHECK(twist->turn_rate == S(0));

  twist = twist_between(pose_at<S>(1, 1, 0), pose_at<S>(1, 2, 0), S(0.5));
  CHECK(twist->body_velocity[0] == S(0));
  CHECK(twist->body_velocity[1] == S(2));  // to the left

  twist = twist_between(pose_at<S>(1, 1, S(-0.1)), pose_at<S>(1, 1, S(0.3)), S(0.2));
  CHECK(norm(twist->body_velocity) == S(0));
  CHECK(twist->turn_rate == doctest::Approx(2));
}

TEST_CASE_TEMPLATE("over ±π the turn goes the short way, and so does the mid heading", S, float,
                   double) {
  const S pi = std::numbers::pi_v<S>;
  const auto twist =
      twist_between(pose_at<S>(0, 0, pi - S(0.1)), pose_at<S>(-1, 0, S(0.1) - pi), S(1));
  REQUIRE(twist);
  CHECK(twist->turn_rate == doctest::Approx(0.2).epsilon(1e-5));
  CHECK(twist->body_velocity[0] == doctest::Approx(1));  // forward, not backward
  CHECK(std::abs(twist->body_velocity[1]) < S(1e-6));
}

TEST_CASE("on an arc the body's velocity has no sideways part") {
  // Radius 2 m, 0.6 rad: the chord is 2·2·sin 0.3.
  const double radius = 2;
  const double turn = 0.6;
  const double start = 1.1;
  const auto on_arc = [&](double heading) {
    return pose_at<double>(radius * std::sin(heading), -radius * std::cos(heading), heading);
  };
  const auto twist = twist_between(on_arc(start), on_arc(start + turn), 1.0);
  REQUIRE(twist);
  CHECK(twist->body_velocity[0] == doctest::Approx(2 * radius * std::sin(turn / 2)));
  CHECK(std::abs(twist->body_velocity[1]) < 1e-12);
  CHECK(twist->turn_rate == doctest::Approx(turn));
}

TEST_CASE("both covariances predict the errors, correlated poses' errors included") {
  sim::Random random{"twist"};
  Mat<double, 3> root = Mat<double, 3>::Zero();  // lower triangular
  root << 0.02, 0, 0, 0.01, 0.03, 0, -0.01, 0.005, 0.02;
  Pose2<double> first = pose_at<double>(1, 2, 2.9);
  Pose2<double> second = pose_at<double>(1.5, 1.8, -3.0);
  first.covariance = root * root.transpose();
  second.covariance = 0.5 * first.covariance;
  const double dt = 0.4;
  const auto truth = twist_between(first, second, dt);
  REQUIRE(truth);
  double global = 0;
  double body = 0;
  constexpr int draws = 4000;
  for (int i = 0; i < draws; ++i) {
    const auto off = [&](Pose2<double> pose, double scale) {
      const Vec<double, 3> e =
          scale * root * Vec<double, 3>{random.normal(), random.normal(), random.normal()};
      pose.position += e.head<2>();
      pose.heading = wrap_angle(pose.heading + e[2]);
      return pose;
    };
    const auto twist = twist_between(off(first, 1), off(second, std::sqrt(0.5)), dt);
    REQUIRE(twist);
    const auto stacked = [](const Vec<double, 2>& v, double w) {
      return Vec<double, 3>{v[0], v[1], w};
    };
    global += test::normalised_squared_error<double, 3>(
        stacked(twist->global_velocity, twist->turn_rate), twist->global_covariance,
        stacked(truth->global_velocity, truth->turn_rate));
    body += test::normalised_squared_error<double, 3>(
        stacked(twist->body_velocity, twist->turn_rate), twist->body_covariance,
        stacked(truth->body_velocity, truth->turn_rate));
  }
  CHECK(test::mean_nees_interval(3, draws).contains(global / draws));
  CHECK(test::mean_nees_interval(3, draws).contains(body / draws));
}

TEST_CASE_TEMPLATE("no time, time backwards, and what is no pose are refused by name", S, float,
                   double) {
  constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  const auto a = pose_at<S>(0, 0, 0, S(0.01));
  const auto b = pose_at<S>(1, 0, 0, S(0.01));
  CHECK(twist_between(a, b, S(0)).error() == Error::TimeNotIncreasing);
  CHECK(twist_between(a, b, S(-1)).error() == Error::TimeNotIncreasing);
  CHECK(twist_between(a, b, nan).error() == Error::NotFinite);
  CHECK(twist_between(a, b, std::numeric_limits<S>::infinity()).error() == Error::NotFinite);
  CHECK(twist_between(a, b, std::numeric_limits<S>::denorm_min()).error() ==
        Error::NumericOverflow);
  CHECK(twist_between(pose_at<S>(nan, 0, 0), b, S(1)).error() == Error::NotFinite);
  CHECK(twist_between(a, pose_at<S>(0, 0, nan), S(1)).error() == Error::NotFinite);
  auto bad = b;
  bad.covariance(2, 2) = S(-1);
  CHECK(twist_between(a, bad, S(1)).error() == Error::InvalidCovariance);
}

}  // namespace tests::pose_twist
