// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The few products and the one factorisation that the solvers need, with sums in a fixed order so
/// that every processor computes the same bits (Eigen's vectorised reductions reorder theirs).

#include <algorithm>
#include <cmath>
#include <limits>

#include "uwbpos/core/types.hpp"
#include "uwbpos/core/unroll.hpp"

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

/// Zero where every component is finite, else not a number: sums of such need one comparison.
template <class S, int Rows, int Cols>
[[nodiscard]] S zero_if_finite(const Eigen::Matrix<S, Rows, Cols>& m) {
  S zero = S(0);
#pragma GCC unroll 9
  for (int k = 0; k < Rows * Cols; ++k) zero += S(0) * m.data()[k];
  return zero;
}

/// True when every component is finite.
template <class S, int Rows, int Cols>
[[nodiscard]] bool all_finite(const Eigen::Matrix<S, Rows, Cols>& m) {
  return zero_if_finite(m) == S(0);
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
/// is read. No pivoting, no square roots, no allocation; D³/6 multiplications, D divisions.
template <class S, int D>
class Ldlt {
 public:
  /// Nothing factored yet.
  Ldlt() = default;
  /// Factors `a`; ask `positive_definite` before anything else.
  [[gnu::always_inline]] inline explicit Ldlt(const Mat<S, D>& a) {
    factor([&](int i, int j) __attribute__((always_inline)) { return S(a(i, j)); });
  }
  /// Factors the matrix whose entry in row i ≥ j is `entry(i, j)`.
  template <class Entry>
    requires std::is_same_v<std::invoke_result_t<Entry, int, int>, S>
  [[gnu::always_inline]] inline explicit Ldlt(const Entry& entry) {
    factor(entry);
  }

  /// False when A is singular to working precision, indefinite or not finite; then nothing else of
  /// this object may be used.
  [[nodiscard]] bool positive_definite() const { return positive_definite_; }

  /// A⁻¹ b. O(D²).
  [[nodiscard, gnu::always_inline]] inline Vec<S, D> solve(const Vec<S, D>& b) const {
    S x[D];
    each<D>([&](auto i) __attribute__((always_inline)) {
      x[i] = b[int(i)];
      each<D>([&](auto k) __attribute__((always_inline)) {
        if (k < i) x[i] -= l_[i][k] * x[k];
      });
    });
    Vec<S, D> result;
    each<D>([&](auto back) __attribute__((always_inline)) {
      const auto i = from_end<D>(back);
      x[i] *= inverse_[i];
      each<D>([&](auto k) __attribute__((always_inline)) {
        if (k > i) x[i] -= l_[k][i] * x[k];
      });
      result[int(i)] = x[i];
    });
    return result;
  }

  /// A⁻¹, exactly symmetric. O(D³).
  [[nodiscard, gnu::always_inline]] inline Mat<S, D> inverse() const {
    // Column by column from the last: A⁻¹ L = L⁻ᵀ diag(d)⁻¹, of which the upper triangle is zero
    // but for its diagonal.
    S x[D][D];
    each<D>([&](auto back) __attribute__((always_inline)) {
      const auto j = from_end<D>(back);
      each<D>([&](auto up) __attribute__((always_inline)) {
        const auto i = from_end<D>(up);
        if (i < j) return;
        S sum = i == j ? inverse_[j] : S(0);
        each<D>([&](auto k) __attribute__((always_inline)) {
          if (k > j) sum -= x[i][k] * l_[k][j];
        });
        x[i][j] = sum;
        x[j][i] = sum;
      });
    });
    Mat<S, D> result;
    for (int j = 0; j < D; ++j) {
      for (int i = 0; i < D; ++i) result(i, j) = x[i][j];
    }
    return result;
  }

 private:
  template <class Entry>
  [[gnu::always_inline]] inline void factor(const Entry& entry) {
    // A pivot that has lost all its digits to the subtraction is rounding noise, and digits that
    // an earlier pivot has lost are missing from the later ones too.
    S lost = S(8 * D) * std::numeric_limits<S>::epsilon();
    each<D>([&](auto j) __attribute__((always_inline)) {
      S scaled[D];  // row j of L·diag(d)
      const S diagonal = entry(int(j), int(j));
      S pivot = diagonal;
      each<D>([&](auto k) __attribute__((always_inline)) {
        if (k < j) {
          scaled[k] = l_[j][k] * d_[k];
          pivot -= l_[j][k] * scaled[k];
        }
      });
      positive_definite_ = positive_definite_ && pivot > lost * diagonal;  // NaN fails too
      d_[j] = pivot;
      inverse_[j] = S(1) / pivot;
      lost *= std::max(S(1), diagonal * inverse_[j]);
      each<D>([&](auto i) __attribute__((always_inline)) {
        if (i > j) {
          S sum = entry(int(i), int(j));
          each<D>([&](auto k) __attribute__((always_inline)) {
            if (k < j) sum -= l_[i][k] * scaled[k];
          });
          l_[i][j] = sum * inverse_[j];
        }
      });
    });
  }

  S l_[D][D];     // strictly lower part only
  S d_[D];        // the pivots
  S inverse_[D];  // and one over each
  bool positive_definite_ = true;
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
