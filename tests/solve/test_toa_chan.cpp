// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/solve/toa_chan.hpp"
#include "uwbpos/solve/toa_linear.hpp"

#include "solve/solver_laws.hpp"

namespace tests::solve_toa_chan {

using namespace uwbpos;

namespace {

const auto solve = [](const auto& ranges) { return toa_chan(ranges); };

template <class S, int D>
void check_exactness() {
  sim::Random random{"chan is exact"};
  for (int trial = 0; trial < 2000; ++trial) {
    const auto room = test::random_room<S, D>(random, D + 3, 10);
    const auto fix = toa_chan(room.ranges);
    REQUIRE(fix);
    CHECK(static_cast<double>((fix->position - room.tag).norm()) < 50 * test::exactness<S>());
  }
}

}  // namespace

TEST_CASE_TEMPLATE("Chan: exact ranges give the exact position", S, float, double) {
  check_exactness<S, 2>();
  check_exactness<S, 3>();
}

TEST_CASE_TEMPLATE("Chan: the covariance predicts the errors", S, float, double) {
  test::check_consistency<S, 2>(solve, test::four_corners<S>(), Vec<S, 2>{3, 2}, 0.999);
}

TEST_CASE_TEMPLATE("Chan: on an axis through the centre it is as good as elsewhere", S, float,
                   double) {
  // Where the signed square roots of the patent's stage 2 are singular.
  test::check_consistency<S, 2>(solve, test::four_corners<S>(), Vec<S, 2>{5, 2}, 0.999);
  test::check_consistency<S, 2>(solve, test::four_corners<S>(), Vec<S, 2>{5, 4}, 0.999);
}

TEST_CASE("Chan: stage 2 brings the error to the bound, stage 1 alone does not") {
  // Heights that differ by one metre in ten: the linear system hardly knows z, |s|² = ρ² does.
  sim::Random random{"chan at the bound"};
  const Vec<double, 3> tag{6, 3, 1};
  const std::vector<Vec<double, 3>> anchors{{0, 0, 2},  {5, 0, 3}, {10, 0, 2}, {10, 4, 3},
                                            {10, 8, 2}, {5, 8, 3}, {0, 8, 2},  {0, 4, 3}};
  const auto exact = test::ranges_between<double, 3>(tag, anchors);
  const auto bound = cramer_rao_bound(exact, tag);
  REQUIRE(bound);
  double linear = 0;
  double chan = 0;
  constexpr int kTrials = 20000;
  for (int i = 0; i < kTrials; ++i) {
    const auto ranges = test::noisy<double, 3>(random, exact);
    linear += (toa_linear(ranges)->position - tag).squaredNorm();
    chan += (toa_chan(ranges)->position - tag).squaredNorm();
  }
  MESSAGE("mean squared error over the bound: linear ", linear / kTrials / bound->trace(),
          ", Chan ", chan / kTrials / bound->trace());
  // The mean of 20000 squared errors scatters by 1 %; the noise's second order adds a tenth.
  CHECK(chan / kTrials / bound->trace() < 1.2);
  CHECK(linear / kTrials / bound->trace() > 2);
}

TEST_CASE_TEMPLATE("Chan: what it cannot solve is refused by name", S, float, double) {
  test::check_refusals<S, 2>(solve);
  test::check_refusals<S, 3>(solve);
  sim::Random random{"chan flat"};
  const auto ceiling = test::random_room<S, 3>(random, 6, 6, true);
  CHECK(toa_chan(ceiling.ranges).error() == Error::DegenerateGeometry);
}

}  // namespace tests::solve_toa_chan
