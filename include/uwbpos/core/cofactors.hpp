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

/// The column of a covariance, or of an adjugate, whose diagonal entry is the greatest: the
/// direction that the inverse holds worst, but for its length.
template <class P, int D>
struct WeakColumn {
  Numbers<P, D> column = {};  ///< the column
  P variance = P{};           ///< its entry on the diagonal
};

/// That of a matrix whose diagonal is positive; zero where it is not. O(D²).
template <class P, int D>
[[nodiscard, gnu::always_inline]] inline WeakColumn<P, D> weak_column(const Lower<P, D>& a) {
  WeakColumn<P, D> weak;
  unroll<D>([&](auto j) __attribute__((always_inline)) {
    const P entry = a[lower_index<D>(j, j)];
    const auto more = entry > weak.variance;
    weak.variance = more ? entry : weak.variance;
    unroll<D>([&](auto i) __attribute__((always_inline)) {
      weak.column[i] = more ? a[lower_of<D>(i, j)] : weak.column[i];
    });
  });
  return weak;
}

/// True, in each lane, where A is positive definite and rounding leaves its determinant ten bits or
/// more: entries of A that came of subtraction carry errors of the terms' size, on the diagonal
/// that of `terms`, and det A changes with a diagonal entry by its cofactor. It exceeds
/// ε times the product of the diagonal, by which its own products are rounded, by six bits.
template <class S, class P, int D>
[[nodiscard, gnu::always_inline]] inline auto is_well_conditioned(const Lower<P, D>& a,
                                                                  const Cofactors<P, D>& of_a,
                                                                  const Numbers<P, D>& terms,
                                                                  S bits = S(1024)) {
  const S little = bits * std::numeric_limits<S>::epsilon();
  Numbers<P, D> diagonal;
  unroll<D>([&](auto k) __attribute__((always_inline)) {
    diagonal[k] = of_a.adjugate[lower_index<D>(k, k)];
  });
  constexpr int kSecond = lower_index<D>(1, 1);
  P change = inner<P, D>(terms, diagonal);
  // No product of three is beyond that of the diagonal.
  if constexpr (D == 3) change += (S(1) / S(16)) * (a[0] * a[kSecond] * a[lower_index<D>(2, 2)]);
  // All leading minors: noise of a rank that is missing may look like a determinant.
  const auto two = (a[0] > little * terms[0]) & (of_a.determinant > little * change);
  if constexpr (D == 2) {
    return two & (of_a.determinant > P{});
  } else {
    return two & (of_a.determinant > P{}) &
           (diagonal[D - 1] > little * (terms[0] * a[kSecond] + terms[1] * a[0]));
  }
}

/// The same of a matrix whose entries are sums that nothing was subtracted from.
template <class S, class P, int D>
[[nodiscard, gnu::always_inline]] inline auto is_well_conditioned(const Lower<P, D>& a,
                                                                  const Cofactors<P, D>& of_a) {
  Numbers<P, D> terms;
  unroll<D>([&](auto k) __attribute__((always_inline)) { terms[k] = a[lower_index<D>(k, k)]; });
  return is_well_conditioned<S, P, D>(a, of_a, terms);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
