// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/solve/bancroft.hpp"
#include "uwbpos/solve/exclude_outliers.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/pose_from_ranges.hpp"

#include "solve/difference_rooms.hpp"

namespace tests::solve_hard_use {

// What arrives at a solver that should not; the table is docs/hard_use.md.

namespace {

using namespace uwbpos;

template <class F>
bool sound(const F& fix) {
  if (!all_finite(fix.position) || !all_finite(fix.covariance)) return false;
  for (int k = 0; k < fix.covariance.rows(); ++k) {
    if (!(fix.covariance(k, k) > 0)) return false;
  }
  return std::isfinite(fix.chi_squared);
}

// Six anchors around a hall, high and low.
template <class S>
std::vector<Vec<S, 3>> hall() {
  return {{0, 0, 3}, {10, 0, 1}, {10, 8, 3}, {0, 8, 1}, {5, 0, 2}, {5, 8, 0}};
}

template <class S>
constexpr std::array<S, 4> kDenormals{
    std::numeric_limits<S>::denorm_min(), -std::numeric_limits<S>::denorm_min(),
    std::numeric_limits<S>::min() / S(3), -std::numeric_limits<S>::min() / S(5)};

template <class S, int D>
void check_sigmas(const std::vector<Vec<S, D>>& anchors, const Vec<S, D>& tag) {
  const auto unit = locate(test::ranges_between<S, D>(tag, anchors, S(1)));
  REQUIRE(unit);
  for (const double size :
       {1.001e-9, 1e-7, 1e-5, 1e-3, 1e3, 1e6, 1e9, 1e12, 1e15, 1e18, 1e21, 1e30, 1e37, 1e300}) {
    const S sigma =
        static_cast<S>(std::min(size, static_cast<double>(std::numeric_limits<S>::max())));
    CAPTURE(sigma);
    const auto fix = locate(test::ranges_between<S, D>(tag, anchors, sigma));
    if (size <= (sizeof(S) == 4 ? 1e9 : 1e37)) REQUIRE(fix);
    if (!fix) {
      // Weights whose squares are zero leave nothing to solve.
      CHECK((fix.error() == Error::NumericOverflow || fix.error() == Error::DegenerateGeometry));
      continue;
    }
    CHECK(sound(*fix));
    CHECK(static_cast<double>((fix->position - tag).norm()) < 10 * test::exactness<S>());
    for (int k = 0; k < D; ++k) {
      const auto scaled = static_cast<double>(std::sqrt(fix->covariance(k, k)) / sigma);
      const auto plain = static_cast<double>(std::sqrt(unit->covariance(k, k)));
      CHECK(scaled == doctest::Approx(plain).epsilon(1e-2));
    }
  }
}

}  // namespace

TEST_CASE_TEMPLATE("hard use: sigmas from a nanometre up scale the covariance, or have a name", S,
                   float, double) {
  check_sigmas<S, 2>(test::four_corners<S>(), Vec<S, 2>{3, 2});
  check_sigmas<S, 3>(hall<S>(), Vec<S, 3>{3, 2, 1});
}

TEST_CASE_TEMPLATE("hard use: a range of huge sigma weighs nothing, one of tiny sigma is met", S,
                   float, double) {
  const Vec<S, 3> tag{3, 2, 1};
  const auto good = test::ranges_between<S, 3>(tag, hall<S>());
  for (const S sigma : {S(1e3), S(1e6), S(1e9), S(1e15)}) {
    CAPTURE(sigma);
    auto ranges = good;
    ranges.push_back({{0, 4, 2}, S(100), sigma});
    const auto fix = locate(ranges);
    REQUIRE(fix);
    CHECK(sound(*fix));
    // 100 m at a ten-thousandth of the weights' root, squared: 1e-6 m.
    CHECK(static_cast<double>((fix->position - tag).norm()) < 2e-4);
  }
  // A range that contradicts the others by half their sigma, and claims to know better: a narrow,
  // curved valley. A float follows it to a tenth of their sigma, a double to a thousandth.
  const double narrowest = sizeof(S) == 4 ? 1e-2 : 1e-4;
  for (const double sigma : {1e-2, 1e-3, 1e-4, 1e-6, 1.001e-9}) {
    CAPTURE(sigma);
    auto ranges = good;
    ranges[0].range += S(0.05);
    ranges[0].sigma = static_cast<S>(sigma);
    const auto fix = locate(ranges);
    if (sigma >= narrowest) REQUIRE(fix);
    if (!fix) {
      CHECK(fix.error() == Error::NotConverged);
      continue;
    }
    CHECK(sound(*fix));
    CHECK(std::abs(static_cast<double>((fix->position - ranges[0].anchor).norm() -
                                       ranges[0].range)) < 2 * sigma + 1e-4);
    CHECK(static_cast<double>((fix->position - tag).norm()) < 0.2);
  }
}

TEST_CASE_TEMPLATE("hard use: one range of eight too long by 30 to 250 m is found and left out", S,
                   float, double) {
  sim::Random random{"spikes"};
  constexpr int kTrials = 500;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto room = test::random_room<S, 2>(random, 8, 8, false, 2);
    auto ranges = test::noisy<S, 2>(random, room.ranges);
    const int liar = random.integer(0, 7);
    ranges[static_cast<std::size_t>(liar)].range += S(random.uniform(30, 250));
    const auto kept = locate_excluding(ranges);
    REQUIRE(kept);
    CHECK((kept->excluded >> liar & 1) == 1);
    CHECK(kept->excluded_count <= 2);
    // σ = 0.1 m and a dilution of 2 at most, one anchor or two fewer.
    CHECK(static_cast<double>((kept->fix.position - room.tag).norm()) < 1.5);
  }
}

