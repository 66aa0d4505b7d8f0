// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include "uwbpos/core/quaternion.hpp"

#include "support/random_geometry.hpp"

namespace tests::core_quaternion {

using namespace uwbpos;

namespace {

// A dozen products of numbers up to one.
template <class S>
constexpr S kRounding = S(16) * std::numeric_limits<S>::epsilon();

}  // namespace

TEST_CASE_TEMPLATE("quaternion: products are those of the matrices", S, float, double) {
  sim::Random random{"quaternions"};
  for (int i = 0; i < 200; ++i) {
    const auto p = quaternion_from_turn<S>(test::random_in_cube<S, 3>(random, S(3)));
    const auto q = quaternion_from_turn<S>(test::random_in_cube<S, 3>(random, S(3)));
    const Mat<S, 3> both = rotation_matrix(p) * rotation_matrix(q);
    CHECK((rotation_matrix(multiply<S>(p, q)) - both).cwiseAbs().maxCoeff() < kRounding<S>);
    CHECK(rotation_matrix(p).determinant() == doctest::Approx(1).epsilon(1e-5));
    const Vec<S, 3> v = test::random_direction<S, 3>(random);
    CHECK((rotate<S>(p, v) - rotation_matrix(p) * v).norm() < kRounding<S>);
  }
}

TEST_CASE_TEMPLATE("quaternion: turns are about their axis, by their length", S, float, double) {
  const auto quarter = quaternion_from_turn<S>({S(0), S(0), std::numbers::pi_v<S> / 2});
  CHECK((rotate<S>(quarter, {S(1), S(0), S(0)}) - Vec<S, 3>{S(0), S(1), S(0)}).norm() <
        kRounding<S>);
  CHECK((quarter - quaternion_from_yaw(std::numbers::pi_v<S> / 2)).norm() < kRounding<S>);
  CHECK(quaternion_from_turn<S>(Vec<S, 3>::Zero()) == identity_quaternion<S>());
  // On either side of where the series ends.
  for (const double turn : {1e-8, 0.0999, 0.1001}) {
    const auto small = quaternion_from_turn<S>({static_cast<S>(turn), S(0), S(0)});
    CHECK(static_cast<double>(small[1]) == doctest::Approx(std::sin(turn / 2)).epsilon(1e-6));
  }
  CHECK(normalised<S>(Quaternion<S>::Zero()) == identity_quaternion<S>());
}

TEST_CASE_TEMPLATE("quaternion: the shortest rotation takes one direction to the other", S, float,
                   double) {
  sim::Random random{"between"};
  for (int i = 0; i < 200; ++i) {
    const Vec<S, 3> from = S(3) * test::random_direction<S, 3>(random);
    const Vec<S, 3> to = test::random_direction<S, 3>(random);
    CHECK((rotate<S>(quaternion_between<S>(from, to), from) - S(3) * to).norm() <
          S(3000) * kRounding<S>);  // near the opposite it loses digits
  }
  for (int axis = 0; axis < 3; ++axis) {
    Vec<S, 3> up = Vec<S, 3>::Zero();
    up[axis] = S(1);
    CHECK((rotate<S>(quaternion_between<S>(up, -up), up) + up).norm() < kRounding<S>);
    CHECK(quaternion_between<S>(up, Vec<S, 3>::Zero()) == identity_quaternion<S>());
  }
}

TEST_CASE_TEMPLATE("quaternion: directions count, however long or short the vectors are", S, float,
                   double) {
  using Limits = std::numeric_limits<S>;
  const Vec<S, 3> x{S(1), S(0), S(0)};
  const Vec<S, 3> y{S(0), S(1), S(0)};
  for (const S from : {Limits::denorm_min(), Limits::min(), S(1), Limits::max()}) {
    for (const S to : {Limits::denorm_min(), Limits::min(), S(1), Limits::max()}) {
      CHECK((rotate<S>(quaternion_between<S>(from * x, to * y), x) - y).norm() < kRounding<S>);
      CHECK((rotate<S>(quaternion_between<S>(from * x, -to * x), x) + x).norm() < kRounding<S>);
    }
  }
  for (const S bad : {Limits::infinity(), Limits::quiet_NaN()}) {
    CHECK(quaternion_between<S>({bad, S(1), S(0)}, y) == identity_quaternion<S>());
    CHECK(quaternion_between<S>(x, {S(1), S(0), bad}) == identity_quaternion<S>());
  }
}

TEST_CASE_TEMPLATE("quaternion: the conjugate turns back", S, float, double) {
  sim::Random random{"conjugate"};
  for (int i = 0; i < 200; ++i) {
    const Quaternion<S> q = test::random_direction<S, 4>(random);
    const Vec<S, 3> v = test::random_direction<S, 3>(random);
    CHECK((rotate<S>(conjugate(q), rotate<S>(q, v)) - v).norm() < S(10) * kRounding<S>);
  }
}

}  // namespace tests::core_quaternion
