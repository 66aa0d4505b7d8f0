// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/geometry/height.hpp>
#include <uwbpos/sim/noise.hpp>

#include "../support/statistics.hpp"

namespace tests::geometry_height {

namespace {

using uwbpos::Error;
using uwbpos::horizontal_range;
using uwbpos::Measured;

TEST_CASE_TEMPLATE("A slant range over a known height gives the horizontal range", S, float,
                   double) {
  // 3-4-5: every step but the last multiplication may round once, so 4 ulp.
  const auto ground = horizontal_range(Measured<S>{S(5), S(0.01)}, S(3.5), S(0.5));
  REQUIRE(ground);
  CHECK(std::abs(ground->value - S(4)) <= 4 * 4 * std::numeric_limits<S>::epsilon());
  CHECK(std::abs(ground->variance - S(0.015625)) <= S(0.1) * std::numeric_limits<S>::epsilon());
}

TEST_CASE_TEMPLATE("Only the height difference counts, not its sign or origin", S, float, double) {
  const Measured<S> slant{S(7.25), S(0.04)};
  const auto below = horizontal_range(slant, S(4), S(1.5));
  const auto above = horizontal_range(slant, S(1.5), S(4));
  const auto lifted = horizontal_range(slant, S(132), S(129.5));
  REQUIRE((below && above && lifted));
  CHECK(below->value == above->value);
  CHECK(below->value == lifted->value);
  CHECK(below->variance == above->variance);
  CHECK(below->variance == lifted->variance);
}

TEST_CASE_TEMPLATE("At equal heights a range comes back unchanged", S, float, double) {
  uwbpos::sim::Random random{"equal heights"};
  for (int i = 0; i < 1000; ++i) {
    const Measured<S> slant{static_cast<S>(random.uniform(0.5, 500)), S(0.01)};
    const auto ground = horizontal_range(slant, S(2), S(2));
    REQUIRE(ground);
    CHECK(ground->value == slant.value);
    CHECK(ground->variance == slant.variance);
  }
}

TEST_CASE_TEMPLATE("Pythagoras holds to rounding from under the anchor to far away", S, float,
                   double) {
  uwbpos::sim::Random random{"pythagoras"};
  for (int i = 0; i < 10000; ++i) {
    // h and D_t are exact in S; the reference works in long double on the same values.
    const S h = static_cast<S>(random.uniform(0.01, 10));
    const S slant = h * (1 + static_cast<S>(random.exponential(1)));
    const auto ground = horizontal_range(Measured<S>{slant, S(0)}, h, S(0));
    REQUIRE(ground);
    const auto exact_slant = static_cast<long double>(slant);
    const auto exact_h = static_cast<long double>(h);
    const long double wanted = std::sqrt((exact_slant - exact_h) * (exact_slant + exact_h));
    // Six roundings of half an ulp, those under the root halved.
    const long double ulp = wanted * static_cast<long double>(std::numeric_limits<S>::epsilon());
    CHECK(std::abs(static_cast<long double>(ground->value) - wanted) <= 3 * ulp);
  }
}

TEST_CASE_TEMPLATE("The variance predicts the spread away from the anchor's foot", S, float,
                   double) {
  uwbpos::sim::Random random{"height spread"};
  constexpr int kCount = 20000;
  for (const double horizontal : {1.5, 3.0, 10.0, 40.0}) {
    CAPTURE(horizontal);
    const double slant = std::hypot(horizontal, 2.2);
    std::vector<double> normalised;
    for (int i = 0; i < kCount; ++i) {
      const S measured = static_cast<S>(random.normal(slant, 0.03));
      const auto ground = horizontal_range(Measured<S>{measured, S(0.0009)}, S(3.2), S(1));
      REQUIRE(ground);
      normalised.push_back((static_cast<double>(ground->value) - horizontal) /
                           std::sqrt(static_cast<double>(ground->variance)));
    }
    // First order: beyond sampling noise allow the next term, (s / 2D²)² with s = 2 D_t σ.
    const double second_order = std::pow(slant * 0.03 / (horizontal * horizontal), 2);
    const auto interval = uwbpos::test::variance_ratio_interval(kCount, 0.999);
    const double ratio = uwbpos::test::variance(normalised);
    CHECK(ratio > interval.low - 4 * second_order);
    CHECK(ratio < interval.high + 4 * second_order);
  }
}

TEST_CASE_TEMPLATE("The variance stays honest right under the anchor", S, float, double) {
  // Tags equally likely anywhere on the floor around the foot of an anchor: the squared errors
  // of all answers of about one horizontal range are compared with the variances given. The
  // bound of the header: not more than 12 % too small, not more than 3.3 times too large.
  uwbpos::sim::Random random{"under the anchor"};
  constexpr double kHeight = 2.2;
  constexpr double kSigma = 0.1;
  constexpr int kBins = 15;
  std::vector<double> squared_error(kBins);
  std::vector<double> predicted(kBins);
  std::vector<int> count(kBins);
  for (int i = 0; i < 400000; ++i) {
    const double horizontal = std::sqrt(random.uniform(0, 4));
    const double slant = random.normal(std::hypot(horizontal, kHeight), kSigma);
    const auto ground = horizontal_range(
        Measured<S>{static_cast<S>(slant), static_cast<S>(kSigma * kSigma)}, S(kHeight), S(0));
    if (!ground) {
      CHECK(ground.error() == Error::HeightExceedsRange);
      continue;
    }
    const double value = static_cast<double>(ground->value);
    // Up to 1.5 m: beyond, the edge of the disc of tags at 2 m would show.
    const auto bin = static_cast<std::size_t>(value * 10);
    if (bin >= static_cast<std::size_t>(kBins)) continue;
    squared_error[bin] += (value - horizontal) * (value - horizontal);
    predicted[bin] += static_cast<double>(ground->variance);
    ++count[bin];
  }
  for (std::size_t bin = 0; bin < static_cast<std::size_t>(kBins); ++bin) {
    CAPTURE(bin);
    REQUIRE(count[bin] > 300);
    const double ratio = squared_error[bin] / predicted[bin];
    // Five standard deviations of a mean of squared normals on top of the header's bound.
    const double sampling = 5 * std::sqrt(2.0 / count[bin]);
    CHECK(ratio < 1.12 * (1 + sampling));
    CHECK(ratio > (1 - sampling) / 3.3);
  }
}

TEST_CASE_TEMPLATE("At the foot itself the range is zero and its variance finite", S, float,
                   double) {
  const auto foot = horizontal_range(Measured<S>{S(2), S(0.01)}, S(3), S(1));
  REQUIRE(foot);
  CHECK(foot->value == 0);
  // √(2/π)·0.1·(4 + √2·0.1) = 0.33045 m²: the tag is within half a metre, no better.
  CHECK(static_cast<double>(foot->variance) == doctest::Approx(0.33045).epsilon(1e-4));

  const auto exact = horizontal_range(Measured<S>{S(2), S(0)}, S(3), S(1));
  REQUIRE(exact);
  CHECK(exact->value == 0);
  CHECK(exact->variance == 0);

  const auto on_anchor = horizontal_range(Measured<S>{S(0), S(0.01)}, S(1), S(1));
  REQUIRE(on_anchor);
  CHECK(on_anchor->value == 0);
  CHECK(on_anchor->variance > 0);
}

// Up to 0.35 m the bound rules, 0.8 · 0.1 · (2 D_t + 0.14) ≤ 0.34 m²; past it, first order falls.
TEST_CASE_TEMPLATE("The variance is bounded near the foot and falls with distance from it", S,
                   float, double) {
  S last = std::numeric_limits<S>::infinity();
  for (int i = 0; i <= 200; ++i) {
    const S horizontal = S(i) / 50;
    const S slant = std::sqrt(horizontal * horizontal + S(4));
    const auto ground = horizontal_range(Measured<S>{slant, S(0.01)}, S(2), S(0));
    REQUIRE(ground);
    if (ground->value > S(0.4)) {
      CHECK(ground->variance <= last);
      last = ground->variance;
    } else {
      CHECK(ground->variance <= S(0.34));
    }
  }
}

TEST_CASE_TEMPLATE("Every wrong input of the height projection is refused by name", S, float,
                   double) {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const S inf = std::numeric_limits<S>::infinity();
  const S huge = std::numeric_limits<S>::max();
  const auto error = [](S value, S variance, S anchor, S tag) {
    const auto result = horizontal_range(Measured<S>{value, variance}, anchor, tag);
    REQUIRE_FALSE(result);
    return result.error();
  };
  for (const S bad : {nan, inf, -inf}) {
    CHECK(error(bad, S(1), S(3), S(1)) == Error::NotFinite);
    CHECK(error(S(5), bad, S(3), S(1)) == Error::NotFinite);
    CHECK(error(S(5), S(1), bad, S(1)) == Error::NotFinite);
    CHECK(error(S(5), S(1), S(3), bad) == Error::NotFinite);
  }
  CHECK(error(S(5), S(1), huge, -huge) == Error::NotFinite);
  CHECK(error(S(5), huge, S(3), S(1)) == Error::NotFinite);
  CHECK(error(huge, S(1), huge, S(0)) == Error::NotFinite);
  CHECK(error(S(-0.01), S(1), S(1), S(1)) == Error::NegativeRange);
  CHECK(error(S(5), S(-0.01), S(3), S(1)) == Error::NonPositiveSigma);
  CHECK(error(S(1.99), S(1), S(3), S(1)) == Error::HeightExceedsRange);
  CHECK(error(S(1.99), S(0.01), S(1), S(3)) == Error::HeightExceedsRange);
}

TEST_CASE_TEMPLATE("Huge and tiny ranges do not overflow on the way", S, float, double) {
  const S huge = std::numeric_limits<S>::max() / 2;
  const auto far = horizontal_range(Measured<S>{huge, S(0.01)}, S(3), S(1));
  REQUIRE(far);
  CHECK(far->value == huge);
  CHECK(far->variance == S(0.01));

  const S tiny = std::numeric_limits<S>::min();
  const auto near = horizontal_range(Measured<S>{5 * tiny, S(0)}, 3 * tiny, S(0));
  REQUIRE(near);
  CHECK(std::abs(near->value - 4 * tiny) <= 32 * tiny * std::numeric_limits<S>::epsilon());
}

}  // namespace

}  // namespace tests::geometry_height
