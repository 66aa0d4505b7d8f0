// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/accuracy/dop.hpp"

#include "support/random_geometry.hpp"

namespace tests::accuracy_dop {

using namespace uwbpos;

TEST_CASE_TEMPLATE("dilutions of known places", S, float, double) {
  // Centre of a square: (GᵀG)⁻¹ = I/2, so HDOP = 1.
  const std::array<Vec<S, 2>, 4> square{Vec<S, 2>{0, 0}, {8, 0}, {8, 8}, {0, 8}};
  const auto flat = range_dop(square, {4, 4});
  REQUIRE(flat);
  CHECK(flat->gdop == doctest::Approx(1));
  CHECK(flat->pdop == doctest::Approx(1));
  CHECK(flat->hdop == doctest::Approx(1));
  CHECK(flat->vdop == S(0));
  // Centre of a cube: (GᵀG)⁻¹ = 3/8 I.
  std::vector<Vec<S, 3>> cube;
  for (int i = 0; i < 8; ++i) cube.push_back({S(i & 1), S(i >> 1 & 1), S(i >> 2 & 1)});
  const auto solid = range_dop(cube, {S(0.5), S(0.5), S(0.5)});
  REQUIRE(solid);
  CHECK(solid->pdop == doctest::Approx(std::sqrt(9.0 / 8)));
  CHECK(solid->hdop == doctest::Approx(std::sqrt(6.0 / 8)));
  CHECK(solid->vdop == doctest::Approx(std::sqrt(3.0 / 8)));
}

TEST_CASE_TEMPLATE("dilution times sigma is the root of the bound's trace", S, float, double) {
  sim::Random random{"dop and bound"};
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<Vec<S, 3>> anchors;
    std::vector<RangeTo<S, 3>> ranges;
    for (int i = 0; i < 6; ++i) {
      anchors.push_back(test::random_in_cube<S, 3>(random, S(5)));
      ranges.push_back({anchors.back(), 0, S(0.1)});
    }
    const Vec<S, 3> at = test::random_in_cube<S, 3>(random, S(4));
    const auto dop = range_dop(anchors, at);
    const auto bound = cramer_rao_bound(ranges, at);
    REQUIRE(dop);
    REQUIRE(bound);
    CHECK(dop->pdop * S(0.1) ==
          doctest::Approx(static_cast<double>(std::sqrt(bound->trace()))).epsilon(1e-3));
  }
}

TEST_CASE_TEMPLATE("a dilution that does not exist is refused by name", S, float, double) {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const auto error = [](const std::vector<Vec<S, 2>>& anchors, Vec<S, 2> at) {
    const auto dop = range_dop(anchors, at);
    REQUIRE_FALSE(dop);
    return dop.error();
  };
  CHECK(error({}, {0, 0}) == Error::TooFewMeasurements);
  CHECK(error({{0, 0}}, {1, 1}) == Error::TooFewMeasurements);
  CHECK(error({{0, 0}, {2, 0}}, {1, 0}) == Error::DegenerateGeometry);
  CHECK(error({{0, 0}, {0, 0}}, {1, 1}) == Error::DegenerateGeometry);
  CHECK(error({{0, 0}, {nan, 0}}, {1, 1}) == Error::NotFinite);
  CHECK(error({{0, 0}, {2, 0}}, {1, nan}) == Error::NotFinite);
}

}  // namespace tests::accuracy_dop
