// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The last step of the clear cases (direct_ranges.hpp, direct_pseudoranges.hpp), without a branch,
/// for scalars or for lanes of epochs: Newton's, with what proves that it was the last. Of ∇ it
/// leaves at most half of the third derivative times its length squared.

#include <limits>

#include "uwbpos/core/cofactors.hpp"
#include "uwbpos/solve/newton.hpp"

namespace uwbpos {

/// What `NormalEquations` are to a descent, in numbers or lanes of numbers.
template <class P, int D>
struct DirectNormal {
  Lower<P, D> information;  ///< J
  Lower<P, D> bends;        ///< Σ b g gᵀ with b = w e / d: H = J + that less its trace
  Numbers<P, D> gradient;   ///< ∇
  P chi_squared;            ///< χ²
  P third_square;           ///< bound of the third derivative, squared
  P stray_square;           ///< of how far H is from what it should be, squared
  P noise;                  ///< what rounding may do to χ²
};

/// A step and what comes of it. `settled`, a bool or a mask of lanes: there is no need of another.
template <class P, int D, class Mask>
struct DirectStep {
  Numbers<P, D> step;      ///< to the minimum [m]
  Lower<P, D> covariance;  ///< J⁻¹ [m²]
  P chi_squared;           ///< at the minimum
  Mask settled;            ///< the step ends there, and it is one
};

/// Solves H s = ∇. O(D³), no allocation. Never fails: what is singular, not a minimum or not finite
/// is not `settled`; nor is what may be off by more than a few thousandths of a standard deviation,
/// or has a covariance off by more than a few hundredths. Both bounds are rarely reached to a
/// tenth.
template <class S, class P, int D>
[[nodiscard, gnu::always_inline]] inline auto direct_step(const DirectNormal<P, D>& normal) {
  constexpr S kEnough = S(2e-5);
  constexpr S kSameMatrix = S(4e-3);
  const Lower<P, D>& information = normal.information;
  Lower<P, D> hessian;
  const P bend = trace_of<P, D>(normal.bends);
  unroll<D*(D + 1) / 2>([&](auto k) __attribute__((always_inline)) {
    hessian[k] = information[k] + normal.bends[k];
  });
  unroll<D>([&](auto k) __attribute__((always_inline)) { hessian[lower_index<D>(k, k)] -= bend; });
  const Cofactors<P, D> of_j = cofactors<P, D>(information);
  const Cofactors<P, D> of_h = cofactors<P, D>(hessian);
  const P inverse_j = S(1) / of_j.determinant;
  const P inverse_h = S(1) / of_h.determinant;
  Numbers<P, D> step = times<P, D>(of_h.adjugate, normal.gradient);
  unroll<D>([&](auto k) __attribute__((always_inline)) { step[k] *= inverse_h; });
  Lower<P, D> covariance;
  unroll<D*(D + 1) / 2>(
      [&](auto k) __attribute__((always_inline)) { covariance[k] = inverse_j * of_j.adjugate[k]; });
  const P left = normal.chi_squared - inner<P, D>(step, normal.gradient);
  const P chi_squared = left > P{} ? left : P{};

  const P length = inner<P, D>(step, step);
  const P variance = inverse_h * trace_of<P, D>(of_h.adjugate);
  const P change = normal.third_square * length;
  const P enough = kEnough * lesser(normal.chi_squared, P{} + S(1)) + normal.noise;
  // The smallest variance, which may have drowned in the rounding of the others.
  P smallest = covariance[0];
  unroll<D - 1>([&](auto k) __attribute__((always_inline)) {
    smallest = lesser(covariance[lower_index<D>(k + 1, k + 1)], smallest);
  });
  const auto settled =
      (smallest > P{}) & is_well_conditioned<S, P, D>(information, of_j) &
      is_well_conditioned<S, P, D>(hessian, of_h) &
      (variance * (S(0.5) * change + S(2) * normal.stray_square) * length <= enough) &
      (variance * variance * change <= kSameMatrix) & is_finite(chi_squared) &
      is_finite(trace_of<P, D>(covariance));
  return DirectStep<P, D, std::remove_cv_t<decltype(settled)>>{step, covariance, chi_squared,
                                                               settled};
}

/// A step of Gauss and Newton. `well_conditioned`: a bool or a mask of lanes.
template <class P, int D, class Mask>
struct GaussStep {
  Numbers<P, D> step;     ///< [m]
  P chi_squared;          ///< what it leaves, to first order
  Mask well_conditioned;  ///< whether J keeps its digits
};

/// Solves J s = ∇. O(D³), no allocation.
template <class S, class P, int D>
[[nodiscard, gnu::always_inline]] inline auto gauss_step(const DirectNormal<P, D>& normal) {
  const Cofactors<P, D> of_j = cofactors<P, D>(normal.information);
  const P inverse = S(1) / of_j.determinant;
  Numbers<P, D> step = times<P, D>(of_j.adjugate, normal.gradient);
  unroll<D>([&](auto k) __attribute__((always_inline)) { step[k] *= inverse; });
  const auto well = is_well_conditioned<S, P, D>(normal.information, of_j);
  return GaussStep<P, D, std::remove_cv_t<decltype(well)>>{
      step, normal.chi_squared - inner<P, D>(step, normal.gradient), well};
}

/// Most steps that a clear case of scalars takes; lanes take one.
template <class S, class P>
inline constexpr int kDirectSteps = std::is_same_v<S, P> ? 2 : 1;

/// The point `from_first`, an anchor at `first` [m].
template <class S, int D, class X>
[[nodiscard, gnu::always_inline]] inline Vec<S, D> moved(const X& first,
                                                         const Numbers<S, D>& from_first) {
  Vec<S, D> point;
  unroll<D>([&](auto k)
                __attribute__((always_inline)) { point[int(k)] = first[int(k)] + from_first[k]; });
  return point;
}

/// A fix `from_first`, an anchor at `first` [m], of lower triangle `covariance`. O(D²).
template <class S, int D, class X>
[[nodiscard, gnu::always_inline]] inline Fix<S, D> direct_fix(const X& first,
                                                              const Numbers<S, D>& from_first,
                                                              const Lower<S, D>& covariance,
                                                              S chi_squared,
                                                              int degrees_of_freedom) {
  Fix<S, D> fix;
  fix.position = moved<S, D>(first, from_first);
  unroll<D>([&](auto j) __attribute__((always_inline)) {
    unroll<D>([&](auto i) __attribute__((always_inline)) {
      fix.covariance(int(i), int(j)) = covariance[lower_of<D>(i, j)];
    });
  });
  fix.chi_squared = chi_squared;
  fix.degrees_of_freedom = degrees_of_freedom;
  return fix;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
