// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The few products and the one factorisation that the solvers need, with sums in a fixed order so
/// that every processor computes the same bits (Eigen's vectorised reductions reorder theirs).

#include <cmath>
#include <limits>

#include "uwbpos/core/types.hpp"

namespace uwbpos {

/// Inner product, summed from the first component to the last. O(D), no allocation.
template <class S, int D>
[[nodiscard]] S dot(const Vec<S, D>& a, const Vec<S, D>& b) {
  S sum = a[0] * b[0];
  for (int i = 1; i < D; ++i) sum += a[i] * b[i];
  return sum;
}

/// Squared Euclidean length, summed in order. O(D), no allocation.
template <class S, int D>
[[nodiscard]] S squared_norm(const Vec<S, D>& a) {
  return dot(a, a);
}

/// Euclidean length: the root of `squared_norm`, not hypot, whose last bit differs by library.
template <class S, int D>
[[nodiscard]] S norm(const Vec<S, D>& a) {
  return std::sqrt(squared_norm(a));
}

/// True when every component is finite.
template <class S, int Rows, int Cols>
[[nodiscard]] bool all_finite(const Eigen::Matrix<S, Rows, Cols>& m) {
#pragma GCC unroll 4
  for (int j = 0; j < Cols; ++j) {
#pragma GCC unroll 4
    for (int i = 0; i < Rows; ++i) {
      if (!std::isfinite(m(i, j))) return false;
    }
  }
  return true;
}

/// Adds `weight` · g gᵀ to the lower triangle of `sum`. O(D²), no allocation.
template <class S, int D>
void add_outer(Mat<S, D>& sum, const Vec<S, D>& g, S weight) {
#pragma GCC unroll 4
  for (int j = 0; j < D; ++j) {
    const S scaled = weight * g[j];
#pragma GCC unroll 4
    for (int i = j; i < D; ++i) sum(i, j) += scaled * g[i];
  }
}

/// The symmetric matrix that has this lower triangle.
template <class S, int D>
[[nodiscard]] Mat<S, D> symmetric_from_lower(Mat<S, D> a) {
  for (int j = 0; j < D; ++j) {
    for (int i = j + 1; i < D; ++i) a(j, i) = a(i, j);
  }
  return a;
}

/// A · B, summed in order. No allocation.
template <class S, int M, int K, int N>
[[nodiscard]] Eigen::Matrix<S, M, N> product(const Eigen::Matrix<S, M, K>& a,
                                             const Eigen::Matrix<S, K, N>& b) {
  Eigen::Matrix<S, M, N> result;
  for (int j = 0; j < N; ++j) {
    for (int i = 0; i < M; ++i) {
      S sum = a(i, 0) * b(0, j);
      for (int k = 1; k < K; ++k) sum += a(i, k) * b(k, j);
      result(i, j) = sum;
    }
  }
  return result;
}

/// Aᵀ, entry by entry: Eigen's own makes g++ 12 warn of aliases that there are none.
template <class S, int M, int N>
[[nodiscard]] Eigen::Matrix<S, N, M> transposed(const Eigen::Matrix<S, M, N>& a) {
  Eigen::Matrix<S, N, M> result;
  for (int j = 0; j < N; ++j) {
    for (int i = 0; i < M; ++i) result(j, i) = a(i, j);
  }
  return result;
}

/// A · P · Aᵀ of a symmetric P, exactly symmetric, summed in order. No allocation.
template <class S, int M, int K>
[[nodiscard]] Mat<S, M> congruence(const Eigen::Matrix<S, M, K>& a, const Mat<S, K>& p) {
  const Eigen::Matrix<S, M, K> ap = product(a, p);
  Mat<S, M> result;
  for (int j = 0; j < M; ++j) {
    for (int i = j; i < M; ++i) {
      S sum = ap(i, 0) * a(j, 0);
      for (int k = 1; k < K; ++k) sum += ap(i, k) * a(j, k);
      result(i, j) = result(j, i) = sum;
    }
  }
  return result;
}

/// A = L·diag(d)·Lᵀ of a symmetric positive definite D × D matrix, of which only the lower triangle
/// is read. No pivoting, no square roots, no allocation; D³/6 multiplications.
template <class S, int D>
class Ldlt {
 public:
  /// Factors `a`; ask `positive_definite` before anything else.
  explicit Ldlt(const Mat<S, D>& a) {
    // A pivot that has lost all its digits to the subtraction is rounding noise, and digits that
    // an earlier pivot has lost are missing from the later ones too.
    S lost = S(8 * D) * std::numeric_limits<S>::epsilon();
#pragma GCC unroll 4
    for (int j = 0; j < D; ++j) {
      S pivot = a(j, j);
#pragma GCC unroll 4
      for (int k = 0; k < j; ++k) pivot -= l_(j, k) * l_(j, k) * d_[k];
      positive_definite_ = positive_definite_ && pivot > lost * a(j, j);  // NaN fails too
      if (j + 1 < D && pivot < a(j, j)) lost *= a(j, j) / pivot;
      d_[j] = pivot;
#pragma GCC unroll 4
      for (int i = j + 1; i < D; ++i) {
        S sum = a(i, j);
#pragma GCC unroll 4
        for (int k = 0; k < j; ++k) sum -= l_(i, k) * l_(j, k) * d_[k];
        l_(i, j) = sum / pivot;
      }
    }
  }

  /// False when A is singular to working precision, indefinite or not finite; then nothing else of
  /// this object may be used.
  [[nodiscard]] bool positive_definite() const { return positive_definite_; }

  /// A⁻¹ b. O(D²).
  [[nodiscard]] Vec<S, D> solve(Vec<S, D> b) const {
#pragma GCC unroll 4
    for (int i = 1; i < D; ++i) {
#pragma GCC unroll 4
      for (int k = 0; k < i; ++k) b[i] -= l_(i, k) * b[k];
    }
#pragma GCC unroll 4
    for (int i = 0; i < D; ++i) b[i] /= d_[i];
#pragma GCC unroll 4
    for (int i = D - 2; i >= 0; --i) {
#pragma GCC unroll 4
      for (int k = i + 1; k < D; ++k) b[i] -= l_(k, i) * b[k];
    }
    return b;
  }

  /// A⁻¹, exactly symmetric. O(D³).
  [[nodiscard]] Mat<S, D> inverse() const {
    Mat<S, D> result;
    for (int j = 0; j < D; ++j) {
      Vec<S, D> unit = Vec<S, D>::Zero();
      unit[j] = S(1);
      const Vec<S, D> column = solve(unit);
      for (int i = j; i < D; ++i) result(i, j) = result(j, i) = column[i];
    }
    return result;
  }

 private:
  Mat<S, D> l_;  // strictly lower part only
  Vec<S, D> d_;
  bool positive_definite_ = true;
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
