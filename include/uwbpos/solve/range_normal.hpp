// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The normal equations (newton.hpp) of
/// \f$ \chi^2(p) = \sum (r_i - |p - a_i|)^2 / \sigma_i^2 \f$, with g the unit vectors of
/// model/range.hpp and \f$ \partial^2 h = (I - g g^T) / |p - a| \f$, by one root and one division a
/// range.

#include "uwbpos/core/lanes.hpp"
#include "uwbpos/model/range_set.hpp"
#include "uwbpos/model/range_terms.hpp"
#include "uwbpos/solve/newton.hpp"

namespace uwbpos {

/// Knowledge about one direction that ranges alone leave open: `direction` · (p − `point`) is zero,
/// with `information`.
template <class S, int D>
struct DirectionPrior {
  Vec<S, D> point = Vec<S, D>::Zero();      ///< [m]
  Vec<S, D> direction = Vec<S, D>::Zero();  ///< unit length
  S information = S(0);                     ///< 1/variance [1/m²]; zero: nothing is known
};

/// The normal equations at `position`, relative to `center` like `prior`. O(n·D²), no allocation.
template <class S, int D>
[[nodiscard, gnu::always_inline]] inline NormalEquations<S, D> range_normal(
    RangeSpan<S, D> ranges, const Vec<S, D>& center, const Vec<S, D>& position,
    const DirectionPrior<S, D>& prior, Curvature curvature) {
  constexpr int kPull = D * (D + 1) / 2;  // ∇, after Σ (w + b) g gᵀ with b = w e / d
  constexpr int kWeight = kPull + D;      // Σ w
  constexpr int kBend = kWeight + 1;      // Σ b
  constexpr int kTurn = kBend + 1;        // Σ w / d
  constexpr int kSquare = kTurn + 1;      // Σ w e²
  const S bending = curvature == Curvature::Full ? S(1) : S(0);
  const auto sums = sum_in_lanes<S, kSquare + 1>(
      ranges, [&](auto& sum, const auto& take, const auto& one) __attribute__((always_inline)) {
        using P = std::remove_cvref_t<decltype(one)>;
        const RangeTerms<P, D> r = range_terms<S, D>(position, center, take, one);
        const P range = take([](const auto& taken) { return taken.range; });
        const P residual = (range > P{} ? range : P{}) - r.distance;  // no cusp at the anchor
        const P weighted = residual * r.weight;
        const P bend = bending * (residual * r.turn);
        unroll<D>([&](auto k) __attribute__((always_inline)) {
          sum[kPull + k] += weighted * r.gradient[k];
        });
        add_lower<D, 0>(sum, r.gradient, r.weight + bend);
        sum[kWeight] += r.weight;
        sum[kBend] += bend;
        sum[kTurn] += r.turn;
        sum[kSquare] += weighted * residual;
      });
  NormalEquations<S, D> normal;
#pragma GCC unroll 4
  for (int j = 0; j < D; ++j) {
#pragma GCC unroll 4
    for (int i = j; i < D; ++i) normal.matrix(i, j) = sums[lower_index<D>(i, j)];
    normal.matrix(j, j) -= sums[kBend];
    normal.gradient[j] = sums[kPull + j];
  }
  normal.trace = sums[kWeight];
  normal.third = kThirdDerivative<S> * sums[kTurn];
  normal.chi_squared = sums[kSquare];
  if (prior.information > S(0)) {
    add_outer(normal.matrix, prior.direction, prior.information);
    const S off = dot<S, D>(prior.direction, prior.point - position);
    normal.gradient += prior.direction * (prior.information * off);
    normal.trace += prior.information;
    normal.chi_squared += prior.information * off * off;
  }
  return normal;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
