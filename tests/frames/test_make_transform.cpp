// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <numbers>

#include <doctest/doctest.h>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/frames/make_transform.hpp"
#include "uwbpos/frames/subnet.hpp"

#include "frames/scenes.hpp"

namespace tests::frames_make_transform {

using namespace uwbpos;

TEST_CASE_TEMPLATE("a quarter turn takes x to y", S, float, double) {
  constexpr S quarter = std::numbers::pi_v<S> / 2;
  const S tiny = S(4) * std::numeric_limits<S>::epsilon();
  const auto plane = transform_from_yaw(quarter, Vec<S, 2>{10, 20});
  REQUIRE(plane);
  CHECK((apply(*plane, {1, 0}) - Vec<S, 2>{10, 21}).norm() <= S(20) * tiny);
  CHECK(std::abs(yaw(*plane) - quarter) <= tiny);
  const auto space = transform_from_yaw(quarter, Vec<S, 3>{10, 20, 3});
  REQUIRE(space);
  CHECK((apply(*space, {1, 0, 2}) - Vec<S, 3>{10, 21, 5}).norm() <= S(20) * tiny);
  CHECK(std::abs(yaw(*space) - quarter) <= tiny);
}

TEST_CASE_TEMPLATE("every yaw is read back, and is a rotation", S, float, double) {
  for (int degree = -179; degree <= 180; ++degree) {
    const S angle = static_cast<S>(degree) * std::numbers::pi_v<S> / S(180);
    const auto map_T_subnet = transform_from_yaw(angle, Vec<S, 2>{1, 2});
    REQUIRE(map_T_subnet);
    CHECK(std::abs(angle_difference(yaw(*map_T_subnet), angle)) <=
          S(8) * std::numeric_limits<S>::epsilon());
    CHECK(test::rotation_defect<S, 2>(map_T_subnet->rotation) <=
          4 * static_cast<double>(std::numeric_limits<S>::epsilon()));
  }
}

TEST_CASE_TEMPLATE("a matrix typed with three decimals becomes the rotation it was meant to be", S,
                   float, double) {
  sim::Random random{"typed rotations"};
  for (int trial = 0; trial < 200; ++trial) {
    const Mat<S, 3> rotation = test::random_rotation<S, 3>(random);
    const Mat<S, 3> typed = (rotation * S(1000)).array().round() / S(1000);
    const auto made = transform_from_rotation(typed, Vec<S, 3>{1, 2, 3});
    REQUIRE(made);
    CHECK(test::rotation_defect<S, 3>(made->rotation) <=
          8 * static_cast<double>(std::numeric_limits<S>::epsilon()));
    // No farther than the typing moved it: half a digit an entry, nine entries.
    CHECK((made->rotation - rotation).norm() < S(0.0015));
  }
}

TEST_CASE_TEMPLATE("orthonormalising reaches the nearest rotation from far and stays on it", S,
                   float, double) {
  sim::Random random{"orthonormalised"};
  for (int trial = 0; trial < 100; ++trial) {
    const Mat<S, 3> rotation = test::random_rotation<S, 3>(random);
    // R·(symmetric positive) has R for its polar factor.
    Mat<S, 3> stretch = Mat<S, 3>::Identity();
    for (int i = 0; i < 3; ++i) stretch(i, i) += S(random.uniform(-0.04, 0.04));
    const Mat<S, 3> found = orthonormalised<S, 3>(rotation * stretch);
    CHECK((found - rotation).cwiseAbs().maxCoeff() < S(8) * std::numeric_limits<S>::epsilon());
  }
}

TEST_CASE_TEMPLATE("what is no rotation is refused by name", S, float, double) {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const S inf = std::numeric_limits<S>::infinity();
  const Vec<S, 2> t{1, 2};
  const Mat<S, 2> unit = Mat<S, 2>::Identity();
  const auto error = [&](const Mat<S, 2>& r, const Vec<S, 2>& at = Vec<S, 2>{1, 2},
                         const Mat<S, 3>& c = Mat<S, 3>::Zero()) {
    const auto made = transform_from_rotation(r, at, c);
    REQUIRE_FALSE(made);
    return made.error();
  };
  CHECK(transform_from_rotation(unit, t));
  Mat<S, 2> mirror = unit;
  mirror(1, 1) = -1;
  CHECK(error(mirror) == Error::NotARotation);
  CHECK(error(unit * S(1.01)) == Error::NotARotation);
  CHECK(error(Mat<S, 2>::Zero()) == Error::NotARotation);
  CHECK(error(Mat<S, 2>::Ones()) == Error::NotARotation);
  Mat<S, 2> shear = unit;
  shear(0, 1) = S(0.02);
  CHECK(error(shear) == Error::NotARotation);
  CHECK(error(unit * nan) == Error::NotFinite);
  CHECK(error(unit * std::numeric_limits<S>::max()) == Error::NotARotation);  // overflows
  CHECK(error(unit, {inf, 0}) == Error::NotFinite);
  CHECK(error(unit, t, Mat<S, 3>::Identity() * nan) == Error::NotFinite);
  Mat<S, 3> c = Mat<S, 3>::Identity();
  c(0, 0) = -1;
  CHECK(error(unit, t, c) == Error::InvalidCovariance);
  c = Mat<S, 3>::Identity();
  c(0, 1) = S(0.5);
  CHECK(error(unit, t, c) == Error::InvalidCovariance);  // not symmetric
  c(1, 0) = S(0.5);
  CHECK(transform_from_rotation(unit, t, c));
  c(0, 1) = c(1, 0) = S(1.5);
  CHECK(error(unit, t, c) == Error::InvalidCovariance);  // a correlation of 1.5

  CHECK(transform_from_yaw(nan, t).error() == Error::NotFinite);
  CHECK(transform_from_yaw(inf, t).error() == Error::NotFinite);
  CHECK(transform_from_yaw(S(0), Vec<S, 2>{nan, 0}).error() == Error::NotFinite);
  CHECK(transform_from_yaw(S(0), t, c).error() == Error::InvalidCovariance);
  Mat<S, 3> flipped = Mat<S, 3>::Identity();
  flipped(2, 2) = -1;
  CHECK(transform_from_rotation(flipped, Vec<S, 3>{0, 0, 0}).error() == Error::NotARotation);
}

TEST_CASE_TEMPLATE("a covariance that was written down with few digits is made one", S, float,
                   double) {
  Mat<S, 3> c = Mat<S, 3>::Zero();
  c(0, 0) = S(0.0131);
  c(2, 2) = S(1.2593);
  c(0, 2) = c(2, 0) = S(0.1285);  // a correlation of 1.0005
  c(0, 2) += S(5e-5);
  const auto made = transform_from_yaw(S(0.3), Vec<S, 2>{1, 2}, c);
  REQUIRE(made);
  const Mat<S, 3>& known = made->covariance;
  CHECK(known.diagonal() == c.diagonal());
  CHECK(known(2, 0) == known(0, 2));
  CHECK(known(2, 0) == std::sqrt(c(0, 0)) * std::sqrt(c(2, 2)));
  CHECK(known(1, 0) == S(0));
  Subnets<S, 2, 2> site;
  Transform<S, 2> given = *made;
  given.covariance = c * S(0.01);
  REQUIRE(site.add({1, 7, given}));
  const Mat<S, 3> kept = site.covariance(0, 0);
  CHECK(kept(2, 0) <= std::sqrt(kept(0, 0)) * std::sqrt(kept(2, 2)));
}

TEST_CASE_TEMPLATE("a planar transform lifted into space does the same above its floor", S, float,
                   double) {
  sim::Random random{"lifted"};
  for (int trial = 0; trial < 50; ++trial) {
    const auto plane = test::random_transform<S, 2>(random);
    const auto space = in_space(plane, {S(6), S(0.0004)});
    const Vec<S, 2> p = test::random_in_cube<S, 2>(random, S(20));
    const Vec<S, 3> mapped = apply(space, {p[0], p[1], S(1.5)});
    CHECK((mapped.template head<2>() - apply(plane, p)).norm() < S(1e-4));
    CHECK(mapped[2] == S(7.5));

    Fix<S, 2> flat{};
    flat.position = p;
    flat.covariance = test::random_covariance<S, 2>(random, 0.1, 0.2);
    Fix<S, 3> high{};
    high.position = {p[0], p[1], S(1.5)};
    high.covariance.setZero();
    high.covariance.template topLeftCorner<2, 2>() = flat.covariance;
    const Mat<S, 2> expected = apply(plane, flat).covariance;
    const Mat<S, 3> found = apply(space, high).covariance;
    CHECK((found.template topLeftCorner<2, 2>() - expected).norm() < S(1e-5) * expected.norm());
    CHECK(found(2, 2) == S(0.0004));
    CHECK(found(2, 0) == S(0));
  }
}

}  // namespace tests::frames_make_transform
