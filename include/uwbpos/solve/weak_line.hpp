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
  S foot_spread;        ///< fᵀ A⁺ f, with A⁺ the inverse of the strong block
};

/// Solves A x = b for (1), A symmetric, positive semidefinite, lower triangle read. O(N³), no
/// allocation. Error::DegenerateGeometry when A lacks more than one rank.
template <class S, int N>
[[nodiscard]] Result<WeakLine<S, N>> weak_line(const Mat<S, N>& normal, Vec<S, N> b) {
  constexpr S kLost = S(16 * N) * std::numeric_limits<S>::epsilon();
  constexpr int kLast = N - 1;
  Mat<S, N> a = symmetric_from_lower(normal);
  int order[N];
  for (int i = 0; i < N; ++i) order[i] = i;

  S strongest = S(0);
  S last_diagonal = a(kLast, kLast);
  for (int k = 0; k < kLast; ++k) {
    int best = k;
    for (int i = k + 1; i < N; ++i) best = a(i, i) > a(best, best) ? i : best;
    for (int i = 0; i < N; ++i) std::swap(a(k, i), a(best, i));
    for (int i = 0; i < N; ++i) std::swap(a(i, k), a(i, best));
    std::swap(b[k], b[best]);
    std::swap(order[k], order[best]);
    if (k == 0) strongest = a(0, 0);
    if (!(a(k, k) > kLost * strongest) || !(strongest > S(0))) {
      return std::unexpected(Error::DegenerateGeometry);
    }
    if (k == kLast - 1) last_diagonal = a(kLast, kLast);
    for (int i = k + 1; i < N; ++i) {
      const S factor = a(i, k) / a(k, k);
      for (int j = k + 1; j < N; ++j) a(i, j) -= factor * a(k, j);
      b[i] -= factor * b[k];
    }
  }

  // Back substitution twice: with the last coordinate 0 (base), and its derivative (slope).
  Vec<S, N> base;
  Vec<S, N> slope;
  base[kLast] = S(0);
  slope[kLast] = S(1);
  for (int k = kLast - 1; k >= 0; --k) {
    S at_zero = b[k];
    S derivative = S(0);
    for (int j = k + 1; j < N; ++j) {
      at_zero -= a(k, j) * base[j];
      derivative -= a(k, j) * slope[j];
    }
    base[k] = at_zero / a(k, k);
    slope[k] = derivative / a(k, k);
  }
  const S length = norm(slope);
  const Vec<S, N> axis = slope / length;
  const S along = dot(base, axis);
  const Vec<S, N> foot = base - along * axis;

  WeakLine<S, N> line;
  line.foot_spread = S(0);
  Vec<S, N> z = foot;
  for (int k = 0; k < kLast; ++k) {
    line.foot_spread += z[k] * z[k] / a(k, k);
    for (int i = k + 1; i < kLast; ++i) z[i] -= a(k, i) / a(k, k) * z[k];
  }
  for (int i = 0; i < N; ++i) {
    line.foot[order[i]] = foot[i];
    line.direction[order[i]] = axis[i];
  }
  // A lacking rank keeps only rounding noise of the diagonal that the elimination consumed.
  const S pivot = a(kLast, kLast);
  const bool flat = !(pivot > kLost * last_diagonal) || !(pivot > kLost * kLost * strongest);
  line.linear = flat ? S(0) : along + b[kLast] / pivot * length;
  line.information = flat ? S(0) : pivot / (length * length);
  return line;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
