// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The clear case of a position from pseudoranges, as direct_ranges.hpp is that of one from ranges.
/// The squares' system (direct_squares.hpp) cannot weigh by distances, which the bias hides: on the
/// profile of pseudorange_profile.hpp a step of Gauss and Newton goes before that of Newton. One
/// evaluation more, at the image, with the gain that a step from there would bring, tells whether a
/// mirror image is to be feared.

#include <limits>

#include "uwbpos/model/range_terms.hpp"
#include "uwbpos/solve/direct_squares.hpp"
#include "uwbpos/solve/direct_step.hpp"
#include "uwbpos/solve/pseudorange_profile.hpp"

namespace uwbpos {

/// Position and bias in the clear case; numbers or lanes of numbers. `clear`: a bool, or a mask.
template <class P, int D, class Mask>
struct DirectPseudoranges {
  Numbers<P, D> from_first;     ///< from the first anchor [m]
  P bias;                       ///< from the first pseudorange [m]
  Lower<P, D> covariance;       ///< of the position [m²]
  Numbers<P, D> mean_gradient;  ///< ḡ of pseudorange_profile.hpp
  P total_weight;               ///< Σ w [1/m²]
  P chi_squared;                ///< at the solution
  P other;                      ///< χ² of any mirror image, about
  Mask clear;                   ///< it is a minimum of χ², and `other` holds
};

/// (1) of pseudorange_profile.hpp about the first entry.
template <class P, int D>
struct DirectProfile {
  DirectNormal<P, D> normal;  ///< all but `bends` and bounds where not bent
  Numbers<P, D> mean;         ///< ḡ
  P residual;                 ///< ē, from the bias given
};

/// That at `state`, (position, bias) from the first anchor and pseudorange; `each` = 1/W, known
/// beforehand and so not waited for, `noise` [m²] of lengths squared. O(n·D²), no allocation.
template <class S, int D, Curvature curvature, class P, class V>
[[nodiscard, gnu::always_inline]] inline DirectProfile<P, D> direct_profile(
    const V& view, const Numbers<P, D>& first, const P& first_range, const Numbers<P, D + 1>& state,
    const P& each, const P& noise) {
  constexpr bool kBent = curvature == Curvature::Full;
  constexpr int kMean = D * (D + 1) / 2;  // Σ w g, after Σ w g gᵀ
  constexpr int kPull = kMean + D;        // Σ w e g
  constexpr int kResidual = kPull + D;    // Σ w e
  constexpr int kChi = kResidual + 1;     // Σ w e²
  constexpr int kTurn = kChi + 1;         // Σ w / d, where bent
  constexpr int kBends = kTurn + 1;       // Σ b g gᵀ with b = w e / d
  constexpr int kCount = kBent ? kBends + kMean : kTurn;
  const auto sums = sum_in_lanes<P, kCount>(
      view, [&](auto& sum, const auto& take, const auto& one) __attribute__((always_inline)) {
        using Q = std::remove_cvref_t<decltype(one)>;
        const RangeTerms<Q, D> r = range_terms<S, D>(state, first, take, one);
        const Q range = take([](const auto& taken) { return taken.range; });
        const Q e = ((range - first_range) - state[D]) - r.distance;
        const Q weighted = r.weight * e;
        unroll<D>([&](auto k) __attribute__((always_inline)) {
          sum[kMean + k] += r.weight * r.gradient[k];
          sum[kPull + k] += weighted * r.gradient[k];
        });
        add_lower<D, 0>(sum, r.gradient, r.weight);
        sum[kResidual] += weighted;
        sum[kChi] += weighted * e;
        if constexpr (kBent) {
          sum[kTurn] += r.turn;
          add_lower<D, kBends>(sum, r.gradient, Q{r.turn * e});
        }
      });
  DirectProfile<P, D> profile;
  DirectNormal<P, D>& normal = profile.normal;
  Lower<P, D>& information = normal.information;
  unroll<kMean>([&](auto k) __attribute__((always_inline)) { information[k] = sums[k]; });
  profile.residual = sums[kResidual] * each;
  unroll<D>([&](auto j) __attribute__((always_inline)) {
    profile.mean[j] = sums[kMean + j] * each;
    normal.gradient[j] = sums[kPull + j] - profile.residual * sums[kMean + j];
  });
  unroll<D>([&](auto j) __attribute__((always_inline)) {
    unroll<D - j>([&](auto i) __attribute__((always_inline)) {
      information[lower_index<D>(j + i, j)] -= sums[kMean + j + i] * profile.mean[j];
    });
  });
  normal.chi_squared = sums[kChi] - profile.residual * sums[kResidual];
  if constexpr (kBent) {
    unroll<kMean>([&](auto k)
                      __attribute__((always_inline)) { normal.bends[k] = sums[kBends + k]; });
    // (kThirdDerivative + 3 |ḡ|)² Σ² or more; and the bends of a bias that is off by ē.
    const P turn = sums[kTurn] * sums[kTurn];
    normal.third_square = turn * (S(2) * kThirdDerivative<S> * kThirdDerivative<S> +
                                  S(18) * inner<P, D>(profile.mean, profile.mean));
    normal.stray_square = turn * profile.residual * profile.residual;
    normal.noise = trace_of<P, D>(information) * noise;
  }
  return profile;
}

/// Solves `view` of scalars P = S or of lanes. O(n·D²), no allocation. Never fails: what is not
/// well formed, or not clear, is not `clear`.
template <class S, int D, class P, class V>
[[nodiscard, gnu::always_inline]] inline auto direct_pseudoranges(const V& view) {
  constexpr S kEpsilon = std::numeric_limits<S>::epsilon();
  Numbers<P, D> first;
  unroll<D>([&](auto k)
                __attribute__((always_inline)) { first[k] = P{} + view[0].anchor[int(k)]; });
  const P first_range = view[0].range;
  const auto squares = square_minimum<S, D, P>(view, first, first_range);
  const P noise = kEpsilon * kEpsilon * squares.squares;

  Numbers<P, D + 1> state = squares.minimum;
  const auto move = [&](const auto& profile,
                        const Numbers<P, D>& step) __attribute__((always_inline)) {
    unroll<D>([&](auto k) __attribute__((always_inline)) { state[k] += step[k]; });
    state[D] += profile.residual - inner<P, D>(profile.mean, step);
  };
  const auto near = direct_profile<S, D, Curvature::Information, P>(view, first, first_range, state,
                                                                    squares.each, noise);
  move(near, gauss_step<S>(near.normal).step);

  // One fix alone need not look at an image that is far off.
  constexpr S kFar = S(128);
  P other = squares.worse;
  auto judged = squares.worse > kFar;
  if (!std::is_same_v<P, S> || !is_certain(judged)) {
    const auto image = direct_profile<S, D, Curvature::Information, P>(
        view, first, first_range, squares.image, squares.each, noise);
    const auto end = gauss_step<S>(image.normal);
    other = judged ? squares.worse : end.chi_squared;
    judged = judged | end.well_conditioned;
  }

  for (int left = kDirectSteps<S, P>;; --left) {
    const auto at = direct_profile<S, D, Curvature::Full, P>(view, first, first_range, state,
                                                             squares.each, noise);
    const auto end = direct_step<S, P, D>(at.normal);
    move(at, end.step);
    // What unit vectors have in common was taken off after they were squared.
    constexpr S kLittle = S(1024) * kEpsilon;
    const auto clear = squares.well_formed & judged & end.settled & is_finite(state[D]) &
                       (trace_of<P, D>(end.covariance) * squares.total_weight * kLittle < S(1)) &
                       is_finite(inner<P, D + 1>(state, state));
    if (kDirectSteps<S, P> == 1 || left == 1 || is_certain(clear)) {
      DirectPseudoranges<P, D, std::remove_cv_t<decltype(clear)>> fix;
      unroll<D>([&](auto k) __attribute__((always_inline)) { fix.from_first[k] = state[k]; });
      fix.bias = state[D];
      fix.covariance = end.covariance;
      fix.mean_gradient = at.mean;
      fix.total_weight = squares.total_weight;
      fix.chi_squared = end.chi_squared;
      fix.other = other;
      fix.clear = clear;
      return fix;
    }
  }
}

/// The position part in the anchors' frame. O(D²).
template <class S, int D, class Mask, class V>
[[nodiscard, gnu::always_inline]] inline Fix<S, D> position_of(
    const DirectPseudoranges<S, D, Mask>& direct, const V& view) {
  return direct_fix<S, D>(view[0].anchor, direct.from_first, direct.covariance, direct.chi_squared,
                          static_cast<int>(view.size()) - (D + 1));
}

/// All of it, by (2) of pseudorange_profile.hpp. O(D²).
template <class S, int D, class Mask, class V>
[[nodiscard]] BiasedFix<S, D> biased_fix_of(const DirectPseudoranges<S, D, Mask>& direct,
                                            const V& view) {
  BiasedFix<S, D> fix;
  const Fix<S, D> position = position_of<S, D>(direct, view);
  fix.position = position.position;
  fix.bias = view[0].range + direct.bias;
  fix.chi_squared = position.chi_squared;
  fix.degrees_of_freedom = position.degrees_of_freedom;
  fix.covariance =
      covariance_with_bias<S, D>(position.covariance, direct.mean_gradient, direct.total_weight);
  return fix;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
