// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The laws that every solver of ranges keeps, run for each with each scalar and dimension; those
/// of moving the scene are in properties/.

#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/core/linalg.hpp"

#include "solve/rooms.hpp"
#include "support/statistics.hpp"

namespace uwbpos::test {

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
