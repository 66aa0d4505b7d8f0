// SPDX-License-Identifier: MIT
#include <array>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/accuracy/cramer_rao.hpp"

#include "support/random_geometry.hpp"

namespace tests::accuracy_cramer_rao {

using namespace uwbpos;

TEST_CASE_TEMPLATE("in the centre of a square the bound is sigma²/2 each way", S, float, double) {
  // Four anchors on the diagonals: J = Σ g gᵀ/σ² = 2/σ² I.
  const std::array<RangeTo<S, 2>, 4> ranges{
      RangeTo<S, 2>{{0, 0}, 0}, {{8, 0}, 0}, {{8, 8}, 0}, {{0, 8}, 0}};
  const auto bound = cramer_rao_bound(ranges, Vec<S, 2>{4, 4});
  REQUIRE(bound);
  CHECK((*bound)(0, 0) == doctest::Approx(0.005));
  CHECK((*bound)(1, 1) == doctest::Approx(0.005));
  CHECK((*bound)(0, 1) == doctest::Approx(0).epsilon(1e-6));
}

TEST_CASE_TEMPLATE("one more range never makes the bound worse", S, float, double) {
  sim::Random random{"bound shrinks"};
  std::vector<RangeTo<S, 2>> ranges;
  const Vec<S, 2> position{S(0.5), S(-0.25)};
  for (int i = 0; i < 2; ++i) ranges.push_back({test::random_in_cube<S, 2>(random, S(5)), 0});
  auto before = cramer_rao_bound(ranges, position);
  REQUIRE(before);
  for (int i = 0; i < 20; ++i) {
    ranges.push_back({test::random_in_cube<S, 2>(random, S(5)), 0});
    const auto after = cramer_rao_bound(ranges, position);
    REQUIRE(after);
    CHECK(after->trace() < before->trace());
    before = after;
  }
}

TEST_CASE_TEMPLATE("a bound that does not exist is refused by name", S, float, double) {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  using R = RangeTo<S, 2>;
  const auto bound = [](const std::vector<R>& ranges, Vec<S, 2> at = Vec<S, 2>{1, 0}) {
    const auto result = cramer_rao_bound(ranges, at);
    REQUIRE_FALSE(result);
    return result.error();
  };
  CHECK(bound({}) == Error::TooFewMeasurements);
  CHECK(bound({R{{0, 0}, 1}}) == Error::DegenerateGeometry);
  CHECK(bound({R{{0, 0}, 1}, R{{5, 0}, 1}}) == Error::DegenerateGeometry);  // on their line
  CHECK(bound({R{{1, 0}, 1}, R{{5, 0}, 1}}) == Error::DegenerateGeometry);  // on an anchor
  CHECK(bound({R{{0, 0}, 1}, R{{nan, 0}, 1}}) == Error::NotFinite);
  CHECK(bound({R{{0, 0}, 1}, R{{0, 5}, 1}}, Vec<S, 2>{nan, 1}) == Error::NotFinite);
  CHECK(bound({R{{0, 0}, 1}, R{{0, 5}, 1, 0}}) == Error::NonPositiveSigma);
}

}  // namespace tests::accuracy_cramer_rao
