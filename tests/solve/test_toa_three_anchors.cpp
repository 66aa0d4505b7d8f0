// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/solve/toa_closed_form.hpp"
#include "uwbpos/solve/toa_three_anchors.hpp"

#include "solve/solver_laws.hpp"

namespace tests::solve_toa_three_anchors {

using namespace uwbpos;

namespace {

template <class S>
using Three = std::array<RangeTo<S, 2>, 3>;

template <class S>
Three<S> ranges_between(const Vec<S, 2>& tag, const std::array<Vec<S, 2>, 3>& anchors) {
  Three<S> ranges;
  for (std::size_t i = 0; i < 3; ++i) ranges[i] = {anchors[i], (tag - anchors[i]).norm(), S(0.1)};
  return ranges;
}

}  // namespace

TEST_CASE_TEMPLATE("three anchors: (000-15) is exact, wherever they hang", S, float, double) {
  sim::Random random{"three anchors"};
  int tried = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    std::array<Vec<S, 2>, 3> anchors;
    for (auto& anchor : anchors) anchor = test::random_in_box<S, 2>(random, {-5, -5}, {35, 25});
    const Vec<S, 2> b = anchors[1] - anchors[0];
    const Vec<S, 2> c = anchors[2] - anchors[0];
    const double area = std::abs(static_cast<double>(b[0] * c[1] - b[1] * c[0]));
    if (area < 20) continue;  // near a line rounding grows
    ++tried;
    const Vec<S, 2> tag = test::random_in_box<S, 2>(random, {0, 0}, {30, 20});
    const auto ranges = ranges_between<S>(tag, anchors);
    const auto position = toa_three_anchors(ranges);
    REQUIRE(position);
    CHECK((*position - tag).norm() < (sizeof(S) == 4 ? S(1e-2) : S(1e-11)));
  }
  CHECK(tried > 1500);
}

TEST_CASE_TEMPLATE("three anchors: what they do not tell has a name", S, float, double) {
  const Vec<S, 2> tag{3, 4};
  const std::array<Vec<S, 2>, 3> corner{Vec<S, 2>{0, 0}, Vec<S, 2>{10, 1}, Vec<S, 2>{2, 8}};
  const auto good = ranges_between<S>(tag, corner);
  REQUIRE(toa_three_anchors(good));
  const auto error = [&](const auto& change) {
    auto ranges = good;
    change(ranges);
    const auto position = toa_three_anchors(ranges);
    REQUIRE_FALSE(position);
    return position.error();
  };
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const S infinite = std::numeric_limits<S>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(error([&](auto& r) { r[i].range = nan; }) == Error::NotFinite);
    CHECK(error([&](auto& r) { r[i].range = infinite; }) == Error::NotFinite);
    CHECK(error([&](auto& r) { r[i].anchor[1] = nan; }) == Error::NotFinite);
    CHECK(error([&](auto& r) { r[i].range = S(-0.5); }) == Error::NegativeRange);
  }
  CHECK(error([](auto& r) { r[2].anchor = {20, 2}; }) == Error::DegenerateGeometry);
  CHECK(error([](auto& r) { r[1].anchor = r[0].anchor; }) == Error::DegenerateGeometry);
  const S huge = std::sqrt(std::numeric_limits<S>::max());
  CHECK(error([&](auto& r) { r[1].range = S(2) * huge; }) == Error::NumericOverflow);
  // Sigmas are not read.
  auto ranges = good;
  for (auto& range : ranges) range.sigma = nan;
  CHECK(*toa_three_anchors(ranges) == *toa_three_anchors(good));
}

TEST_CASE_TEMPLATE("on the axes: (000-16) is exact and agrees with the general form", S, float,
                   double) {
  sim::Random random{"on the axes"};
  for (int trial = 0; trial < 500; ++trial) {
    const Vec<S, 2> tag = test::random_in_box<S, 2>(random, {0, 0}, {30, 20});
    const auto ranges =
        ranges_between<S>(tag, {Vec<S, 2>{0, 0}, Vec<S, 2>{30, 0}, Vec<S, 2>{0, 20}});
    const auto axes = toa_on_axes(ranges[0].range, ranges[1].range, ranges[2].range, S(30), S(20));
    REQUIRE(axes);
    CHECK((*axes - tag).norm() < (sizeof(S) == 4 ? S(2e-5) : S(1e-13)));
    const auto anywhere = toa_three_anchors(ranges);
    REQUIRE(anywhere);
    CHECK((*anywhere - *axes).norm() < (sizeof(S) == 4 ? S(5e-5) : S(1e-13)));
    const auto judged = toa_closed_form(ranges);
    REQUIRE(judged);
    const S off = std::min((judged->first - *axes).norm(), (judged->second - *axes).norm());
    CHECK(off < (sizeof(S) == 4 ? S(2e-3) : S(1e-10)));
  }
  const S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(toa_on_axes(nan, S(1), S(1), S(1), S(1)).error() == Error::NotFinite);
  CHECK(toa_on_axes(S(1), S(1), S(1), S(1), -nan).error() == Error::NotFinite);
  CHECK(toa_on_axes(S(1), nan, S(1), S(1), S(1)).error() == Error::NotFinite);
  for (int k = 0; k < 3; ++k) {
    Vec<S, 3> d = Vec<S, 3>::Ones();
    d[k] = S(-1);
    CHECK(toa_on_axes(d[0], d[1], d[2], S(1), S(1)).error() == Error::NegativeRange);
  }
  CHECK(toa_on_axes(S(1), S(1), S(1), S(0), S(1)).error() == Error::DegenerateGeometry);
  CHECK(toa_on_axes(S(1), S(1), S(1), S(1), S(0)).error() == Error::DegenerateGeometry);
  const S huge = std::numeric_limits<S>::max();
  CHECK(toa_on_axes(huge, S(1), huge, S(1e-3), S(1)).error() == Error::NumericOverflow);
  // Finite, though the sum of both is not.
  const S far = std::numeric_limits<S>::max() / S(1.5);
  const auto both = toa_on_axes(S(0), S(0), S(0), far, far);
  REQUIRE(both);
  CHECK(*both == Vec<S, 2>{far / S(2), far / S(2)});
}

}  // namespace tests::solve_toa_three_anchors
