// SPDX-License-Identifier: MIT
#include <algorithm>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/solve/locate.hpp"

#include "solve/rooms.hpp"
#include "support/statistics.hpp"

namespace tests::solve_locate_efficiency {

using namespace uwbpos;

namespace {

// Mean squared error over the Cramér-Rao bound on a 9 × 9 grid from wall to wall, at places at
// least 0.5 m from every anchor, with sigma = 0.1 m; and the mean normalised squared error.
template <int D>
void check_hall(const char* name, const std::vector<Vec<double, D>>& anchors,
                const std::vector<double>& heights, int trials, double mean_limit,
                double point_limit) {
  sim::Random random{name};
  std::vector<double> ratios;
  double nees = 0;
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 9; ++j) {
      for (const double height : heights) {
        Vec<double, D> tag;
        tag[0] = 10 * i / 8.0;
        tag[1] = 8 * j / 8.0;
        if constexpr (D == 3) tag[2] = height;
        const auto exact = test::ranges_between<double, D>(tag, anchors);
        if (std::any_of(exact.begin(), exact.end(), [](auto& r) { return r.range < 0.5; }))
          continue;
        const auto bound = cramer_rao_bound(exact, tag);
        REQUIRE(bound);
        double squares = 0;
        for (int trial = 0; trial < trials; ++trial) {
          const auto fix = locate(test::noisy<double, D>(random, exact));
          REQUIRE(fix);
          const Vec<double, D> error = fix->position - tag;
          squares += squared_norm(error);
          nees += dot(error, Ldlt<double, D>{fix->covariance}.solve(error));
        }
        ratios.push_back(squares / trials / bound->trace());
      }
    }
  }
  const double mean = test::mean(ratios);
  const double worst = *std::max_element(ratios.begin(), ratios.end());
  const std::size_t count = ratios.size() * static_cast<std::size_t>(trials);
  nees /= static_cast<double>(count);
  MESSAGE(name, ": error over bound ", mean, " on average, ", worst, " at worst over ",
          ratios.size(), " places; NEES ", nees);
  CHECK(mean <= mean_limit);
  CHECK(worst <= point_limit);
  // The interval that 4000 draws a place would give: with 300,000 in all the noise's second order,
  // half a percent at sigma = 0.1 m, would stand out of the sampling error alone.
  CHECK(test::mean_nees_interval(D, static_cast<std::size_t>(trials)).contains(nees));
}

}  // namespace

// 4000 draws a place: a place's ratio scatters by √(2/(2·4000)) = 1.6 %, 3 sigma are 5 %.
TEST_CASE("locate reaches the bound from wall to wall: 4 anchors") {
  check_hall<2>("4 anchors", {{0, 0}, {10, 0}, {10, 8}, {0, 8}}, {0}, 4000, 1.02, 1.10);
}

TEST_CASE("locate reaches the bound from wall to wall: 6 anchors") {
  check_hall<2>("6 anchors", {{0, 0}, {5, 0}, {10, 0}, {10, 8}, {5, 8}, {0, 8}}, {0}, 4000, 1.02,
                1.10);
}

TEST_CASE("locate reaches the bound from wall to wall: 8 anchors in space") {
  check_hall<3>("8 anchors in space",
                {{0, 0, 0.3},
                 {10, 0, 0.3},
                 {10, 8, 0.3},
                 {0, 8, 0.3},
                 {0, 0, 3},
                 {10, 0, 3},
                 {10, 8, 3},
                 {0, 8, 3}},
                {0.5, 1, 1.5, 2, 2.5}, 2000, 1.02, 1.15);
}

}  // namespace tests::solve_locate_efficiency
