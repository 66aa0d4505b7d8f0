// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/sim/blockage.hpp>

#include "../support/random_geometry.hpp"
#include "../support/statistics.hpp"

namespace tests::sim_blockage {

namespace {

using namespace uwbpos::sim;
using uwbpos::Vec;

TEST_CASE("A link that nothing blocks stays clear") {
  Random random{"clear"};
  Link link;
  for (int i = 0; i < 1000; ++i) {
    link = update(link, {}, {i, 0}, random);
    REQUIRE_FALSE(link.blocked);
    REQUIRE(link.excess == 0);
  }
}

TEST_CASE("Independent blockages come as often, and lengthen the path as much, as asked") {
  Random random{"independent"};
  const Blockage blockage{.probability = 0.2, .minimum_excess = 0.1, .mean_excess = 0.5};
  constexpr int kCount = 50000;
  Link link;
  std::vector<double> excesses;
  for (int i = 0; i < kCount; ++i) {
    link = update(link, blockage, {i, 0}, random);
    REQUIRE((link.blocked ? link.excess >= 0.1 : link.excess == 0));
    if (link.blocked) excesses.push_back(link.excess);
  }
  const double share = static_cast<double>(excesses.size()) / kCount;
  CHECK(std::abs(share - 0.2) < 4 * std::sqrt(0.16 / kCount));
  CHECK(uwbpos::test::mean_interval(0.6, 0.5, excesses.size(), 0.999)
            .contains(uwbpos::test::mean(excesses)));
}

TEST_CASE("Lasting blockages keep their share, their duration and their excess") {
  Random random{"lasting"};
  const Blockage blockage{.probability = 0.25, .mean_duration = 4, .mean_excess = 0.5};
  // Observed every 0.1 s for 80 000 s: 5000 blockages.
  constexpr int kCount = 800000;
  Link link;
  double last = 0;
  int blocked = 0;
  int begun = 0;
  int replaced = 0;
  for (int i = 0; i < kCount; ++i) {
    link = update(link, blockage, Instant{i / 10, (i % 10) / 10.0}, random);
    REQUIRE((link.blocked ? link.excess > 0 : link.excess == 0));
    blocked += link.blocked ? 1 : 0;
    begun += link.excess != 0 && link.excess != last ? 1 : 0;
    replaced += link.excess != 0 && last != 0 && link.excess != last ? 1 : 0;
    last = link.excess;
  }
  // The share's standard error: a cycle of 16 s holds 4 ± 4 s blocked, 5000 cycles, relative
  // √2 · 0.75 / √5000 = 1.5 %; four of them.
  CHECK(std::abs(blocked / (0.25 * kCount) - 1) < 0.06);
  // Blockages last 4 s on average; those shorter than the 0.1 s between looks are missed, 1.2 %
  // on average, and counting 5000 has a standard error of 1.4 % beside the share's.
  const double mean_duration = 0.1 * blocked / begun;
  CHECK(std::abs(mean_duration / 4 - 1) < 0.08);
  // A blockage is followed by a clear spell of 12 s on average; one shorter than a look's 0.1 s
  // hides between two blockages in 0.8 % of all cases, 42 ± 6 of 5000.
  CHECK(replaced < 70);
}

TEST_CASE("A long look away forgets the blockage that was there") {
  Random random{"forgetting"};
  const Blockage blockage{.probability = 0.5, .mean_duration = 1, .mean_excess = 0.5};
  Link link;
  double last = 0;
  int repeated = 0;
  int blocked = 0;
  for (int i = 0; i < 2000; ++i) {
    link = update(link, blockage, {100L * i, 0}, random);
    repeated += link.blocked && link.excess == last ? 1 : 0;
    blocked += link.blocked ? 1 : 0;
    last = link.excess;
  }
  CHECK(repeated == 0);
  CHECK(std::abs(blocked / 2000.0 - 0.5) < 4 * std::sqrt(0.25 / 2000));
}

TEST_CASE("A link that is always blocked is, with changing excess") {
  Random random{"always blocked"};
  const Blockage blockage{.probability = 1, .mean_duration = 5, .mean_excess = 0.5};
  Link link;
  int changes = 0;
  double last = 0;
  for (int i = 0; i < 1000; ++i) {
    link = update(link, blockage, {i, 0}, random);
    REQUIRE(link.blocked);
    REQUIRE(link.excess > 0);
    changes += link.excess != last ? 1 : 0;
    last = link.excess;
  }
  // A change at a second with probability 1 − e^(−1/5) = 0.181.
  CHECK(std::abs(changes / 1000.0 - 0.181) < 4 * std::sqrt(0.148 / 1000));
}

TEST_CASE("Walls lengthen the paths that cross them and no others") {
  const Vec<double, 3> left{-1, 0.5, 2};
  const Vec<double, 3> right{1, 0.5, 7};
  const Vec<double, 3> beyond{1, 5, 0};
  const Wall wall{{0, 0}, {0, 1}, 0.4};
  CHECK(crosses(wall, left, right));
  CHECK(crosses(wall, right, left));
  CHECK_FALSE(crosses(wall, left, beyond));
  CHECK_FALSE(crosses(wall, right, beyond));
  CHECK_FALSE(crosses(wall, left, left));
  const std::array<Wall, 3> walls{wall, Wall{{0.5, 0}, {0.5, 1}, 0.3}, Wall{{0, 2}, {0, 3}, 9}};
  CHECK(wall_excess(walls, left, right) == doctest::Approx(0.7));
  CHECK(wall_excess(walls, right, left) == doctest::Approx(0.7));
  CHECK(wall_excess(walls, left, {0.2, 0.5, 0}) == doctest::Approx(0.4));
  CHECK(wall_excess({}, left, right) == 0);
}

TEST_CASE("A path through the joint of two walls crosses one of them") {
  const std::array<Wall, 2> straight{Wall{{0, -1}, {0, 0}, 1}, Wall{{0, 0}, {0, 1}, 1}};
  CHECK(wall_excess(straight, {-1, 0, 0}, {1, 0, 0}) == 1);
  CHECK(wall_excess(straight, {1, 0, 0}, {-1, 0, 0}) == 1);
}

TEST_CASE("Turning and shifting the plan does not change which walls are crossed") {
  Random random{"walls"};
  int crossings = 0;
  for (int i = 0; i < 3000; ++i) {
    const Vec<double, 2> a = uwbpos::test::random_in_cube<double, 2>(random, 5);
    const Vec<double, 2> b = uwbpos::test::random_in_cube<double, 2>(random, 5);
    const Vec<double, 2> p = uwbpos::test::random_in_cube<double, 2>(random, 5);
    const Vec<double, 2> q = uwbpos::test::random_in_cube<double, 2>(random, 5);
    const auto rotation = uwbpos::test::random_rotation<double, 2>(random);
    const Vec<double, 2> shift = uwbpos::test::random_in_cube<double, 2>(random, 50);
    const auto move = [&](const Vec<double, 2>& x) -> Vec<double, 2> {
      return rotation * x + shift;
    };
    const auto raise = [&](const Vec<double, 2>& x) {
      return Vec<double, 3>{x(0), x(1), random.uniform(0, 3)};
    };
    const bool before = crosses({a, b}, raise(p), raise(q));
    const bool after = crosses({move(a), move(b)}, raise(move(p)), raise(move(q)));
    CHECK(before == after);
    crossings += before ? 1 : 0;
  }
  // Neither never nor always: random segments in a square cross with probability 0.23.
  CHECK(crossings > 500);
  CHECK(crossings < 900);
}

}  // namespace

}  // namespace tests::sim_blockage
