// SPDX-License-Identifier: MIT
#include <array>
#include <span>

#include <doctest/doctest.h>

#include "uwbpos/solve/locate.hpp"

#include "solve/solver_laws.hpp"

namespace tests::solve_locate {

using namespace uwbpos;

namespace {

const auto solve = [](const auto& ranges) { return locate(ranges); };

}  // namespace

TEST_CASE_TEMPLATE("locate: any contiguous range will do, and the scalar is deduced", S, float,
                   double) {
  const std::array<RangeTo<S, 2>, 3> array{RangeTo<S, 2>{{0, 0}, 5}, {{6, 0}, 5}, {{0, 8}, 5}};
  const Vec<S, 2> expected{3, 4};
  CHECK((locate(array)->position - expected).norm() < S(1e-5));
  const std::vector<RangeTo<S, 2>> vector(array.begin(), array.end());
  CHECK((locate(vector)->position - expected).norm() < S(1e-5));
  CHECK((locate(std::span{vector})->position - expected).norm() < S(1e-5));
  const RangeTo<S, 2> plain[] = {{{0, 0}, 5}, {{6, 0}, 5}, {{0, 8}, 5}};
  CHECK((locate(plain)->position - expected).norm() < S(1e-5));
  static_assert(std::is_same_v<decltype(locate(plain)), Result<Fix<S, 2>>>);
}

TEST_CASE_TEMPLATE("locate: the covariance predicts the errors", S, float, double) {
  test::check_consistency<S, 2>(solve, test::four_corners<S>(), Vec<S, 2>{3, 2}, 0.999);
  test::check_consistency<S, 2>(solve, {{0, 0}, {10, 0}, {4, 8}}, Vec<S, 2>{5, 3}, 0.999);
  const std::vector<Vec<S, 3>> ceiling{{0, 0, 3}, {10, 0, 3}, {10, 8, 3}, {0, 8, 3}, {5, 4, 3}};
  const auto below = [](const auto& ranges) { return locate(ranges, {.side = {0, 0, -1}}); };
  test::check_consistency<S, 3>(below, ceiling, Vec<S, 3>{3, 2, 0.5}, 0.999);
}

TEST_CASE_TEMPLATE("locate: what it cannot solve is refused by name", S, float, double) {
  test::check_refusals<S, 2>(solve);
  test::check_refusals<S, 3>(solve);
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const auto ranges = test::ranges_between<S, 2>({4, 3}, test::four_corners<S>());
  CHECK(locate(ranges, {.side = {nan, 0}}).error() == Error::NotFinite);
  CHECK(locate(ranges, {.prior = Vec<S, 2>{0, nan}}).error() == Error::NotFinite);
  CHECK(locate(std::vector<RangeTo<S, 3>>(2, {{0, 0, 0}, 1})).error() == Error::TooFewMeasurements);
  const std::vector<Vec<S, 3>> line{{0, 1, 2}, {1, 2, 3}, {2, 3, 4}, {4, 5, 6}};
  CHECK(locate(test::ranges_between<S, 3>({3, 1, 1}, line)).error() == Error::DegenerateGeometry);
  using R = RangeTo<S, 2>;
  CHECK(locate(std::array{R{{0, 0}, 1}, R{{10, 0}, 1}}).error() == Error::InconsistentRanges);
}

TEST_CASE_TEMPLATE("locate: anchors in any line in space are refused", S, float, double) {
  sim::Random random{"lines in space"};
  for (int trial = 0; trial < 500; ++trial) {
    const Vec<S, 3> start = test::random_in_cube<S, 3>(random, S(10));
    const Vec<S, 3> direction = test::random_direction<S, 3>(random);
    std::vector<Vec<S, 3>> line;
    const int n = random.integer(3, 8);
    for (int i = 0; i < n; ++i) line.push_back(start + S(random.uniform(-9, 9)) * direction);
    const auto fix = locate(test::ranges_between<S, 3>({3, 1, 1}, line), {.side = {0, 0, 1}});
    REQUIRE_FALSE(fix);
    CHECK(fix.error() == Error::DegenerateGeometry);
  }
}

TEST_CASE_TEMPLATE("locate: two anchors in the plane need a side or a prior", S, float, double) {
  const std::vector<Vec<S, 2>> pair{{0, 0}, {6, 0}};
  const auto ranges = test::ranges_between<S, 2>({2, 3}, pair);
  CHECK(locate(ranges).error() == Error::AmbiguousSolution);
  CHECK((locate(ranges, {.side = {0, 1}})->position - Vec<S, 2>{2, 3}).norm() < S(1e-4));
  CHECK((locate(ranges, {.side = {0, -9}})->position - Vec<S, 2>{2, -3}).norm() < S(1e-4));
  CHECK((locate(ranges, {.prior = Vec<S, 2>{5, 1}})->position - Vec<S, 2>{2, 3}).norm() < S(1e-4));
  CHECK((locate(ranges, {.prior = Vec<S, 2>{0, -1}})->position - Vec<S, 2>{2, -3}).norm() <
        S(1e-4));
  // Neither a side along the row nor a prior on it tells anything.
  CHECK(locate(ranges, {.side = {1, 0}}).error() == Error::AmbiguousSolution);
  CHECK(locate(ranges, {.prior = Vec<S, 2>{1, 0}}).error() == Error::AmbiguousSolution);
  CHECK((locate(ranges, {.side = {0, 1}, .prior = Vec<S, 2>{2, -3}})->position - Vec<S, 2>{2, 3})
            .norm() < S(1e-4));
}

TEST_CASE_TEMPLATE("locate: more anchors in one row are still two images", S, float, double) {
  const std::vector<Vec<S, 2>> row{{1, 1}, {2, 2}, {4, 4}, {9, 9}, {7, 7}};
  const Vec<S, 2> tag{2, 6};
  const auto ranges = test::ranges_between<S, 2>(tag, row);
  CHECK(locate(ranges).error() == Error::AmbiguousSolution);
  CHECK((locate(ranges, {.side = {-1, 1}})->position - tag).norm() < S(1e-4));
  CHECK((locate(ranges, {.side = {1, 0}})->position - Vec<S, 2>{6, 2}).norm() < S(1e-4));
}

TEST_CASE_TEMPLATE("locate: a duplicate range adds weight, not geometry", S, float, double) {
  const std::vector<Vec<S, 2>> twice{{0, 0}, {6, 0}, {6, 0}, {0, 0}};
  const auto two = test::ranges_between<S, 2>({2, 3}, twice);
  CHECK(locate(two).error() == Error::AmbiguousSolution);
  CHECK((locate(two, {.side = {0, 1}})->position - Vec<S, 2>{2, 3}).norm() < S(1e-4));

  auto corners = test::four_corners<S>();
  const auto once = locate(test::ranges_between<S, 2>({2, 3}, corners));
  const auto copy = corners;
  corners.insert(corners.end(), copy.begin(), copy.end());
  const auto doubled = locate(test::ranges_between<S, 2>({2, 3}, corners));
  REQUIRE(once);
  REQUIRE(doubled);
  CHECK((doubled->covariance * S(2) - once->covariance).norm() < S(1e-5));
  CHECK(doubled->degrees_of_freedom == 6);
}

TEST_CASE_TEMPLATE("locate: sixty-four anchors are taken", S, float, double) {
  sim::Random random{"sixty-four"};
  const auto room = test::random_room<S, 3>(random, 64, 64);
  const auto fix = locate(room.ranges);
  REQUIRE(fix);
  CHECK(static_cast<double>((fix->position - room.tag).norm()) < test::exactness<S>());
  CHECK(fix->degrees_of_freedom == 61);
}

TEST_CASE_TEMPLATE("locate: a tag on an anchor is found", S, float, double) {
  for (const Vec<S, 2>& corner : test::four_corners<S>()) {
    const auto fix = locate(test::ranges_between<S, 2>(corner, test::four_corners<S>()));
    REQUIRE(fix);
    // The anchor's own range has no gradient there; the others fix the place.
    CHECK((fix->position - corner).norm() < S(1e-4));
    CHECK(all_finite(fix->covariance));
  }
}

TEST_CASE_TEMPLATE("locate: a tag in the anchors' plane is found, with its height's variance", S,
                   float, double) {
  const std::vector<Vec<S, 3>> ceiling{{0, 0, 3}, {10, 0, 3}, {10, 8, 3}, {0, 8, 3}};
  const auto exact = test::ranges_between<S, 3>({3, 2, 3}, ceiling);
  const auto fix = locate(exact);
  REQUIRE(fix);
  CHECK((fix->position - Vec<S, 3>{3, 2, 3}).norm() < S(0.05));

  // Under noise q = τ² has a standard deviation s, and τ is anything up to about √s: the
  // covariance says so. Without a side the answer is the plane or a refusal, with one it is a fix.
  sim::Random random{"tag in the plane"};
  double sum = 0;
  int found = 0;
  for (int i = 0; i < 2000; ++i) {
    const auto ranges = test::noisy<S, 3>(random, exact);
    const auto below = locate(ranges, {.side = {0, 0, -1}});
    REQUIRE(below);
    CHECK(below->position[2] <= S(3.0001));
    const Vec<S, 3> error = below->position - Vec<S, 3>{3, 2, 3};
    sum += static_cast<double>(dot(error, Ldlt<S, 3>{below->covariance}.solve(error)));
    const auto free = locate(ranges);
    found += free ? 1 : 0;
    if (!free) CHECK(free.error() == Error::AmbiguousSolution);
  }
  CHECK(found > 800);
  CHECK(found < 1200);
  // Two in the plane; the height's normalised square is 4q²/s² where the root is taken for real,
  // two more on average over q ~ N(0, s).
  CHECK(sum / 2000 > 2);
  CHECK(sum / 2000 < 5);
}

TEST_CASE_TEMPLATE("locate: below a ceiling χ² is that of the ranges alone", S, float, double) {
  sim::Random random{"residuals below a ceiling"};
  const std::vector<Vec<S, 3>> ceiling{{0, 0, 3}, {10, 0, 3}, {10, 8, 3}, {0, 8, 3}, {5, 4, 3}};
  for (const double depth : {0.0, 0.05, 0.3, 2.0}) {
    CAPTURE(depth);
    const Vec<S, 3> tag{3, 2, S(3 - depth)};
    for (int trial = 0; trial < 50; ++trial) {
      const auto ranges = test::noisy<S, 3>(random, test::ranges_between<S, 3>(tag, ceiling));
      const auto fix = locate(ranges, {.side = Vec<S, 3>{0, 0, -1}});
      REQUIRE(fix);
      CHECK(fix->chi_squared == chi_squared<S, 3>(as_range_span(ranges), fix->position));
    }
  }
}

TEST_CASE_TEMPLATE("locate: a ceiling a little uneven is no trap", S, float, double) {
  // Heights scattered by 2 cm: the ranges hardly tell the images apart; the side does.
  sim::Random random{"uneven ceiling"};
  for (int trial = 0; trial < 500; ++trial) {
    std::vector<Vec<S, 3>> anchors{{0, 0, 3}, {10, 0, 3}, {10, 8, 3}, {0, 8, 3}, {5, 4, 3}};
    for (auto& a : anchors) a[2] += S(random.normal(0, 0.02));
    const Vec<S, 3> tag{S(random.uniform(1, 9)), S(random.uniform(1, 7)), S(random.uniform(0, 2))};
    const auto exact = test::ranges_between<S, 3>(tag, anchors);
    const auto ranges = test::noisy<S, 3>(random, exact);
    const auto fix = locate(ranges, {.side = {0, 0, -1}});
    REQUIRE(fix);
    const Vec<S, 3> error = fix->position - tag;
    // Never the mirror image: within five sigma of the tag, not metres above.
    CHECK(static_cast<double>(dot(error, Ldlt<S, 3>{fix->covariance}.solve(error))) < 40);
    const auto alone = locate(ranges);
    if (alone) {
      const Vec<S, 3> off = alone->position - tag;
      CHECK(static_cast<double>(dot(off, Ldlt<S, 3>{alone->covariance}.solve(off))) < 40);
    } else {
      CHECK(alone.error() == Error::AmbiguousSolution);
    }
  }
}

TEST_CASE_TEMPLATE("locate: far from the origin it loses only what coordinates lose", S, float,
                   double) {
  // UTM-like offsets: a float of 4e5 has steps of 3 cm.
  sim::Random random{"far from the origin"};
  const Vec<S, 2> shift{S(400000), S(500000)};
  for (int trial = 0; trial < 200; ++trial) {
    const auto room = test::random_room<S, 2>(random, 4, 6);
    auto moved = room.ranges;
    for (auto& r : moved) r.anchor += shift;
    for (auto& r : moved) r.range = test::true_range<S, 2>(room.tag + shift, r.anchor);
    const auto fix = locate(moved);
    REQUIRE(fix);
    CHECK(static_cast<double>((fix->position - (room.tag + shift)).norm()) <
          (sizeof(S) == 4 ? 0.1 : 1e-8));
  }
}

TEST_CASE_TEMPLATE("locate: nonsense is answered by a finite fix or a name", S, float, double) {
  sim::Random random{"nonsense"};
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double specials[] = {0, 0, 1, -1, 1e-10, 1e10,         1e-30, 1e30, 3e38,      -3e38,
                             5, 5, 2, 3,  1e5,   std::nan(""), 1e-3,  0.1,  kInfinity, -kInfinity};
  const auto value = [&] {
    return S(random.chance(0.95) ? random.uniform(-10, 10) : specials[random.integer(0, 19)]);
  };
  int solved = 0;
  int refused = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    std::vector<RangeTo<S, 3>> ranges(static_cast<std::size_t>(random.integer(0, 9)));
    for (auto& r : ranges) {
      r.anchor = {value(), value(), value()};
      r.range = std::abs(value());
      if (random.chance(0.2)) r.sigma = value();
    }
    LocateOptions<S, 3> options;
    if (random.chance(0.3)) options.side = {value(), value(), value()};
    if (random.chance(0.3)) options.prior = Vec<S, 3>{value(), value(), value()};
    const auto fix = locate(ranges, options);
    (fix ? solved : refused)++;
    if (!fix) continue;
    CHECK(all_finite(fix->position));
    CHECK(all_finite(fix->covariance));
    CHECK(std::isfinite(fix->chi_squared));
    for (int k = 0; k < 3; ++k) CHECK(fix->covariance(k, k) > S(0));
  }
  CHECK(solved > 300);
  CHECK(refused > 1000);
}

}  // namespace tests::solve_locate
