// SPDX-License-Identifier: MIT
#include <array>

#include <doctest/doctest.h>

#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/toa_chan.hpp"
#include "uwbpos/solve/toa_least_squares.hpp"
#include "uwbpos/solve/toa_linear.hpp"

#include "solve/solver_laws.hpp"

namespace tests::solve_toa_least_squares {

using namespace uwbpos;

namespace {

const auto solve = [](const auto& ranges) { return toa_least_squares(ranges); };

template <class S, int D>
void check_exactness() {
  sim::Random random{"least squares is exact"};
  for (int trial = 0; trial < 5000; ++trial) {
    const auto room = test::random_room<S, D>(random, D + 2, 10);
    const auto fix = toa_least_squares(room.ranges);
    REQUIRE(fix);
    CHECK(static_cast<double>((fix->position - room.tag).norm()) < test::exactness<S>());
  }
}

template <class S, int D>
void check_start() {
  sim::Random random{"least squares from a start"};
  for (int trial = 0; trial < 1000; ++trial) {
    const auto room = test::random_room<S, D>(random, D, 10, D == 3);
    LeastSquaresOptions<S, D> options;
    // Within 20 cm, below the ceiling by as much: the basin is the tag's own.
    options.initial = Vec<S, D>{room.tag + S(0.1) * test::random_direction<S, D>(random)};
    const auto fix = toa_least_squares(room.ranges, options);
    REQUIRE(fix);
    // The last step is below 1e-4 sigma, 0.2 mm at GDOP 20, and what it leaves is its square.
    CHECK(static_cast<double>((fix->position - room.tag).norm()) < test::exactness<S>() + 1e-6);
  }
}

}  // namespace

TEST_CASE_TEMPLATE("least squares: exact ranges give the exact position", S, float, double) {
  check_exactness<S, 2>();
  check_exactness<S, 3>();
}

TEST_CASE_TEMPLATE("least squares: from a start nearby, flat or few anchors will do", S, float,
                   double) {
  check_start<S, 2>();
  check_start<S, 3>();
}

TEST_CASE_TEMPLATE("least squares: the covariance predicts the errors", S, float, double) {
  test::check_consistency<S, 2>(solve, test::four_corners<S>(), Vec<S, 2>{3, 2}, 0.999);
}

TEST_CASE_TEMPLATE("least squares: unequal sigmas weigh as they should", S, float, double) {
  // Two ranges of 1 mm pin the tag; two of 1 m, wrong by 0.5 m, must not move it.
  auto ranges = test::ranges_between<S, 2>({4, 3}, test::four_corners<S>(), S(1e-3));
  ranges[2].sigma = ranges[3].sigma = 1;
  ranges[2].range += S(0.5);
  ranges[3].range -= S(0.5);
  const auto fix = toa_least_squares(ranges);
  REQUIRE(fix);
  // The pull of a weight of 1e-6 on half a metre is a micrometre.
  CHECK((fix->position - Vec<S, 2>{4, 3}).norm() < S(2e-5));
  CHECK(fix->chi_squared == doctest::Approx(0.5).epsilon(0.01));
  CHECK(fix->degrees_of_freedom == 2);
}

TEST_CASE_TEMPLATE("least squares: what it cannot solve is refused by name", S, float, double) {
  test::check_refusals<S, 2>(solve);
  test::check_refusals<S, 3>(solve);
  sim::Random random{"least squares flat"};
  const auto ceiling = test::random_room<S, 3>(random, 6, 6, true);
  CHECK(toa_least_squares(ceiling.ranges).error() == Error::AmbiguousSolution);

  const auto ranges = test::ranges_between<S, 2>({4, 3}, test::four_corners<S>());
  LeastSquaresOptions<S, 2> options;
  options.max_iterations = 0;
  CHECK(toa_least_squares(ranges, options).error() == Error::InvalidOption);
  options.max_iterations = 1;
  options.initial = Vec<S, 2>{40, -30};
  CHECK(toa_least_squares(ranges, options).error() == Error::NotConverged);
  options.max_iterations = 30;
  CHECK(toa_least_squares(ranges, options));
  options.initial = Vec<S, 2>{std::numeric_limits<S>::infinity(), 0};
  CHECK(toa_least_squares(ranges, options).error() == Error::NotFinite);
}

// Rounding of products once made a determinant, and variances, of what has none.
TEST_CASE_TEMPLATE("least squares: three anchors nearly in a row do not say how high the tag is", S,
                   float, double) {
  sim::Random random{"least squares of a graded plane"};
  for (int trial = 0; trial < 5000; ++trial) {
    std::array<RangeTo<S, 3>, 3> ranges{};
    ranges[1].anchor = S(0.1) * test::random_direction<S, 3>(random);
    ranges[2].anchor = S(100) * test::random_direction<S, 3>(random);
    for (RangeTo<S, 3>& r : ranges) {
      r.range = S(random.uniform(0, 1));
      r.sigma = S(0.1);
    }
    CHECK_FALSE(toa_least_squares(ranges));
    const std::array<RangeTo<S, 3>, 4> again{ranges[0], ranges[1], ranges[2], ranges[1]};
    CHECK_FALSE(toa_linear(again));
    CHECK_FALSE(toa_chan(again));
  }
}

TEST_CASE_TEMPLATE("least squares: a start on an anchor or in a row is no end", S, float, double) {
  const auto ranges = test::ranges_between<S, 2>({4, 3}, test::four_corners<S>());
  for (const auto& r : ranges) {
    LeastSquaresOptions<S, 2> options;
    options.initial = r.anchor;
    const auto fix = toa_least_squares(ranges, options);
    REQUIRE(fix);
    CHECK((fix->position - Vec<S, 2>{4, 3}).norm() < S(1e-4));
  }
}

// Where χ² is bent, within twice sigma of an anchor, whose range may be below zero.
TEST_CASE("least squares: a tag on an anchor, in noise") {
  sim::Random random{"least squares on an anchor"};
  int missing = 0;
  int unlocated = 0;
  for (int k = 0; k < 20000; ++k) {
    auto ranges = test::ranges_between<double, 2>({0, 0}, test::four_corners<double>());
    const Vec<double, 2> tag = ranges[1].anchor + test::random_in_cube<double, 2>(random, 0.2);
    for (auto& r : ranges) {
      // Farther below zero is Error::NegativeRange.
      const double noise = std::max(random.normal(0, r.sigma), -4 * r.sigma);
      r.range = norm<double, 2>(tag - r.anchor) + noise;
    }
    missing += toa_least_squares(ranges) ? 0 : 1;
    unlocated += locate(ranges) ? 0 : 1;
  }
  // Of every 20,000 descents 330 ran out of steps where one does.
  CHECK(missing <= 4);
  CHECK(unlocated == 0);
}

}  // namespace tests::solve_toa_least_squares
