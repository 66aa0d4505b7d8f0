// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What makes a matrix a covariance, for those that come in and those that go out.

#include <algorithm>
#include <cmath>
#include <limits>

#include "uwbpos/core/linalg.hpp"

namespace uwbpos {

/// Raises variances of a symmetric matrix without correlations above one until no combination of
/// the errors has a negative one, as differences of large numbers may leave. In the correlations'
/// L D Lᵀ a pivot too small for what it shares with a later one c, c² > d₁ d₂, becomes c²/d₂, or c
/// if that is less. What needs nothing stays as it is, but for the last digits of singular ones.
/// O(N³), as much stack as `p` takes, no allocation.
template <class S, int N>
void raise_to_semidefinite(Mat<S, N>& p) {
  Vec<S, N> scale;
  for (int i = 0; i < N; ++i) scale[i] = p(i, i) > S(0) ? S(1) / std::sqrt(p(i, i)) : S(0);
  Mat<S, N> left;  // to be factored; lower triangle
  for (int j = 0; j < N; ++j) {
    left(j, j) = scale[j] > S(0) ? S(1) : S(0);
    for (int i = j + 1; i < N; ++i) left(i, j) = p(i, j) * scale[i] * scale[j];
  }
  for (int j = 0; j < N; ++j) {
    S pivot = std::max(left(j, j), S(0));
    for (int i = j + 1; i < N; ++i) {
      const S shared = std::abs(left(i, j));
      const S other = left(i, i);
      const S square = shared * shared;
      if (left(j, j) > S(0) && square <= left(j, j) * other) continue;
      pivot = std::max(pivot, shared < other ? square / other : shared);
    }
    if (pivot > left(j, j)) {
      p(j, j) = std::min(p(j, j) * (S(1) + (pivot - left(j, j))), std::numeric_limits<S>::max());
    }
    if (!(pivot > S(0))) continue;
    for (int k = j + 1; k < N; ++k) {
      const S part = left(k, j) / pivot;
      for (int i = k; i < N; ++i) left(i, k) -= left(i, j) * part;
    }
  }
}

/// Whether each diagonal entry is a variance, the matrix symmetric, no correlation above one and no
/// combination of errors left with a negative variance (rounding apart): what a covariance
/// satisfies and a typing mistake mostly does not. Zeros pass. O(N³), no allocation.
template <class S, int N>
[[nodiscard]] bool looks_like_covariance(const Mat<S, N>& p) {
  Vec<S, N> sigma;
  for (int i = 0; i < N; ++i) {
    if (!(p(i, i) >= S(0))) return false;
    sigma[i] = std::sqrt(p(i, i));
    for (int j = 0; j < i; ++j) {
      const S bound = sigma[i] * sigma[j];
      if (!(std::abs(p(i, j)) <= S(1.001) * bound)) return false;
      if (!(std::abs(p(i, j) - p(j, i)) <= S(1e-3) * bound)) return false;
    }
  }
  if constexpr (N > 2) {
    Mat<S, N> raised = p;
    raise_to_semidefinite<S, N>(raised);
    for (int i = 0; i < N; ++i) {
      if (!(raised(i, i) <= S(1.05) * p(i, i))) return false;
    }
  }
  return true;
}

/// A covariance of two errors, brought within what their standard deviations allow.
template <class S>
[[nodiscard]] S bounded(S covariance, S sigma_a, S sigma_b) {
  const S bound = sigma_a * sigma_b;
  return std::max(-bound, std::min(covariance, bound));
}

/// Takes from a propagated covariance what rounding may leave of singular ones: variances below
/// zero, correlations above one or that contradict each other. The lower triangle is read. O(N³),
/// no allocation.
template <class S, int N>
void remove_rounding(Mat<S, N>& p) {
  Vec<S, N> sigma;
  for (int i = 0; i < N; ++i) {
    p(i, i) = std::max(p(i, i), S(0));
    sigma[i] = std::sqrt(p(i, i));
    for (int j = 0; j < i; ++j) p(i, j) = p(j, i) = bounded(p(i, j), sigma[i], sigma[j]);
  }
  if constexpr (N > 2) raise_to_semidefinite<S, N>(p);
}

/// The same of a copy.
template <class S, int N>
[[nodiscard]] Mat<S, N> without_rounding(Mat<S, N> p) {
  remove_rounding<S, N>(p);
  return p;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
