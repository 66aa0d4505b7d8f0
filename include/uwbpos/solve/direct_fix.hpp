// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The clear case of a position from ranges, as most are: anchors all around, noise small beside
/// distances. Two passes over the ranges and no branch, so that lanes of a register may each solve
/// an epoch of its own (solve/batch.hpp); what is not clear says so and is left to the descent.
///
/// The first pass makes the linear system of squares (squared_ranges.hpp): A s₀ = b about the
/// anchors' weighted mean, and their mean |s|² = ρ², independent of each other. Together
/// \f[ f(s) = (s - s_0)^T A (s - s_0) + \tfrac{W}{4} \left( |s|^2 - \rho^2 \right)^2, \qquad (1) \f]
/// whose minimum, by the update of an iterated Kalman filter with the mean as its measurement, has
/// the errors of the maximum likelihood but for noise squared. There \f$ (A + \lambda I) s = b, \;
/// \lambda = W (|s|^2 - \rho^2) / 2 \f$, and a minimum with A + λI positive definite is the lowest
/// (A. Beck, P. Stoica and J. Li, IEEE Trans. Signal Processing 56(5), 2008). Any other, a mirror
/// image, has λ_min(A) ≤ −λ ≤ Wρ²/2, as |s|² = ρ² + 2λ/W has it, and where the two leave room
/// \f[ f = \lambda^2 \left( s^T A^{-1} s + \tfrac1W \right) \ge \min\left( \lambda_{min}^2 \left(
///     \frac{\rho^2 - 2 \lambda_{min} / W}{\lambda_{max}} + \frac1W \right), \tfrac14 W \rho^4
///     \right). \qquad (2) \f]
///
/// The second pass makes J, H and ∇ of newton.hpp there, and one step of Newton ends it: what the
/// step leaves of ∇ is at most half of the third derivative times its length squared.

#include <limits>

#include "uwbpos/core/cofactors.hpp"
#include "uwbpos/model/range_set.hpp"
#include "uwbpos/model/range_terms.hpp"
#include "uwbpos/solve/newton.hpp"
#include "uwbpos/solve/square_sums.hpp"

