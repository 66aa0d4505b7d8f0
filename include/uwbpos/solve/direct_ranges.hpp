// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The clear case of a position from ranges, as most are: anchors all around, noise small beside
/// distances. Two passes over the ranges and no branch, so that lanes of a register may each solve
/// an epoch of its own (solve/batch.hpp); what is not clear says so and is left to other solvers.
///
/// The first pass leads to the minimum of the squares' system (direct_range_squares.hpp), whose
/// errors are those of the maximum likelihood but for noise squared.
///
/// The second pass makes J, H and ∇ of newton.hpp there, and one step of Newton ends it
/// (direct_step.hpp); where it does not, scalars take a second.

#include <limits>

#include "uwbpos/model/range_set.hpp"
#include "uwbpos/model/range_terms.hpp"
#include "uwbpos/solve/direct_range_squares.hpp"
#include "uwbpos/solve/direct_step.hpp"

namespace uwbpos {

/// A position in the clear case; numbers or lanes of numbers. `clear`: a bool, or a mask of lanes.
template <class P, int D, class Mask>
struct DirectRanges {
  Numbers<P, D> from_first;  ///< from the first anchor [m]
  Lower<P, D> covariance;    ///< J⁻¹ [m²]
  P chi_squared;             ///< at the position
  P other;                   ///< what χ² of a mirror image is at least, about
  Mask clear;                ///< it is the minimum of χ² that the squares lead to
};

/// Solves `ranges`, as `range_squares` takes them. O(n·D²), no allocation. Never fails: what the
/// squares do not start, or the steps do not settle, is not `clear`.
template <class S, int D, class P, class V>
[[nodiscard, gnu::always_inline]] inline auto direct_ranges(const V& ranges) {
  constexpr S kEpsilon = std::numeric_limits<S>::epsilon();
  const Numbers<P, D> first = first_anchor<P, D>(ranges);
  const auto squares = range_squares<S, D, P>(ranges, first);
  Numbers<P, D> place = squares.place;
  constexpr int kLower = D * (D + 1) / 2;
  constexpr int kPull = kLower;           // ∇, after J
  constexpr int kBends = kPull + D;       // Σ b g gᵀ
  constexpr int kTurn = kBends + kLower;  // Σ w / d
  constexpr int kChi = kTurn + 1;         // χ²
  for (int left = kDirectSteps<S, P>;; --left) {
    const auto terms = sum_in_lanes<P, kChi + 1>(
        ranges, [&](auto& sum, const auto& take, const auto& one) __attribute__((always_inline)) {
          using Q = std::remove_cvref_t<decltype(one)>;
          const RangeTerms<Q, D> r = range_terms<S, D>(place, first, take, one);
          const Q range = take([](const auto& taken) { return taken.range; });
          const Q residual = (range > Q{} ? range : Q{}) - r.distance;  // no cusp at the anchor
          const Q weighted = residual * r.weight;
          unroll<D>([&](auto k) __attribute__((always_inline)) {
            sum[kPull + k] += weighted * r.gradient[k];
          });
          add_lower<D, 0>(sum, r.gradient, r.weight);
          add_lower<D, kBends>(sum, r.gradient, Q{residual * r.turn});
          sum[kTurn] += r.turn;
          sum[kChi] += weighted * residual;
        });
    DirectNormal<P, D> normal;
    unroll<kLower>([&](auto k) __attribute__((always_inline)) {
      normal.information[k] = terms[k];
      normal.bends[k] = terms[kBends + k];
    });
    unroll<D>([&](auto k)
                  __attribute__((always_inline)) { normal.gradient[k] = terms[kPull + k]; });
    normal.chi_squared = terms[kChi];
    const P third = kThirdDerivative<S> * terms[kTurn];
    normal.third_square = third * third;
    normal.stray_square = P{};
    normal.noise = trace_of<P, D>(normal.information) * (kEpsilon * kEpsilon * squares.squares);
    const auto end = direct_step<S, P, D>(normal);
    unroll<D>([&](auto k) __attribute__((always_inline)) { place[k] += end.step[k]; });
    const auto clear = squares.started & end.settled & is_finite(inner<P, D>(place, place));
    if (kDirectSteps<S, P> == 1 || left == 1 || is_certain(clear)) {
      return DirectRanges<P, D, std::remove_cv_t<decltype(clear)>>{
          place, end.covariance, end.chi_squared, squares.other, clear};
    }
  }
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
