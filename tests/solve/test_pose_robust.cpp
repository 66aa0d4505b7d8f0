// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/solve/pose_from_ranges.hpp"

#include "pose/scenes.hpp"
#include "support/nees.hpp"

namespace tests::solve_pose_robust {

using namespace uwbpos;

namespace {

struct Errors {
  double position = 0;  ///< rms [m]
  double heading = 0;   ///< rms [rad]
  double nees = 0;      ///< mean
};

const std::vector<Vec<double, 2>> kArms{{0, 0.5}, {0, -0.5}, {0.5, 0}};
const std::vector<Vec<double, 2>> kAnchors{{0, 0}, {5, 0}, {10, 0}, {10, 8}, {5, 8}, {0, 8}};

// Each range is late by 1 to 3 m with the given probability.
Errors run(Loss loss, double blocked) {
  sim::Random random{"robust poses"};
  Errors errors;
  constexpr int draws = 300;
  int refused = 0;
  for (int i = 0; i < draws; ++i) {
    const Vec<double, 2> place{random.uniform(2, 8), random.uniform(2, 6)};
    const double heading = random.uniform(-3.1, 3.1);
    auto ranges = test::noisy<double, 2>(
        random, test::tag_ranges<double, 2>(place, heading, kArms, kAnchors));
    for (auto& r : ranges) {
      if (random.chance(blocked)) r.range += random.uniform(1, 3);
    }
    // With squares `pose_from_ranges` would refuse most of these.
    const auto fix = solve_pose(ranges, {.robust = {loss}});
    if (!fix) {
      // Outliers that two headings explain alike, mostly to squares; left out.
      CHECK(fix.error() == Error::AmbiguousSolution);
      ++refused;
      continue;
    }
    const Pose2<double>* pose = &fix->pose;
    const double turn = angle_difference(pose->heading, heading);
    errors.position += squared_norm<double, 2>(pose->position - place) / draws;
    errors.heading += turn * turn / draws;
    errors.nees +=
        test::normalised_squared_error<double, 3>({pose->position[0], pose->position[1], turn},
                                                  pose->covariance, {place[0], place[1], 0}) /
        draws;
  }
  CHECK(refused <= (loss == Loss::Squares ? draws / 50 : draws / 100));
  return {std::sqrt(errors.position), std::sqrt(errors.heading), errors.nees};
}

}  // namespace

TEST_CASE("clean ranges: robust losses cost 2 to 3 % of accuracy, and covariances stay honest") {
  const Errors squares = run(Loss::Squares, 0);
  for (const Loss loss : {Loss::Huber, Loss::Cauchy}) {
    const Errors robust = run(loss, 0);
    // 95 % efficient: 2.6 % more rms; 300 draws of three errors tell a ratio to some 2 %.
    CHECK(robust.position < 1.07 * squares.position);
    CHECK(robust.heading < 1.07 * squares.heading);
    // NEES of 3, ± 3 · √(6/300) of sampling, up to 15 % less: weights below one understate what
    // clean ranges tell.
    CHECK(robust.nees > 2.3);
    CHECK(robust.nees < 3.45);
  }
}

TEST_CASE("one range in ten late by metres: least squares follows, Huber half, Cauchy hardly") {
  const Errors squares = run(Loss::Squares, 0.1);
  const Errors huber = run(Loss::Huber, 0.1);
  const Errors cauchy = run(Loss::Cauchy, 0.1);
  MESSAGE("rms ", squares.position, " m by squares, ", huber.position, " m by Huber, ",
          cauchy.position, " m by Cauchy; heading ", squares.heading, ", ", huber.heading, ", ",
          cauchy.heading, " rad");
  CHECK(huber.position < 0.5 * squares.position);
  CHECK(cauchy.position < 0.3 * squares.position);
  CHECK(huber.heading < 0.5 * squares.heading);
  CHECK(cauchy.heading < 0.4 * squares.heading);
}

TEST_CASE_TEMPLATE("losses: their weights and curvatures are their derivatives", S, float, double) {
  // Central differences of a function of unit scale: ε^(2/3), second ones ε^(1/2) and more.
  const S step = sizeof(S) == 4 ? S(0.02) : S(1e-4);
  const S tolerance = sizeof(S) == 4 ? S(5e-3) : S(1e-6);
  for (const Loss loss : {Loss::Squares, Loss::Huber, Loss::Cauchy}) {
    for (const S u : {S(-6), S(-2), S(-1), S(0.3), S(1.2), S(3)}) {
      const RobustLoss<S> robust{loss};
      const auto term = loss_term(robust, u);
      const auto up = loss_term(robust, u + step);
      const auto down = loss_term(robust, u - step);
      CHECK(std::abs(term.weight - (up.cost - down.cost) / (4 * step * u)) < tolerance);
      const S slope = (up.weight * (u + step) - down.weight * (u - step)) / (2 * step);
      CHECK(std::abs(term.curvature - slope) < tolerance);
    }
  }
  CHECK(loss_term<S>({Loss::Huber, S(2)}, S(1.9)).weight == S(1));
  CHECK(loss_term<S>({Loss::Huber, S(2)}, S(4)).weight == S(0.5));
}

}  // namespace tests::solve_pose_robust
