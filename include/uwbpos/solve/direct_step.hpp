// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The last step of the clear cases (direct_ranges.hpp, direct_pseudoranges.hpp), without a branch,
/// for scalars or for lanes of epochs: Newton's, with what proves that it was the last. Of ∇ it
/// leaves at most half of the third derivative times its length squared.

#include <limits>
#include <type_traits>

#include "uwbpos/core/cofactors.hpp"
#include "uwbpos/core/lanes.hpp"
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

/// J⁻¹ and H⁻¹, and whether both are well-conditioned.
template <class P, int D, class Mask>
struct Inverses {
  Lower<P, D> of_j;       ///< J⁻¹
  Lower<P, D> of_h;       ///< H⁻¹
  Mask well_conditioned;  ///< a bool or a mask of lanes
};

/// Those of `j` and `h`, side by side where a register holds two scalars. O(D³).
template <class S, class P, int D>
[[nodiscard, gnu::always_inline]] inline auto inverses(const Lower<P, D>& j, const Lower<P, D>& h) {
  using Pair = typename PairOf<P>::Type;
  Lower<P, D> of_j;
  Lower<P, D> of_h;
  if constexpr (std::is_void_v<Pair>) {
    const auto invert = [](Lower<P, D>& inverse, const Lower<P, D>& a)
                            __attribute__((always_inline)) {
                              const Cofactors<P, D> of_a = cofactors<P, D>(a);
                              const P one_over = S(1) / of_a.determinant;
                              unroll<D*(D + 1) / 2>([&](auto k) __attribute__((always_inline)) {
                                inverse[k] = one_over * of_a.adjugate[k];
                              });
                              return is_well_conditioned<S, P, D>(a, of_a);
                            };
    const auto well = invert(of_j, j) & invert(of_h, h);
    return Inverses<P, D, std::remove_cv_t<decltype(well)>>{of_j, of_h, well};
  } else {
    Lower<Pair, D> both;
    unroll<D*(D + 1) / 2>([&](auto k)
                              __attribute__((always_inline)) { both[k] = Pair{j[k], h[k]}; });
    const Cofactors<Pair, D> of_both = cofactors<Pair, D>(both);
    const Pair one_over = S(1) / of_both.determinant;
    unroll<D*(D + 1) / 2>([&](auto k) __attribute__((always_inline)) {
      const Pair entry = one_over * of_both.adjugate[k];
      of_j[k] = entry[0];
      of_h[k] = entry[1];
    });
    return Inverses<P, D, bool>{of_j, of_h,
                                is_certain(is_well_conditioned<S, Pair, D>(both, of_both))};
  }
}

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
  const auto [covariance, of_h, both_well] = inverses<S, P, D>(information, hessian);
  const Numbers<P, D> step = times<P, D>(of_h, normal.gradient);
  const P left = normal.chi_squared - inner<P, D>(step, normal.gradient);
  const P chi_squared = left > P{} ? left : P{};

  const P length = inner<P, D>(step, step);
  const P variance = trace_of<P, D>(of_h);
  const P change = normal.third_square * length;
  const P enough = kEnough * lesser(normal.chi_squared, P{} + S(1)) + normal.noise;
  // The smallest variance, which may have drowned in the rounding of the others.
  P smallest = covariance[0];
  unroll<D - 1>([&](auto k) __attribute__((always_inline)) {
    smallest = lesser(covariance[lower_index<D>(k + 1, k + 1)], smallest);
  });
  const auto settled =
      (smallest > P{}) & both_well &
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
