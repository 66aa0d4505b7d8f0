// SPDX-License-Identifier: MIT
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/model/pseudorange.hpp"
#include "uwbpos/solve/bancroft.hpp"
#include "uwbpos/solve/pseudorange_least_squares.hpp"

#include "solve/solver_laws.hpp"
#include "support/numeric_jacobian.hpp"

namespace tests::solve_pseudoranges {

using namespace uwbpos;

TEST_CASE_TEMPLATE("pseudoranges: position and bias are found, whatever the bias", S, float,
                   double) {
  sim::Random random{"biased"};
  for (int trial = 0; trial < 1000; ++trial) {
    auto room = test::random_room<S, 3>(random, 6, 10, false, 5);
    std::vector<Vec<S, 3>> anchors;
    for (const auto& r : room.ranges) anchors.push_back(r.anchor);
    const auto dop = pseudorange_dop(anchors, room.tag);
    if (!dop || dop->gdop > S(10)) continue;
    const S bias = S(random.uniform(-50, 50));
    for (auto& r : room.ranges) r.range += bias;
    const auto fix = locate_with_bias(room.ranges);
    REQUIRE(fix);
    // A bias of 50 m takes two bits from a float's ranges.
    CHECK(static_cast<double>((fix->position - room.tag).norm()) < 10 * test::exactness<S>());
    CHECK(std::abs(static_cast<double>(fix->bias - bias)) < 10 * test::exactness<S>());
    const auto closed = bancroft(room.ranges);
    REQUIRE(closed);
    CHECK(static_cast<double>((closed->first.position - room.tag).norm()) <
          (sizeof(S) == 4 ? 5e-2 : 1e-9));
  }
}

TEST_CASE("pseudoranges: the covariance predicts the errors of position and bias") {
  sim::Random random{"biased consistency"};
  const Vec<double, 2> tag{3, 2};
  auto exact = test::ranges_between<double, 2>(tag, {{0, 0}, {10, 0}, {10, 8}, {0, 8}, {5, 9}});
  double nees = 0;
  constexpr int kTrials = 4000;
  for (int i = 0; i < kTrials; ++i) {
    auto ranges = test::noisy<double, 2>(random, exact);
    for (auto& r : ranges) r.range += 7;
    const auto fix = locate_with_bias(ranges);
    REQUIRE(fix);
    Vec<double, 3> error;
    error << fix->position - tag, fix->bias - 7;
    nees += dot(error, Ldlt<double, 3>{fix->covariance}.solve(error));
    CHECK(fix->degrees_of_freedom == 2);
  }
  CHECK(test::mean_nees_interval(3, kTrials, 0.999).contains(nees / kTrials));
}

TEST_CASE_TEMPLATE("pseudoranges: the gradients agree with central differences", S, float, double) {
  sim::Random random{"pseudorange gradient"};
  const S step = test::difference_step<S>();
  for (int i = 0; i < 100; ++i) {
    const Vec<S, 3> a = test::random_in_cube<S, 3>(random, S(3));
    const Vec<S, 3> b = test::random_in_cube<S, 3>(random, S(3));
    const Vec<S, 3> at = S(0.5) * (a + b) + S(2) * test::random_direction<S, 3>(random);
    if ((at - a).norm() < S(0.5) || (at - b).norm() < S(0.5)) continue;
    const auto difference = [&](const Vec<S, 3>& p) {
      return predict_range_difference<S, 3>(p, a, b).difference;
    };
    const Vec<S, 3> numeric = test::numeric_gradient<S, 3>(difference, at);
    CHECK((numeric - predict_range_difference<S, 3>(at, a, b).gradient).norm() < 100 * step * step);
    Vec<S, 4> state;
    state << at, S(1.5);
    const auto pseudorange = [&](const Vec<S, 4>& x) {
      return predict_pseudorange<S, 3>(x.template head<3>(), x[3], a).pseudorange;
    };
    const Vec<S, 4> gradient = test::numeric_gradient<S, 4>(pseudorange, state);
    CHECK((gradient - predict_pseudorange<S, 3>(at, S(1.5), a).gradient).norm() <
          100 * step * step);
  }
}

TEST_CASE_TEMPLATE("pseudoranges: what cannot be is refused by name", S, float, double) {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  auto ranges = test::ranges_between<S, 2>({3, 2}, test::four_corners<S>());
  REQUIRE(locate_with_bias(ranges));
  CHECK(locate_with_bias(ranges, {.side = {nan, 0}}).error() == Error::NotFinite);
  auto changed = ranges;
  changed[0].range = nan;
  CHECK(locate_with_bias(changed).error() == Error::NotFinite);
  CHECK(bancroft(changed).error() == Error::NotFinite);
  changed = ranges;
  changed[1].sigma = 0;
  CHECK(locate_with_bias(changed).error() == Error::NonPositiveSigma);
  changed = ranges;
  changed.resize(2);
  CHECK(locate_with_bias(changed).error() == Error::TooFewMeasurements);
  CHECK(bancroft(changed).error() == Error::TooFewMeasurements);
  changed.resize(70, ranges[0]);
  CHECK(locate_with_bias(changed).error() == Error::TooManyMeasurements);
  changed = ranges;
  for (auto& r : changed) r.anchor = ranges[0].anchor;
  CHECK(locate_with_bias(changed).error() == Error::DegenerateGeometry);
}

}  // namespace tests::solve_pseudoranges
