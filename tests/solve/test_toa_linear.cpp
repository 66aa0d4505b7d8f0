// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include "uwbpos/solve/toa_linear.hpp"

#include "solve/solver_laws.hpp"

namespace tests::solve_toa_linear {

using namespace uwbpos;

namespace {

const auto solve = [](const auto& ranges) { return toa_linear(ranges); };

template <class S, int D>
void check_exactness() {
  sim::Random random{"linear is exact"};
  for (int trial = 0; trial < 2000; ++trial) {
    // Near-flat arrays leave the linear solution many times worse than GDOP says: two spare
    // anchors.
    const auto room = test::random_room<S, D>(random, D + 3, 10);
    const auto fix = toa_linear(room.ranges);
    REQUIRE(fix);
    CHECK(static_cast<double>((fix->position - room.tag).norm()) < 50 * test::exactness<S>());
    CHECK(fix->degrees_of_freedom == static_cast<int>(room.ranges.size()) - D);
  }
}

}  // namespace

TEST_CASE_TEMPLATE("linear: exact ranges give the exact position", S, float, double) {
  check_exactness<S, 2>();
  check_exactness<S, 3>();
}

TEST_CASE_TEMPLATE("linear: the covariance predicts the errors", S, float, double) {
  // Off the centre, where the squares' own noise (second order) is within 1 % of the first.
  sim::Random random{"linear consistency"};
  const Vec<S, 2> tag{3, 2};
  const auto exact = test::ranges_between<S, 2>(tag, test::four_corners<S>());
  double sum = 0;
  constexpr int kTrials = 4000;
  for (int i = 0; i < kTrials; ++i) {
    const auto fix = toa_linear(test::noisy<S, 2>(random, exact));
    REQUIRE(fix);
    const Vec<S, 2> error = fix->position - tag;
    sum += static_cast<double>(dot(error, Ldlt<S, 2>{fix->covariance}.solve(error)));
  }
  CHECK(test::mean_nees_interval(2, kTrials, 0.999).contains(sum / kTrials));
}

TEST_CASE_TEMPLATE("linear: what it cannot solve is refused by name", S, float, double) {
  test::check_refusals<S, 2>(solve);
  test::check_refusals<S, 3>(solve);
  // A ceiling does not span the space, a row not the plane.
  sim::Random random{"linear flat"};
  const auto ceiling = test::random_room<S, 3>(random, 6, 6, true);
  CHECK(toa_linear(ceiling.ranges).error() == Error::DegenerateGeometry);
  const std::vector<Vec<S, 2>> row{{0, 0}, {1, 1}, {2, 2}, {3, 3}};
  CHECK(toa_linear(test::ranges_between<S, 2>({2, 5}, row)).error() == Error::DegenerateGeometry);
}

}  // namespace tests::solve_toa_linear
