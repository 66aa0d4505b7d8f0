// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The laws that every solver of ranges keeps, run for each with each scalar and dimension.

#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/core/linalg.hpp"

#include "solve/rooms.hpp"
#include "support/statistics.hpp"

namespace uwbpos::test {

/// Permuting, translating and rotating the scene does the same to the answer. `stop`: how
/// far from the minimum an iteration may stop, in standard deviations; 0 for closed forms.
template <class S, int D, class Solver>
void check_equivariance(const Solver& solve, double stop) {
  sim::Random random{"equivariance"};
  int compared = 0;
  for (int trial = 0; trial < 100; ++trial) {
    // Beyond, two images are about to merge, and in so flat a valley float digits count metres.
    const Room<S, D> room = random_room<S, D>(random, D + 2, 8, false, 5);
    auto ranges = noisy<S, D>(random, room.ranges);
    const auto before = solve(ranges);
    if (!before) continue;
    ++compared;
    // Two paths of rounding, each within `exactness` of the unrounded answer at room scale, the
    // moved one three times as far from the origin.
    const double spread = static_cast<double>(before->covariance.norm());
    const double tolerance = 10 * exactness<S>() + stop * std::sqrt(spread);

    shuffle(random, ranges);
    const auto shuffled = solve(ranges);
    REQUIRE(shuffled);
    CHECK(static_cast<double>((shuffled->position - before->position).norm()) < tolerance);

    const Mat<S, D> turn = random_rotation<S, D>(random);
    const Vec<S, D> shift = random_in_cube<S, D>(random, S(30));
    auto moved = ranges;
    for (auto& r : moved) r.anchor = Vec<S, D>{turn * r.anchor + shift};
    const auto after = solve(moved);
    REQUIRE(after);
    const Vec<S, D> expected = turn * before->position + shift;
    const Mat<S, D> turned = turn * before->covariance * turn.transpose();
    CHECK(static_cast<double>((after->position - expected).norm()) < tolerance);
    CHECK(static_cast<double>((after->covariance - turned).norm()) <
          ((sizeof(S) == 4 ? 2e-2 : 1e-8) + stop) * spread);
    CHECK(after->degrees_of_freedom == before->degrees_of_freedom);
    CHECK(static_cast<double>(after->chi_squared) ==
          doctest::Approx(static_cast<double>(before->chi_squared))
              .epsilon(sizeof(S) == 4 ? 1e-2 : 1e-6));
  }
  CHECK(compared > 90);
}

/// A covariance is symmetric and positive, and predicts the errors: the mean of eᵀ C⁻¹ e is D.
template <class S, int D, class Solver>
void check_consistency(const Solver& solve, const std::vector<Vec<S, D>>& anchors, Vec<S, D> tag,
                       double confidence = 0.99) {
  sim::Random random{"consistency"};
  const auto exact = ranges_between<S, D>(tag, anchors);
  constexpr int kTrials = 4000;
  double sum = 0;
  double chi = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto fix = solve(noisy<S, D>(random, exact));
    REQUIRE(fix);
    CHECK(fix->covariance == fix->covariance.transpose());
    const Ldlt<S, D> factor{fix->covariance};
    REQUIRE(factor.positive_definite());
    const Vec<S, D> error = fix->position - tag;
    sum += static_cast<double>(dot(error, factor.solve(error)));
    chi += static_cast<double>(fix->chi_squared);
  }
  CHECK(mean_nees_interval(D, kTrials, confidence).contains(sum / kTrials));
  const int freedom = static_cast<int>(anchors.size()) - D;
  if (freedom > 0) CHECK(chi / kTrials == doctest::Approx(freedom).epsilon(0.1));
}

/// NaN, infinity and what else no solver may take, each by its name.
template <class S, int D, class Solver>
void check_refusals(const Solver& solve) {
  sim::Random random{"refusals"};
  const Room<S, D> room = random_room<S, D>(random, D + 2, D + 2);
  REQUIRE(solve(room.ranges));
  const auto error = [&](const auto& change) {
    auto ranges = room.ranges;
    change(ranges);
    const auto fix = solve(ranges);
    REQUIRE_FALSE(fix);
    return fix.error();
  };
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const S infinity = std::numeric_limits<S>::infinity();
  CHECK(error([&](auto& r) { r[1].range = nan; }) == Error::NotFinite);
  CHECK(error([&](auto& r) { r[1].range = infinity; }) == Error::NotFinite);
  CHECK(error([&](auto& r) { r[0].anchor[D - 1] = -infinity; }) == Error::NotFinite);
  CHECK(error([&](auto& r) { r[2].sigma = nan; }) == Error::NotFinite);
  CHECK(error([&](auto& r) { r[2].sigma = 0; }) == Error::NonPositiveSigma);
  CHECK(error([&](auto& r) { r[2].sigma = -1; }) == Error::NonPositiveSigma);
  CHECK(error([&](auto& r) { r[0].range = -2; }) == Error::NegativeRange);
  CHECK(error([&](auto& r) { r.clear(); }) == Error::TooFewMeasurements);
  CHECK(error([&](auto& r) { r.resize(1); }) == Error::TooFewMeasurements);
  CHECK(error([&](auto& r) { r.resize(65, r[0]); }) == Error::TooManyMeasurements);
  CHECK(error([&](auto& r) {
          for (auto& x : r) x.anchor = r[0].anchor;
        }) == Error::DegenerateGeometry);
  // Numbers whose squares do not fit.
  CHECK(error([&](auto& r) {
          for (auto& x : r) {
            x.anchor *= std::sqrt(std::numeric_limits<S>::max());
            x.range *= std::sqrt(std::numeric_limits<S>::max());
          }
        }) != Error::NotFinite);
}

}  // namespace uwbpos::test
