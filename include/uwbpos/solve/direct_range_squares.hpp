// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The system of squared ranges in the clear case, without a branch, for scalars or for lanes of
/// epochs: squared_ranges.hpp makes A s₀ = b about the anchors' weighted mean, and their mean
/// |s|² = ρ², independent of each other. Together
/// \f[ f(s) = (s - s_0)^T A (s - s_0) + \tfrac{W}{4} \left( |s|^2 - \rho^2 \right)^2,
///     \qquad (1) \f]
/// whose minimum, by the update of an iterated Kalman filter with the mean as its measurement, has
/// the errors of the maximum likelihood but for noise squared. There
/// \f$ (A + \lambda I) s = b, \; \lambda = W (|s|^2 - \rho^2) / 2 \f$, and a minimum with A + λI
/// positive definite is the lowest (A. Beck, P. Stoica and J. Li, IEEE Trans. Signal Processing
/// 56(5), 2008). Any other, a mirror image, has −λ beyond the least eigenvalue of A, so that
/// \f[ f = \lambda^2 \left( s^T A^{-1} s + \tfrac1W \right), \qquad
///     |s|^2 = \rho^2 - \tfrac2W |\lambda|. \qquad (2) \f]
/// Up to the next eigenvalue only what s has along the weakest direction changes sign, and the rest
/// grows: |s|² is no less than the rest of |s₀|², or there is no image.

#include <limits>

#include "uwbpos/core/cofactors.hpp"
#include "uwbpos/model/range_set.hpp"
#include "uwbpos/solve/square_sums.hpp"