TEST_CASE_TEMPLATE("hard use: denormal ranges and places are zeros to a solver", S, float, double) {
  for (const S tiny : kDenormals<S>) {
    CAPTURE(tiny);
    // A tag on an anchor whose range is a denormal, and anchors a denormal off the axes.
    const Vec<S, 3> tag = hall<S>()[0];
    auto ranges = test::ranges_between<S, 3>(tag, hall<S>());
    ranges[0].range = tiny;
    for (auto& r : ranges) {
      for (int k = 0; k < 3; ++k) {
        if (r.anchor[k] == S(0)) r.anchor[k] = tiny;
      }
    }
    const auto fix = locate(ranges);
    REQUIRE(fix);
    CHECK(sound(*fix));
    CHECK((fix->position - tag).norm() < S(1e-3));

    // Differences that are denormals: the tag is as far from all.
    const auto square = test::four_corners<S>();
    auto middle = test::differences_between<S, 2>({5, 4}, square);
    for (auto& d : middle.differences) d.difference = tiny;
    const auto centre = locate(middle.reference, middle.differences, S(0.1));
    REQUIRE(centre);
    CHECK(sound(*centre));
    CHECK((centre->position - Vec<S, 2>{5, 4}).norm() < S(1e-3));
    std::vector<PairDifference<S, 2>> pairs;
    for (std::size_t i = 0; i < 4; ++i) pairs.push_back({square[i], square[(i + 1) % 4], tiny});
    const auto between = locate(pairs);
    REQUIRE(between);
    CHECK(sound(*between));
    CHECK((between->position - Vec<S, 2>{5, 4}).norm() < S(1e-3));

    // A prior, a side and a bias of denormals.
    const std::vector<Vec<S, 2>> row{{0, 0}, {6, 0}};
    const auto two = test::ranges_between<S, 2>({2, 3}, row);
    CHECK(locate(two, {.prior = Vec<S, 2>{2, tiny}}).error() == Error::AmbiguousSolution);
    auto biased = test::ranges_between<S, 2>({3, 2}, square);
    for (auto& r : biased) r.range += tiny;
    const auto roots = bancroft(biased);
    REQUIRE(roots);
    CHECK((roots->first.position - Vec<S, 2>{3, 2}).norm() < S(1e-3));
    CHECK(std::abs(roots->first.bias) < S(1e-3));
  }
}

TEST_CASE_TEMPLATE("hard use: denormal sigmas, and rooms of denormal size, have a name", S, float,
                   double) {
  for (const S tiny : kDenormals<S>) {
    CAPTURE(tiny);
    auto ranges = test::ranges_between<S, 3>({3, 2, 1}, hall<S>());
    ranges[2].sigma = tiny;
    CHECK(locate(ranges).error() == Error::NonPositiveSigma);
    const auto room = test::differences_between<S, 2>({4, 3}, test::four_corners<S>());
    CHECK(locate(room.reference, room.differences, tiny).error() == Error::NonPositiveSigma);
    CHECK(bancroft(ranges).error() == Error::NonPositiveSigma);

    // All anchors within denormals of one place: no place to be found from.
    auto small = test::ranges_between<S, 3>({3, 2, 1}, hall<S>());
    for (auto& r : small) {
      r.anchor *= tiny;
      r.range = std::abs(tiny);
    }
    const auto fix = locate(small);
    REQUIRE_FALSE(fix);
    CHECK(fix.error() == Error::DegenerateGeometry);

    // A body whose tags are denormals apart has no heading.
    std::vector<TagRange<S, 2>> tags;
    for (const auto& anchor : test::four_corners<S>()) {
      const S range = test::true_range<S, 2>({4, 3}, anchor);
      tags.push_back({{tiny, S(0)}, anchor, range});
      tags.push_back({{S(0), tiny}, anchor, range});
    }
    const auto pose = pose_from_ranges(tags);
    REQUIRE_FALSE(pose);
    CHECK(pose.error() == Error::HeadingUndetermined);
  }
}

TEST_CASE_TEMPLATE(
    "hard use: anchors in a row, by differences, need a side, and in space have a name", S, float,
    double) {
  const std::vector<Vec<S, 2>> row{{0, 0}, {2, 0}, {5, 0}, {9, 0}, {12, 0}};
  const Vec<S, 2> tag{4, 3};
  const auto room = test::differences_between<S, 2>(tag, row);
  CHECK(locate(room.reference, room.differences, S(0.1)).error() == Error::AmbiguousSolution);
  LocateOptions<S, 2> above;
  above.side = {0, 1};
  const auto fix = locate(room.reference, room.differences, S(0.1), above);
  REQUIRE(fix);
  CHECK((fix->position - tag).norm() < S(1e-3));
  const std::vector<Vec<S, 3>> line{{0, 1, 2}, {1, 2, 3}, {2, 3, 4}, {4, 5, 6}, {7, 8, 9}};
  const auto in_space = test::differences_between<S, 3>({3, 1, 1}, line);
  CHECK(locate(in_space.reference, in_space.differences, S(0.1)).error() ==
        Error::DegenerateGeometry);
}

TEST_CASE_TEMPLATE("hard use: a tag on an anchor is found by differences, as reference or not", S,
                   float, double) {
  for (std::size_t at = 0; at < 6; ++at) {
    for (const std::size_t reference : {std::size_t{0}, at}) {
      const auto room = test::differences_between<S, 3>(hall<S>()[at], hall<S>(), reference);
      const auto fix = locate(room.reference, room.differences, S(0.1));
      REQUIRE(fix);
      CHECK(sound(*fix));
      CHECK((fix->position - room.tag).norm() < S(1e-2));
    }
  }
}

}  // namespace tests::solve_hard_use
