// SPDX-License-Identifier: MIT
#include <array>
#include <deque>
#include <limits>
#include <list>
#include <span>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/model/range_set.hpp"

namespace tests::model_range_set {

using namespace uwbpos;

static_assert(RangeSet<std::vector<RangeTo<float, 2>>>);
static_assert(RangeSet<std::array<RangeTo<double, 3>, 4>>);
static_assert(RangeSet<std::span<const RangeTo<double, 2>>>);
static_assert(RangeSet<RangeTo<float, 3>[5]>);
static_assert(!RangeSet<std::list<RangeTo<float, 2>>>);
static_assert(!RangeSet<std::deque<RangeTo<float, 2>>>);
static_assert(!RangeSet<std::vector<double>>);
static_assert(!RangeSet<std::vector<RangeTo<float, 4>>>);

TEST_CASE_TEMPLATE("a set of ranges is checked and what is wrong is named", S, float, double) {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const S infinity = std::numeric_limits<S>::infinity();
  const RangeTo<S, 2> good{{1, 2}, 3};
  const auto check = [&](const RangeTo<S, 2>& last) {
    const std::array<RangeTo<S, 2>, 2> ranges{good, last};
    return check_ranges<S, 2>(ranges, 2);
  };
  CHECK(check(good) == std::nullopt);
  CHECK(check({{nan, 0}, 1}) == Error::NotFinite);
  CHECK(check({{0, infinity}, 1}) == Error::NotFinite);
  CHECK(check({{0, 0}, nan}) == Error::NotFinite);
  CHECK(check({{0, 0}, -infinity}) == Error::NotFinite);
  CHECK(check({{0, 0}, 1, infinity}) == Error::NotFinite);
  CHECK(check({{0, 0}, 1, nan}) == Error::NotFinite);
  CHECK(check({{0, 0}, 1, 0}) == Error::NonPositiveSigma);
  CHECK(check({{0, 0}, 1, -1}) == Error::NonPositiveSigma);
  CHECK(check({{0, 0}, 1, S(1e-12)}) == Error::NonPositiveSigma);
  CHECK(check({{0, 0}, -1}) == Error::NegativeRange);
  CHECK(check({{0, 0}, 0}) == std::nullopt);
  // Noise around zero is no fault: three sigma below it still counts as zero.
  CHECK(check({{0, 0}, S(-0.29), S(0.1)}) == std::nullopt);
  CHECK(check({{0, 0}, S(-0.31), S(0.1)}) == Error::NegativeRange);

  const std::array<RangeTo<S, 2>, 1> single{good};
  CHECK(check_ranges<S, 2>(single, 2) == Error::TooFewMeasurements);
  const std::vector<RangeTo<S, 2>> most(64, good);
  CHECK(check_ranges<S, 2>(most, 2) == std::nullopt);
  const std::vector<RangeTo<S, 2>> too_many(65, good);
  CHECK(check_ranges<S, 2>(too_many, 2) == Error::TooManyMeasurements);
}

TEST_CASE_TEMPLATE("chi squared is the sum of squared normalised residuals", S, float, double) {
  const std::array<RangeTo<S, 2>, 2> ranges{RangeTo<S, 2>{{3, 4}, 6, S(0.5)},
                                            RangeTo<S, 2>{{0, 2}, 1, S(0.25)}};
  CHECK(chi_squared<S, 2>(ranges, Vec<S, 2>::Zero()) == doctest::Approx(2 * 2 + 4 * 4));
}

}  // namespace tests::model_range_set
