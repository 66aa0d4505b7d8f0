// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/geometry/height.hpp>
#include <uwbpos/ranging/ds_twr.hpp>
#include <uwbpos/sim/scenario.hpp>
#include <uwbpos/solve/locate.hpp>

#include "../support/nees.hpp"
#include "../support/statistics.hpp"

namespace tests::sim_positions {

// From simulated clocks to positions: what a user's program does, held to the truth.

namespace {

using namespace uwbpos::sim;
using uwbpos::RangeTo;
using uwbpos::Vec;

Scenario standing(const Hall& hall, int anchors, std::uint64_t seed) {
  Random random{"standing"};
  Scenario scenario;
  scenario.anchors = *hang_anchors(hall, anchors, Placement::Perimeter);
  scenario.path = *random_stops({1, 1, 0.5}, {hall.width - 1, hall.depth - 1, 0.5}, 100, random);
  scenario.epoch_rate = 1;
  scenario.seed = seed;
  return scenario;
}

// The mean normalised squared error of positions of all epochs of some runs; `range_to` turns
// a shot's measured slant range into one to solve with.
template <int D, class S, class RangeOf>
std::vector<double> normalised_errors(const Hall& hall, int anchors, RangeOf&& range_of) {
  std::vector<double> nees;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    auto run = Simulation::start(standing(hall, anchors, seed));
    REQUIRE(run);
    std::vector<RangeTo<S, D>> ranges;
    while (const auto shot = run->next()) {
      const auto slant = uwbpos::ds_twr_range<S>(*ds_stamps(shot->exchange));
      REQUIRE(slant);
      ranges.push_back(range_of(*shot, *slant));
      if (static_cast<int>(ranges.size()) < anchors) continue;
      const auto fix = uwbpos::locate(ranges);
      REQUIRE(fix);
      nees.push_back(uwbpos::test::normalised_squared_error<S, D>(fix->position, fix->covariance,
                                                                  shot->tag.template head<D>()));
      ranges.clear();
    }
  }
  REQUIRE(nees.size() == 1000);
  return nees;
}

// What the ranging options do not know of: rounding to ticks, 9 % of the variance of 0.15 ns.
constexpr double kRounding = 1.091;

TEST_CASE_TEMPLATE("Positions in space scatter as their covariances say, from the clocks up", S,
                   float, double) {
  const Hall hall{.width = 12, .depth = 9, .height = 3.5, .second_height = 0.3};
  const auto nees = normalised_errors<3, S>(hall, 8, [](const Shot& shot, auto slant) {
    return RangeTo<S, 3>{shot.anchor.cast<S>(), slant.value, std::sqrt(slant.variance)};
  });
  const auto interval = uwbpos::test::mean_nees_interval(3, nees.size(), 0.999);
  const double mean = uwbpos::test::mean(nees) / kRounding;
  CAPTURE(mean);
  CHECK(interval.contains(mean));
}

TEST_CASE_TEMPLATE("Positions on the floor scatter as their covariances say, from the clocks up", S,
                   float, double) {
  const Hall hall{.width = 12, .depth = 9, .height = 3};
  const auto nees = normalised_errors<2, S>(hall, 6, [](const Shot& shot, auto slant) {
    const auto flat = uwbpos::horizontal_range<S>(slant, S(3), S(0.5));
    REQUIRE(flat);
    const Vec<double, 2> plan = shot.anchor.head<2>();
    return RangeTo<S, 2>{plan.cast<S>(), flat->value, std::sqrt(flat->variance)};
  });
  const auto interval = uwbpos::test::mean_nees_interval(2, nees.size(), 0.999);
  const double mean = uwbpos::test::mean(nees) / kRounding;
  CAPTURE(mean);
  CHECK(interval.contains(mean));
}

}  // namespace

}  // namespace tests::sim_positions
