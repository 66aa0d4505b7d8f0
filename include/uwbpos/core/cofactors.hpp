// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Symmetric systems of two or three unknowns by cofactors: one division, no pivot, no branch, and
/// few steps that wait for one another. For scalars and for lanes (core/lanes.hpp) alike; lower
/// triangles are stored column by column, as `lower_index` has it. Elimination (core/linalg.hpp)
/// keeps more digits where a matrix is nearly singular: look at `is_well_conditioned` first.

#include <limits>

#include "uwbpos/core/lanes.hpp"

namespace uwbpos {

/// A symmetric D × D matrix as its lower triangle.
template <class P, int D>
using Lower = Numbers<P, D*(D + 1) / 2>;

/// xᵀ y. O(D).
template <class P, int D>
[[nodiscard, gnu::always_inline]] inline P inner(const Numbers<P, D>& x, const Numbers<P, D>& y) {
  P sum = x[0] * y[0];
  unroll<D - 1>([&](auto i) __attribute__((always_inline)) { sum += x[i + 1] * y[i + 1]; });
  return sum;
}

/// A x. O(D²).
template <class P, int D>
[[nodiscard, gnu::always_inline]] inline Numbers<P, D> times(const Lower<P, D>& a,
                                                             const Numbers<P, D>& x) {
  Numbers<P, D> y;
  unroll<D>([&](auto i) __attribute__((always_inline)) {
    Numbers<P, D> row;
    unroll<D>([&](auto j) __attribute__((always_inline)) { row[j] = a[lower_of<D>(i, j)]; });
    y[i] = inner<P, D>(row, x);
  });
  return y;
}

/// tr A.
template <class P, int D>
[[nodiscard, gnu::always_inline]] inline P trace_of(const Lower<P, D>& a) {
  P sum = a[0];
  unroll<D - 1>([&](auto i)
                    __attribute__((always_inline)) { sum += a[lower_index<D>(i + 1, i + 1)]; });
  return sum;
}

/// det A and the cofactors: A⁻¹ = `adjugate` / `determinant`.
template <class P, int D>
struct Cofactors {
  Lower<P, D> adjugate;  ///< transposed cofactors
  P determinant;         ///< zero where A is singular
};

/// Those of A, D = 2 or 3.
template <class P, int D>
[[nodiscard, gnu::always_inline]] inline Cofactors<P, D> cofactors(const Lower<P, D>& a) {
  if constexpr (D == 2) {
    return {{{a[2], -a[1], a[0]}}, a[0] * a[2] - a[1] * a[1]};
  } else {
    static_assert(D == 3);
    const Lower<P, D> c{{a[3] * a[5] - a[4] * a[4], a[2] * a[4] - a[1] * a[5],
                         a[1] * a[4] - a[2] * a[3], a[0] * a[5] - a[2] * a[2],
                         a[1] * a[2] - a[0] * a[4], a[0] * a[3] - a[1] * a[1]}};
    return {c, a[0] * c[0] + a[1] * c[1] + a[2] * c[2]};
  }
}

/// The product of the diagonal of A, which det A never exceeds.
template <class P, int D>
[[nodiscard, gnu::always_inline]] inline P product_of_diagonal(const Lower<P, D>& a) {
  const P ends = a[0] * a[lower_index<D>(D - 1, D - 1)];
  if constexpr (D == 3) {
    return ends * a[3];
  } else {
    return ends;
  }
}

/// True, in each lane, where A is positive definite and its cofactors keep all but ten bits or so:
/// det A is more than a little of the product of the diagonal.
template <class S, class P, int D>
[[nodiscard, gnu::always_inline]] inline auto is_well_conditioned(const Lower<P, D>& a,
                                                                  const Cofactors<P, D>& of_a) {
  constexpr S kLittle = S(1024) * std::numeric_limits<S>::epsilon();
  const P product = product_of_diagonal<P, D>(a);
  // Leading minors: a positive product has none or two negative factors.
  return (of_a.determinant > kLittle * product) & (a[0] > P{}) &
         (of_a.adjugate[lower_index<D>(D - 1, D - 1)] > P{}) & (product > P{});
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
