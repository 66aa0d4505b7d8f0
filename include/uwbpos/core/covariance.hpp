// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What makes a matrix a covariance, for those that come in and those that go out.

#include <algorithm>
#include <cmath>

#include "uwbpos/core/linalg.hpp"

namespace uwbpos {

/// Whether each diagonal entry is a variance, the matrix symmetric and no correlation above one
/// (rounding apart): what a covariance satisfies and a typing mistake mostly does not. Zeros pass.
template <class S, int N>
[[nodiscard]] bool looks_like_covariance(const Mat<S, N>& p) {
  for (int j = 0; j < N; ++j) {
    if (!(p(j, j) >= S(0))) return false;
    for (int i = j + 1; i < N; ++i) {
      const S bound = std::sqrt(p(i, i)) * std::sqrt(p(j, j));
      if (!(std::abs(p(i, j)) <= S(1.001) * bound)) return false;
      if (!(std::abs(p(i, j) - p(j, i)) <= S(1e-3) * bound)) return false;
    }
  }
  return true;
}

/// A propagated covariance without what rounding may leave of singular ones: variances below zero,
/// correlations above one. O(1), no allocation.
template <class S, int N>
[[nodiscard]] Mat<S, N> without_rounding(Mat<S, N> p) {
  for (int i = 0; i < N; ++i) p(i, i) = std::max(p(i, i), S(0));
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < i; ++j) {
      const S bound = std::sqrt(p(i, i)) * std::sqrt(p(j, j));
      p(i, j) = p(j, i) = std::clamp(p(i, j), -bound, bound);
    }
  }
  return p;
}

}  // namespace uwbpos