namespace uwbpos {

/// Where a position and its covariance come from in the clear case; numbers or lanes of numbers.
template <class P, int D>
struct DirectFix {
  Numbers<P, D> from_first;  ///< from the first anchor [m]
  Lower<P, D> covariance;    ///< J⁻¹ [m²]
  P chi_squared;             ///< at the position
  P other;                   ///< (2), what χ² of a mirror image is at least, about
};

/// A solution, and where it holds: `clear` is a bool, or a mask of lanes.
template <class P, int D, class Mask>
struct DirectSolution {
  DirectFix<P, D> fix;       ///< the solution
  Numbers<P, D> start;       ///< where (1) has its minimum, from the first anchor [m]
  P squares;                 ///< sum of all lengths met, squared [m²]
  Mask started;              ///< ranges are well formed and (1) has its lowest minimum here
  Mask clear;                ///< and `fix` is the minimum of χ²
};

/// Solves `ranges`, anything with a size and elements like `RangeTo`, of scalars P = S or of lanes.
/// O(n·D²), no allocation. Never fails: `started` is false where a range, a sigma or an anchor is
/// not as `check_ranges` wants it, but for their number, or the system of squares does not do.
template <class S, int D, class P, class V>
[[nodiscard, gnu::always_inline]] inline auto direct_fix(const V& ranges) {
  using At = SquareSums<D>;
  constexpr int kFault = At::kCount;    // below zero where a sign is wrong
  constexpr int kSquares = kFault + 1;  // Σ |u|² + r² + σ²
  constexpr S kEpsilon = std::numeric_limits<S>::epsilon();
  Numbers<P, D> first;
  unroll<D>([&](auto k) __attribute__((always_inline)) { first[k] = ranges[0].anchor[int(k)]; });
  const auto sums = sum_in_lanes<P, kSquares + 1>(
      ranges, [&](auto& sum, const auto& take, const auto& one) __attribute__((always_inline)) {
        using Q = std::remove_cvref_t<decltype(one)>;
        Numbers<Q, D> d;
        Q square = Q{};
        unroll<D>([&](auto k) __attribute__((always_inline)) {
          d[k] = take([&](const auto& r) { return r.anchor[int(k)]; }) - first[k];
          square += d[k] * d[k];
        });
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
  const P each = S(1) / sums[At::kWeight];
  const P mean_square = sums[At::kSquare] * each;
  Numbers<P, D> m;
  Numbers<P, D> b;
  Lower<P, D> a;
  unroll<D>([&](auto j) __attribute__((always_inline)) {
    m[j] = sums[At::kMean + j] * each;
    b[j] = sums[At::kPull + j] - m[j] * sums[At::kSquare];
  });
  unroll<D>([&](auto j) __attribute__((always_inline)) {
    unroll<D - j>([&](auto i) __attribute__((always_inline)) {
      a[lower_index<D>(j + i, j)] =
          sums[lower_index<D>(j + i, j)] - sums[At::kMean + j + i] * m[j];
    });
  });
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
    unroll<D>([&](auto k) __attribute__((always_inline)) {
      s[k] = linear[k] + gain * towards[k];
    });
  }
  const P pull = S(0.5) * sums[At::kWeight] * (inner<P, D>(s, s) - rho_square);  // λ
  const P least = of_a.determinant / trace_of<P, D>(of_a.adjugate);  // no more than λ_min
  Numbers<P, D> start;
  unroll<D>([&](auto k) __attribute__((always_inline)) { start[k] = s[k] + m[k]; });

  constexpr int kPull = D * (D + 1) / 2;  // ∇, after J
  constexpr int kBends = kPull + D;       // Σ b g gᵀ with b = w e / d; its trace is Σ b
  constexpr int kTurn = kBends + kPull;   // Σ w / d
  constexpr int kChi = kTurn + 1;         // χ²
  const auto terms = sum_in_lanes<P, kChi + 1>(
      ranges, [&](auto& sum, const auto& take, const auto& one) __attribute__((always_inline)) {
        using Q = std::remove_cvref_t<decltype(one)>;
        const RangeTerms<Q, D> r = range_terms<S, D>(start, first, take, one);
        const Q range = take([](const auto& taken) { return taken.range; });
        const Q residual = (range > Q{} ? range : Q{}) - r.distance;  // no cusp at the anchor
        const Q weighted = residual * r.weight;
        const Q bend = residual * r.turn;
        unroll<D>([&](auto k) __attribute__((always_inline)) {
          sum[kPull + k] += weighted * r.gradient[k];
        });
        add_lower<D, 0>(sum, r.gradient, r.weight);
        add_lower<D, kBends>(sum, r.gradient, bend);
        sum[kTurn] += r.turn;
        sum[kChi] += weighted * residual;
      });
  Lower<P, D> information;
  Lower<P, D> hessian;  // bends so far
  Numbers<P, D> gradient;
  unroll<kPull>([&](auto k) __attribute__((always_inline)) {
    information[k] = terms[k];
    hessian[k] = terms[kBends + k];
  });
  const P bend = trace_of<P, D>(hessian);
  unroll<kPull>([&](auto k) __attribute__((always_inline)) { hessian[k] += information[k]; });
  unroll<D>([&](auto k) __attribute__((always_inline)) {
    hessian[lower_index<D>(k, k)] -= bend;
    gradient[k] = terms[kPull + k];
  });
  const Cofactors<P, D> of_j = cofactors<P, D>(information);
  const Cofactors<P, D> of_h = cofactors<P, D>(hessian);
  const P inverse_j = S(1) / of_j.determinant;
  const P inverse_h = S(1) / of_h.determinant;
  Numbers<P, D> step = times<P, D>(of_h.adjugate, gradient);
  DirectFix<P, D> fix;
  unroll<D>([&](auto k) __attribute__((always_inline)) {
    step[k] = inverse_h * step[k];
    fix.from_first[k] = start[k] + step[k];
  });
  unroll<kPull>([&](auto k) __attribute__((always_inline)) {
    fix.covariance[k] = inverse_j * of_j.adjugate[k];
  });
  const P left = terms[kChi] - inner<P, D>(step, gradient);
  fix.chi_squared = left > P{} ? left : P{};
  const P room = rho_square - S(2) * least * each;
  const P image = least * least * (each + room / trace_of<P, D>(a));
  const P none = P{} + std::numeric_limits<S>::max();
  fix.other = room > P{}
                  ? lesser(image, S(0.25) * sums[At::kWeight] * rho_square * rho_square)
                  : none;

  // What the step leaves, in standard deviations squared; and how much it changes J, squared.
  constexpr S kEnough = S(1e-5);
  constexpr S kSameMatrix = S(4e-3);
  const P length = inner<P, D>(step, step);
  const P spread = inverse_h * trace_of<P, D>(of_h.adjugate);
  const P change = kThirdDerivative<S> * terms[kTurn];
  const P change_square = change * change * length;
  const P noise = trace_of<P, D>(information) * (kEpsilon * kEpsilon * sums[kSquares]);
  const P unit = P{} + S(1);
  const P enough = kEnough * lesser(terms[kChi], unit) + noise;
  const auto started = (sums[kFault] == P{}) & is_finite(sums[kSquares]) & is_well_conditioned<S, P, D>(a, of_a) &
                       (pull + least > P{});
  const auto clear = started & is_well_conditioned<S, P, D>(information, of_j) &
                     is_well_conditioned<S, P, D>(hessian, of_h) &
                     (S(0.25) * spread * change_square * length <= enough) &
                     (spread * spread * change_square <= kSameMatrix) & is_finite(fix.chi_squared) &
                     is_finite(inner<P, D>(fix.from_first, fix.from_first)) &
                     is_finite(trace_of<P, D>(fix.covariance));
  return DirectSolution<P, D, std::remove_cv_t<decltype(clear)>>{
      fix, start, sums[kSquares], started, clear};
}

/// As a vector.
template <class S, int D>
[[nodiscard, gnu::always_inline]] inline Vec<S, D> vec_of(const Numbers<S, D>& numbers) {
  Vec<S, D> v;
  unroll<D>([&](auto k) __attribute__((always_inline)) { v[int(k)] = numbers[k]; });
  return v;
}

/// The fix of one epoch, in the anchors' frame. O(D²).
template <class S, int D>
[[nodiscard, gnu::always_inline]] inline Fix<S, D> fix_of(const DirectFix<S, D>& direct,
                                                          RangeSpan<S, D> ranges) {
  Fix<S, D> fix;
  unroll<D>([&](auto j) __attribute__((always_inline)) {
    fix.position[int(j)] = ranges.front().anchor[int(j)] + direct.from_first[j];
    unroll<D>([&](auto i) __attribute__((always_inline)) {
      fix.covariance(int(i), int(j)) =
          direct.covariance[i > j ? lower_index<D>(i, j) : lower_index<D>(j, i)];
    });
  });
  fix.chi_squared = direct.chi_squared;
  fix.degrees_of_freedom = static_cast<int>(ranges.size()) - D;
  return fix;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
