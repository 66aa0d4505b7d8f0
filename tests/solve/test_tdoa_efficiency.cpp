// SPDX-License-Identifier: MIT
#include <algorithm>
#include <string>

#include <doctest/doctest.h>

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/tdoa_chan.hpp"

#include "solve/difference_rooms.hpp"
#include "support/statistics.hpp"

namespace tests::solve_tdoa_efficiency {

using namespace uwbpos;

namespace {

// Mean squared error over the bound on a 9 × 9 grid from wall to wall, at least 0.5 m from every
// anchor, σ = 0.1 m an arrival; Chan alone beside it.
template <int D>
void check_hall(const std::string& name, const std::vector<Vec<double, D>>& anchors,
                const std::vector<double>& heights, int trials, double mean_limit,
                double point_limit) {
  sim::Random random{name};
  std::vector<double> ratios;
  std::vector<double> chan_ratios;
  double nees = 0;
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 9; ++j) {
      for (const double height : heights) {
        Vec<double, D> tag;
        tag[0] = 10 * i / 8.0;
        tag[1] = 8 * j / 8.0;
        if constexpr (D == 3) tag[2] = height;
        if (std::any_of(anchors.begin(), anchors.end(),
                        [&](auto& a) { return (a - tag).norm() < 0.5; })) {
          continue;
        }
        const auto room = test::differences_between<double, D>(tag, anchors);
        const auto bound = cramer_rao_bound(room.reference, room.differences, 0.1, tag);
        REQUIRE(bound);
        double squares = 0;
        double chan_squares = 0;
        for (int trial = 0; trial < trials; ++trial) {
          const auto differences = test::noisy<double, D>(random, room, 0.1);
          const auto fix = locate(room.reference, differences, 0.1);
          const auto chan = tdoa_chan(room.reference, differences, 0.1);
          REQUIRE(fix);
          REQUIRE(chan);
          const Vec<double, D> error = fix->position - tag;
          squares += squared_norm(error);
          chan_squares += (chan->position - tag).squaredNorm();
          nees += dot(error, Ldlt<double, D>{fix->covariance}.solve(error));
        }
        ratios.push_back(squares / trials / bound->trace());
        chan_ratios.push_back(chan_squares / trials / bound->trace());
      }
    }
  }
  const double mean = test::mean(ratios);
  const double worst = *std::max_element(ratios.begin(), ratios.end());
  nees /= static_cast<double>(ratios.size()) * trials;
  MESSAGE(name, ": error over bound ", mean, " on average, ", worst, " at worst over ",
          ratios.size(), " places; NEES ", nees, "; Chan alone ", test::mean(chan_ratios), " and ",
          *std::max_element(chan_ratios.begin(), chan_ratios.end()));
  CHECK(mean <= mean_limit);
  CHECK(worst <= point_limit);
  // As in test_locate_efficiency.cpp: the interval of one place's draws, for the noise's second
  // order would stand out of that of them all.
  CHECK(test::mean_nees_interval(D, static_cast<std::size_t>(trials)).contains(nees));
}

}  // namespace

// 4000 draws a place: a place's ratio scatters by 1.6 %, 3 sigma are 5 %.
TEST_CASE("TDOA reaches the bound from wall to wall: 4 anchors") {
  check_hall<2>("4 anchors", {{0, 0}, {10, 0}, {10, 8}, {0, 8}}, {0}, 4000, 1.03, 1.12);
}

TEST_CASE("TDOA reaches the bound from wall to wall: 6 anchors") {
  check_hall<2>("6 anchors", {{0, 0}, {5, 0}, {10, 0}, {10, 8}, {5, 8}, {0, 8}}, {0}, 4000, 1.03,
                1.12);
}

TEST_CASE("TDOA reaches the bound from wall to wall: 8 anchors in space") {
  // On the pillar between two anchors the second order of the noise is a tenth of the first.
  check_hall<3>("8 anchors in space",
                {{0, 0, 0.3},
                 {10, 0, 0.3},
                 {10, 8, 0.3},
                 {0, 8, 0.3},
                 {0, 0, 3},
                 {10, 0, 3},
                 {10, 8, 3},
                 {0, 8, 3}},
                {0.5, 1, 1.5, 2, 2.5}, 1000, 1.03, 1.2);
}

}  // namespace tests::solve_tdoa_efficiency
