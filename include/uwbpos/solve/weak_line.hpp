// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a linear system that may be short of one rank does determine: a line. Elimination of
/// A x = b with diagonal pivots solves for all of x but along the direction v that A holds worst:
/// \f[ x = f + \tau v, \qquad f \perp v, \qquad |v| = 1. \qquad (1) \f]
/// What the last pivot says about τ, nothing when A lacks a rank, comes beside it.

#include <limits>
#include <utility>

#include "uwbpos/core/linalg.hpp"
#include "uwbpos/core/result.hpp"

namespace uwbpos {

/// xᵀ η y with η = diag(1, …, 1, −1): the form in which squared pseudoranges are linear. O(N).
template <class S, int N>
[[nodiscard]] S space_time_product(const Vec<S, N>& x, const Vec<S, N>& y) {
  S sum = x[0] * y[0];
  for (int k = 1; k < N - 1; ++k) sum += x[k] * y[k];
  return sum - x[N - 1] * y[N - 1];
}

/// The line (1).
template <class S, int N>
struct WeakLine {
  Vec<S, N> foot;       ///< f
  Vec<S, N> direction;  ///< v
  S linear;             ///< τ as the last pivot has it; 0 when it says nothing
  S information;        ///< A's curvature along v, the others free; 0 when A lacks this rank
  S rough;              ///< τ as the last pivot has it while it is more than noise of the last step
                        ///< alone: a guess, not a number where it is not
  S foot_spread;        ///< fᵀ A⁺ f, with A⁺ the inverse of the strong block
};

/// Solves A x = b for (1), A symmetric, positive semidefinite, lower triangle read. O(N³), no
/// allocation. Error::DegenerateGeometry when A lacks more than one rank.
template <class S, int N>
[[nodiscard]] Result<WeakLine<S, N>> weak_line(const Mat<S, N>& normal, Vec<S, N> b) {
  constexpr S kLost = S(16 * N) * std::numeric_limits<S>::epsilon();
  constexpr int kLast = N - 1;
  S a[N][N];  // the lower triangle, then the factors below the pivots
  int order[N];
#pragma GCC unroll 4
  for (int i = 0; i < N; ++i) {
    order[i] = i;
#pragma GCC unroll 4
    for (int j = 0; j <= i; ++j) a[i][j] = normal(i, j);
  }

  S inverse[N];  // of the pivots
  S strongest = S(0);
  S last_diagonal = a[kLast][kLast];
#pragma GCC unroll 4
  for (int k = 0; k < kLast; ++k) {
    int best = k;
#pragma GCC unroll 4
    for (int i = k + 1; i < N; ++i) best = a[i][i] > a[best][best] ? i : best;
    if (best != k) {
      std::swap(a[k][k], a[best][best]);
      for (int j = 0; j < k; ++j) std::swap(a[k][j], a[best][j]);
      for (int j = k + 1; j < best; ++j) std::swap(a[j][k], a[best][j]);
      for (int i = best + 1; i < N; ++i) std::swap(a[i][k], a[i][best]);
      std::swap(b[k], b[best]);
      std::swap(order[k], order[best]);
    }
    if (k == 0) strongest = a[0][0];
    if (!(a[k][k] > kLost * strongest) || !(strongest > S(0))) {
      return std::unexpected(Error::DegenerateGeometry);
    }
    if (k == kLast - 1) last_diagonal = a[kLast][kLast];
    inverse[k] = S(1) / a[k][k];
#pragma GCC unroll 4
    for (int i = k + 1; i < N; ++i) {
      const S factor = a[i][k] * inverse[k];
#pragma GCC unroll 4
      for (int j = k + 1; j <= i; ++j) a[i][j] -= factor * a[j][k];
      b[i] -= factor * b[k];
    }
    // Now what is below the pivot may become factors: the rows above are done with.
#pragma GCC unroll 4
    for (int i = k + 1; i < N; ++i) a[i][k] *= inverse[k];
  }

  // Back substitution twice: with the last coordinate 0 (base), and its derivative (slope).
  Vec<S, N> base;
  Vec<S, N> slope;
  base[kLast] = S(0);
  slope[kLast] = S(1);
#pragma GCC unroll 4
  for (int k = kLast - 1; k >= 0; --k) {
    base[k] = b[k] * inverse[k];
    slope[k] = S(0);
#pragma GCC unroll 4
    for (int j = k + 1; j < N; ++j) {
      base[k] -= a[j][k] * base[j];
      slope[k] -= a[j][k] * slope[j];
    }
  }
  const S length = norm(slope);
  const Vec<S, N> axis = slope * (S(1) / length);
  const S along = dot(base, axis);
  const Vec<S, N> foot = base - along * axis;

  WeakLine<S, N> line;
  // fᵀ A⁺ f = |L⁻¹ f|² over the pivots.
  line.foot_spread = S(0);
  Vec<S, N> z = foot;
#pragma GCC unroll 4
  for (int k = 0; k < kLast; ++k) {
    line.foot_spread += z[k] * z[k] * inverse[k];
#pragma GCC unroll 4
    for (int i = k + 1; i < kLast; ++i) z[i] -= a[i][k] * z[k];
  }
  for (int i = 0; i < N; ++i) {
    line.foot[order[i]] = foot[i];
    line.direction[order[i]] = axis[i];
  }
  // A lacking rank keeps only rounding noise: of each diagonal entry, as far as it weighs along v.
  const S pivot = a[kLast][kLast];
  S consumed = S(0);
  for (int k = 0; k < N; ++k) consumed += slope[k] * slope[k] * normal(order[k], order[k]);
  const bool flat = !(pivot > kLost * consumed) || !(pivot > kLost * kLost * strongest);
  const S tau = along + b[kLast] / pivot * length;
  line.linear = flat ? S(0) : tau;
  line.rough = pivot > kLost * last_diagonal ? tau : std::numeric_limits<S>::quiet_NaN();
  line.information = flat ? S(0) : pivot / (length * length);
  return line;
}

/// Whether A lacks a rank, which a factor does not see where what sets points apart is the rounding
/// of their places. O(N³), no allocation.
template <class S, int N>
[[nodiscard]] bool lacks_rank(const Mat<S, N>& normal) {
  const Result<WeakLine<S, N>> line = weak_line<S, N>(normal, Vec<S, N>::Zero());
  return !line || !(line->information > S(0));
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
