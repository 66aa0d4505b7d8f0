// SPDX-License-Identifier: MIT
// What the clear cases call clear: the minimum of χ² that a descent finds, and no other minimum
// anywhere that could be meant.
#include <algorithm>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/solve/locate.hpp"

#include "solve/difference_rooms.hpp"

namespace tests::solve_direct {

using namespace uwbpos;

namespace {

/// Squared distance in standard deviations.
template <class S, int D>
double departure(const Vec<S, D>& a, const Vec<S, D>& b, const Mat<S, D>& covariance) {
  const Vec<double, D> off = (a - b).template cast<double>();
  return off.dot(Ldlt<double, D>{covariance.template cast<double>()}.solve(off));
}

constexpr double kSigmas[] = {0.01, 0.1, 0.3};

template <class S, int D>
void check_ranges_minimum() {
  sim::Random random{"clear ranges"};
  int clear = 0;
  int sure = 0;
  constexpr int kTrials = 1500;
  for (int trial = 0; trial < kTrials; ++trial) {
    auto room = test::random_room<S, D>(random, D + 1, 12);
    for (auto& r : room.ranges) r.sigma = S(kSigmas[trial % 3]);
    const auto ranges = test::noisy<S, D>(random, room.ranges);
    const RangeSpan<S, D> span{ranges};
    if (check_ranges<S, D>(span, D)) continue;
    const auto direct = direct_ranges<S, D, S>(span);
    if (!direct.clear) continue;
    ++clear;
    const auto fix = direct_fix<S, D>(span.front().anchor, direct.from_first, direct.covariance,
                                      direct.chi_squared, static_cast<int>(span.size()) - D);
    LeastSquaresOptions<S, D> options;
    options.initial = fix.position;
    const auto descent = toa_least_squares(ranges, options);
    REQUIRE(descent);
    // A hundredth of a standard deviation, squared; in float what rounding of ranges does, too.
    const double rounding = sizeof(S) == 4 ? 1e-5 / kSigmas[trial % 3] : 0;
    CHECK(departure<S, D>(fix.position, descent->position, fix.covariance) <
          1e-4 + 20 * rounding * rounding);
    CHECK(std::abs(fix.covariance.trace() / descent->covariance.trace() - S(1)) < S(0.05));
    CHECK(double(fix.chi_squared) ==
          doctest::Approx(double(descent->chi_squared)).epsilon(1e-3).scale(1));
    if (!is_without_doubt(direct.chi_squared, direct.other, fix.degrees_of_freedom)) continue;
    ++sure;
    for (int start = 0; start < 8; ++start) {
      options.initial = test::random_in_box<S, D>(random, test::room_corner<S, D>(-20, -20, -20),
                                                  test::room_corner<S, D>(40, 35, 26));
      const auto other = toa_least_squares(ranges, options);
      if (!other || (other->position - fix.position).norm() < S(1e-2)) continue;
      CHECK(other->chi_squared - fix.chi_squared > S(25));
    }
  }
  MESSAGE("clear " << clear << ", without doubt " << sure << " of " << kTrials);
  CHECK(clear > kTrials / 2);
  CHECK(sure > kTrials / 3);
}

template <class S, int D>
void check_differences_minimum() {
  sim::Random random{"clear differences"};
  int clear = 0;
  int sure = 0;
  constexpr int kTrials = 1500;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto [tag, anchors] = test::random_difference_room<S, D>(random, D + 2, 12);
    auto room = test::differences_between<S, D>(tag, anchors);
    const S sigma = S(kSigmas[trial % 3]);
    const S shared = S(random.normal()) * sigma;
    for (auto& d : room.differences) d.difference += S(random.normal()) * sigma - shared;
    const DifferenceView<S, D> view{room.reference, room.differences, sigma};
    if (check_differences<S, D>(room.reference, view.differences, sigma, D)) continue;
    const auto direct = direct_pseudoranges<S, D, S>(view);
    if (!direct.clear) continue;
    ++clear;
    const Fix<S, D> fix = position_of<S, D>(direct, view);
    // The descent from where it is, and from anywhere.
    const auto descend_from = [&](const Vec<S, D>& place) {
      const Vec<S, D> center = room.reference;
      const auto evaluate = [&](const Vec<S, D>& position, Curvature curvature) {
        return pseudorange_profile<S, D>(
                   view, center, S(0), position, curvature,
                   pseudorange_profile<S, D>(view, center, S(0), position, curvature, S(0)).bias)
            .normal;
      };
      return minimise<S, D>(evaluate, Vec<S, D>{place - center},
                            std::numeric_limits<S>::epsilon() * S(100), 100);
    };
    const auto descent = descend_from(fix.position);
    REQUIRE(descent);
    const Vec<S, D> found = room.reference + descent->state;
    const double rounding = sizeof(S) == 4 ? 1e-5 / kSigmas[trial % 3] : 0;
    CHECK(departure<S, D>(fix.position, found, fix.covariance) < 1e-4 + 100 * rounding * rounding);
    CHECK(double(fix.chi_squared) ==
          doctest::Approx(double(descent->chi_squared)).epsilon(1e-3).scale(1));
    if (!is_answer<S, D>(direct, view)) continue;
    ++sure;
    for (int start = 0; start < 8; ++start) {
      const auto other = descend_from(test::random_in_box<S, D>(
          random, test::room_corner<S, D>(-20, -20, -20), test::room_corner<S, D>(40, 35, 26)));
      if (!other) continue;
      const Vec<S, D> there = room.reference + other->state;
      // Ten rooms away χ² is flat, and has minima that the image does not tell of: four differences
      // of 0.3 m had one 165 m away whose χ² was 7.8 higher.
      if ((there - fix.position).norm() < S(1e-2) || there.norm() > S(100)) continue;
      // Beyond the image there may be minima that are no roots of the squares; none is near.
      CHECK(other->chi_squared - fix.chi_squared > S(9));
    }
  }
  MESSAGE("clear " << clear << ", the answer " << sure << " of " << kTrials);
  CHECK(clear > kTrials / 3);
  CHECK(sure > kTrials / 4);
}

template <class S, int D>
void check_malformed() {
  sim::Random random{"malformed"};
  constexpr S kNan = std::numeric_limits<S>::quiet_NaN();
  constexpr S kInf = std::numeric_limits<S>::infinity();
  const auto anchors = [&] {
    std::vector<Vec<S, D>> all;
    for (int i = 0; i < 1 << D; ++i) {
      all.push_back(test::room_corner<S, D>(i & 1 ? 10 : 0, i & 2 ? 8 : 0, i & 4 ? 5 : 0));
    }
    return all;
  }();
  const auto good = test::ranges_between<S, D>(test::room_corner<S, D>(3, 4, 1), anchors);
  REQUIRE(direct_ranges<S, D, S>(RangeSpan<S, D>{good}).clear);
  const auto refused = [&](auto spoil) {
    for (std::size_t i = 0; i < good.size(); ++i) {
      auto bad = good;
      spoil(bad[i]);
      const RangeSpan<S, D> span{bad};
      if (direct_ranges<S, D, S>(span).clear) return false;
      if (range_squares<S, D, S>(span, first_anchor<S, D>(span)).sole) return false;
      if (direct_pseudoranges<S, D, S>(span).clear) return false;
    }
    return true;
  };
  for (const S bad : {kNan, kInf, -kInf}) {
    CHECK(refused([&](auto& r) { r.range = bad; }));
    CHECK(refused([&](auto& r) { r.sigma = bad; }));
    CHECK(refused([&](auto& r) { r.anchor[D - 1] = bad; }));
  }
  for (const S sigma : {S(0), S(-0.1), S(1e-10), std::numeric_limits<S>::max()}) {
    CHECK(refused([&](auto& r) { r.sigma = sigma; }));
  }
  auto negative = good;
  negative[1].range = S(-0.31);
  CHECK_FALSE(direct_ranges<S, D, S>(RangeSpan<S, D>{negative}).clear);
  // As few as there are unknowns, far from the first, which alone is elsewhere; of a batch's lanes
  // the first may be missing.
  for (int trial = 0; trial < 1000; ++trial) {
    std::vector<RangeTo<S, D>> few{{test::random_in_cube<S, D>(random, S(20)), S(1), S(0.1)}};
    const auto tag = test::random_in_cube<S, D>(random, S(10));
    for (int i = 0; i < D; ++i) {
      const auto anchor = test::random_in_cube<S, D>(random, S(10));
      few.push_back({anchor, test::true_range<S, D>(tag, anchor), S(0.1)});
    }
    CHECK_FALSE(range_squares<S, D, S>(RangeSpan<S, D>{few}.subspan(1),
                                       first_anchor<S, D>(RangeSpan<S, D>{few}))
                    .started);
  }
  // Flat anchors, one anchor many times, and nothing but noise.
  auto flat = good;
  for (auto& r : flat) r.anchor[D - 1] = S(2);
  CHECK_FALSE(direct_ranges<S, D, S>(RangeSpan<S, D>{flat}).clear);
  for (auto& r : flat) r.anchor = good[0].anchor;
  CHECK_FALSE(direct_ranges<S, D, S>(RangeSpan<S, D>{flat}).clear);
  CHECK_FALSE(direct_pseudoranges<S, D, S>(RangeSpan<S, D>{flat}).clear);
}

}  // namespace

TEST_CASE_TEMPLATE("clear ranges: the minimum, and no other is near", S, float, double) {
  check_ranges_minimum<S, 2>();
  check_ranges_minimum<S, 3>();
}

TEST_CASE_TEMPLATE("clear differences: the minimum, and no other is near", S, float, double) {
  check_differences_minimum<S, 2>();
  check_differences_minimum<S, 3>();
}

TEST_CASE_TEMPLATE("what is not well formed is not clear", S, float, double) {
  check_malformed<S, 2>();
  check_malformed<S, 3>();
}

}  // namespace tests::solve_direct