namespace uwbpos {

/// The minimum of (1); numbers or lanes of numbers. Masks: bools, or masks of lanes.
template <class P, int D, class Mask>
struct RangeSquares {
  Numbers<P, D> place;  ///< from the first anchor [m]
  P other;              ///< what χ² of another is at least, about
  P squares;            ///< Σ |u|² + r² + σ² [m²]
  Mask started;         ///< ranges are well formed, and (1) has its lowest minimum there
  Mask precise;         ///< and rounding is nothing beside noise
  Mask sole;            ///< and another is out of the question
};

/// What f is at least, about, at an image by (2). O(D²).
template <class S, class P, int D>
[[nodiscard, gnu::always_inline]] inline P image_chi_squared(const Lower<P, D>& a,
                                                             const Cofactors<P, D>& of_a,
                                                             const Numbers<P, D>& linear,
                                                             const P& least, const P& each,
                                                             const P& rho_square) {
  const Numbers<P, D> weak = weak_column<P, D>(of_a.adjugate).column;
  const P along = inner<P, D>(weak, linear);
  const P rest = inner<P, D>(linear, linear) - along * along / inner<P, D>(weak, weak);
  const P trace = trace_of<P, D>(a);
  // No more than the next eigenvalue: (λ₂ λ₃ − λ₁²) / tr A, or less.
  const P next =
      D == 3 ? P{trace_of<P, D>(of_a.adjugate) / trace - S(3) * least} : P{S(0.5) * trace};
  const P beyond = next * next * each;
  const P room = rho_square - rest - S(2) * least * each;
  const P near = least * least * (each + (rest + room) / trace);
  const P most = rho_square - rest;
  const P far = S(0.25) * most * most / each;
  const P other = room > P{} ? lesser(lesser(near, far), beyond) : beyond;
  const P trusted = next > P{} ? other : P{};
  return rest + room > P{} ? trusted : P{} + std::numeric_limits<S>::max();
}

/// Solves (1) for `ranges`, anything with a size and elements like `RangeTo`, of scalars P = S or
/// of lanes, relative to the `first` anchor. O(n·D²), no allocation. Never fails: `started` is
/// false where a range, a sigma or an anchor is not as `check_ranges` wants it, but for their
/// number.
template <class S, int D, class P, class V>
[[nodiscard, gnu::always_inline]] inline auto range_squares(const V& ranges,
                                                            const Numbers<P, D>& first) {
  using At = SquareSums<D>;
  constexpr int kFault = At::kCount;    // below zero where a sign is wrong
  constexpr int kSquares = kFault + 1;  // Σ |u|² + r² + σ²
  const auto sums = sum_in_lanes<P, kSquares + 1>(
      ranges, [&](auto& sum, const auto& take, const auto& one) __attribute__((always_inline)) {
        using Q = std::remove_cvref_t<decltype(one)>;
        Numbers<Q, D> d;
        const Q square = anchor_offset<D>(d, take, first);
        const Q range = take([](const auto& r) { return r.range; });
        const Q sigma = take([](const auto& r) { return r.sigma; });
        const Q variance = sigma * sigma;
        const Q range_square = range * range;
        add_square<D, Q>(sum, d, square - range_square,
                         one / (variance * (range_square + S(0.5) * variance)));
        sum[kSquares] += square + range_square + variance;  // a bound: one twice does no harm
        const Q sign = lesser(range + S(kNegativeRangeSigmas) * sigma, sigma - kSmallestSigma<S>);
        sum[kFault] += lesser(sign, Q{});
      });

  // (1) about m, the weighted mean.
  const CentredSums<P, D> about = centred_sums<S, D>(sums);
  const auto& [a, terms, m, b, mean_square, each] = about;
  const Cofactors<P, D> of_a = cofactors<P, D>(a);
  const P inverse = S(1) / of_a.determinant;
  Numbers<P, D> linear = times<P, D>(of_a.adjugate, b);
  unroll<D>([&](auto k) __attribute__((always_inline)) {
    linear[k] = S(0.5) * inverse * linear[k] - m[k];
  });
  const P rho_square = inner<P, D>(m, m) - mean_square;
  const P mean_variance = each * of_a.determinant;
  Numbers<P, D> s = linear;
  for (int i = 0; i < 2; ++i) {
    const Numbers<P, D> towards = times<P, D>(of_a.adjugate, s);
    const P off = rho_square + inner<P, D>(s, s) - S(2) * inner<P, D>(s, linear);
    const P gain = S(0.5) * off / (inner<P, D>(s, towards) + mean_variance);
    unroll<D>([&](auto k) __attribute__((always_inline)) { s[k] = linear[k] + gain * towards[k]; });
  }
  const P pull = S(0.5) * sums[At::kWeight] * (inner<P, D>(s, s) - rho_square);  // λ
  const P least = of_a.determinant / trace_of<P, D>(of_a.adjugate);  // no more than λ_min
  Numbers<P, D> place;
  unroll<D>([&](auto k) __attribute__((always_inline)) { place[k] = s[k] + m[k]; });
  const P other = image_chi_squared<S, P, D>(a, of_a, linear, least, each, rho_square);
  const auto started = (sums[kFault] == P{}) & is_finite(sums[kSquares]) &
                       is_well_conditioned<S, P, D>(a, of_a, terms) & (pull + least > P{});

  // The start of a descent may have lost digits that an answer needs: a third of them at most.
  constexpr S kThird = sizeof(S) == 4 ? S(5e-3) : S(6e-6);  // the cubic root of ε
  constexpr S kGood = kThird / std::numeric_limits<S>::epsilon();
  const auto precise = started & is_finite(inner<P, D>(place, place)) &
                       is_well_conditioned<S, P, D>(a, of_a, terms, kGood);
  constexpr S kHopeless = S(400);
  const auto sole = precise & (other > kHopeless);
  return RangeSquares<P, D, std::remove_cv_t<decltype(sole)>>{place,   other,   sums[kSquares],
                                                              started, precise, sole};
}

/// The first anchor of `ranges`, of each lane the first that is there.
template <class P, int D, class V>
[[nodiscard, gnu::always_inline]] inline Numbers<P, D> first_anchor(const V& ranges) {
  if constexpr (requires { ranges.first(); }) {
    return ranges.first();
  } else {
    Numbers<P, D> first;
    unroll<D>([&](auto k) __attribute__((always_inline)) { first[k] = ranges[0].anchor[int(k)]; });
    return first;
  }
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
