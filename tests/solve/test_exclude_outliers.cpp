// SPDX-License-Identifier: MIT
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/solve/exclude_outliers.hpp"

#include "solve/difference_rooms.hpp"
#include "support/statistics.hpp"

namespace tests::solve_exclude_outliers {

using namespace uwbpos;

TEST_CASE_TEMPLATE("exclusion: an outlier among eight ranges is found and left out", S, float,
                   double) {
  sim::Random random{"one liar"};
  int caught = 0;
  double squares = 0;
  double spoiled = 0;
  constexpr int kTrials = 500;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto room = test::random_room<S, 2>(random, 8, 8, false, 2);
    auto ranges = test::noisy<S, 2>(random, room.ranges);
    const int liar = random.integer(0, 7);
    ranges[static_cast<std::size_t>(liar)].range += S(random.uniform(1.5, 5));
    const auto kept = locate_excluding(ranges);
    REQUIRE(kept);
    caught += kept->excluded == std::uint64_t{1} << liar ? 1 : 0;
    if (kept->excluded_count > 0) CHECK(kept->fix.degrees_of_freedom == 6 - kept->excluded_count);
    squares += static_cast<double>((kept->fix.position - room.tag).squaredNorm());
    const auto whole = locate(ranges);
    REQUIRE(whole);
    spoiled += static_cast<double>((whole->position - room.tag).squaredNorm());
  }
  // 1.5 m are 15 sigma: only a range that the geometry hardly checks can hide that.
  CHECK(caught > kTrials * 95 / 100);
  CHECK(squares < spoiled / 20);
}

TEST_CASE("exclusion: good measurements are left alone") {
  sim::Random random{"no liar"};
  int suspected = 0;
  constexpr int kTrials = 20000;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto room = test::random_room<double, 2>(random, 8, 8, false, 5);
    const auto kept = locate_excluding(test::noisy<double, 2>(random, room.ranges));
    REQUIRE(kept);
    suspected += kept->excluded_count > 0 ? 1 : 0;
  }
  // z = 3.09 suspects 20 of 20000; the count scatters by √20.
  CHECK(suspected < 45);
  CHECK(suspected > 4);
}

TEST_CASE_TEMPLATE("exclusion: differences of pairs, two liars of twelve", S, float, double) {
  sim::Random random{"two liars"};
  int caught = 0;
  constexpr int kTrials = 200;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<Vec<S, 3>> anchors;
    for (int i = 0; i < 8; ++i) {
      anchors.push_back(
          {(i & 1) != 0 ? S(7) : S(0), (i & 2) != 0 ? S(8) : S(0), (i & 4) != 0 ? S(3) : S(0.2)});
    }
    const Vec<S, 3> tag = test::random_in_box<S, 3>(random, {2, 2, S(0.8)}, {5, 6, S(2.4)});
    std::vector<PairDifference<S, 3>> pairs;
    for (std::size_t i = 0; i < 12; ++i) {
      const auto& a = anchors[i % 8];
      const auto& b = anchors[(i < 8 ? i + 1 : i + 3) % 8];
      pairs.push_back({a, b, test::true_difference<S, 3>(tag, a, b) + S(random.normal(0, 0.15))});
    }
    pairs[2].difference += pairs[2].difference > 0 ? S(-2) : S(2);
    pairs[9].difference += pairs[9].difference > 0 ? S(-2.5) : S(2.5);
    const auto kept = locate_excluding(pairs);
    REQUIRE(kept);
    caught += kept->excluded == ((1u << 2) | (1u << 9)) ? 1 : 0;
    if (kept->consistent && kept->excluded_count == 2) {
      CHECK(static_cast<double>((kept->fix.position - tag).norm()) < 3);
    }
  }
  CHECK(caught > kTrials * 80 / 100);
}

TEST_CASE_TEMPLATE("exclusion: without redundancy it says nothing, with too many liars it says so",
                   S, float, double) {
  const std::vector<Vec<S, 2>> three{{0, 0}, {10, 0}, {3, 8}};
  auto ranges = test::ranges_between<S, 2>({4, 3}, three);
  ranges[1].range += 2;
  const auto kept = locate_excluding(ranges);
  REQUIRE(kept);
  // One degree of freedom: the fault shows, but any one range left out would hide it.
  CHECK(kept->excluded_count == 0);
  CHECK_FALSE(kept->consistent);

  auto many = test::ranges_between<S, 2>({4, 3}, test::four_corners<S>());
  many[0].range += 3;
  const auto none = locate_excluding(many, {}, {.max_excluded = 0});
  REQUIRE(none);
  CHECK_FALSE(none->consistent);
  CHECK(none->excluded == 0);
}

TEST_CASE_TEMPLATE("exclusion: what cannot be is refused by name", S, float, double) {
  auto ranges = test::ranges_between<S, 2>({4, 3}, test::four_corners<S>());
  CHECK(locate_excluding(ranges, {}, {.max_excluded = -1}).error() == Error::InvalidOption);
  const S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(locate_excluding(ranges, {}, {.normal_quantile = nan}).error() == Error::InvalidOption);
  ranges.resize(1);
  CHECK(locate_excluding(ranges).error() == Error::TooFewMeasurements);
  ranges.resize(65, ranges[0]);
  CHECK(locate_excluding(ranges).error() == Error::TooManyMeasurements);
}

}  // namespace tests::solve_exclude_outliers
