// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The covariance of a filter kept as \f$ P = L\,\mathrm{diag}(d)\,L^T \f$, L lower triangular with
/// unit diagonal (Bierman 1977; Thornton 1976; mirrored, so that the states a measurement uses come
/// first).
///
/// **Measurement.** \f$ z = h^T x + v \f$ with var v = r. With \f$ f = L^T h,\ g = d \circ f \f$:
///   (1) \f$ s = r + \sum f_j g_j,\quad K = L g / s \f$,
/// and, from the last state that h uses down to the first, with \f$ \alpha_M = r \f$ and b = 0,
///   (2) \f$ \alpha_j = \alpha_{j+1} + f_j g_j,\quad d_j \leftarrow d_j\,\alpha_{j+1}/\alpha_j \f$,
///   (3) \f$ L_{ij} \leftarrow L_{ij} - b_i f_j/\alpha_{j+1},\quad b_i \leftarrow b_i + L_{ij}
///       g_j \f$ for i > j with the old L, \f$ b_j = g_j \f$; in the end \f$ K = b/\alpha_0 \f$.
/// If h is zero beyond its first M entries, so is f: columns M … N−1 of L and d do not change, and
/// (3) costs M·N, not N².
///
/// **Time.** \f$ P \leftarrow F P F^T + G\,\mathrm{diag}(q)\,G^T \f$ by (4) and (5) of
/// filter/factored_prediction.hpp.
///
/// **Why it is sound in float.** P is symmetric because only L and d exist. It is positive because
/// d is: (2) multiplies it by a ratio of two sums of positive terms, the smaller over the larger,
/// and (4) and (5) make it a sum of squares; none ever subtracts. Rounding therefore changes P as
/// relatively small changes of the data would, whatever the number of updates; the textbook's
/// P − K s Kᵀ loses that as soon as P's condition nears 1/ε = 8·10⁶. Over 10⁷ float steps and
/// updates of nine states, standard deviations stay within 2e-6 of a double filter's and states
/// within 5e-4 of one (bench/bench_kalman.cpp). On a Cortex-M4F an update of six states by a
/// position takes 363 instructions.

#include <cmath>

#include "uwbpos/core/linalg.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/filter/factored_prediction.hpp"

namespace uwbpos {

/// A measurement's row seen through the covariance: f, g and hᵀPh of (1).
template <class S, int M>
struct ProjectedRow {
  Vec<S, M> f;        ///< Lᵀh
  Vec<S, M> g;        ///< d ∘ f
  S variance = S(0);  ///< hᵀPh
};

/// P = L·diag(d)·Lᵀ of N states. Invariant: every d is positive or zero; all that is done to it
/// keeps that. (N² + N)·sizeof(S) bytes, no allocation.
template <class S, int N>
class FactoredCovariance {
 public:
  /// Everything known exactly.
  FactoredCovariance() : l_{Mat<S, N>::Identity()}, d_{Vec<S, N>::Zero()} {}

  /// Independent states of these variances, which must not be negative.
  explicit FactoredCovariance(const Vec<S, N>& variances)
      : l_{Mat<S, N>::Identity()}, d_{variances} {}

  /// P of a positive definite matrix, whose lower triangle is read. O(N³).
  /// Errors: NotFinite; InvalidCovariance, not positive definite to working precision.
  [[nodiscard]] static Result<FactoredCovariance> from_matrix(const Mat<S, N>& p) {
    for (int j = 0; j < N; ++j) {
      for (int i = j; i < N; ++i) {
        if (!std::isfinite(p(i, j))) return std::unexpected(Error::NotFinite);
      }
    }
    if (!Ldlt<S, N>{p}.positive_definite()) return std::unexpected(Error::InvalidCovariance);
    FactoredCovariance result;
    for (int j = 0; j < N; ++j) {
      S pivot = p(j, j);
      for (int k = 0; k < j; ++k) pivot -= result.l_(j, k) * result.l_(j, k) * result.d_[k];
      result.d_[j] = pivot;
      for (int i = j + 1; i < N; ++i) {
        S sum = p(i, j);
        for (int k = 0; k < j; ++k) sum -= result.l_(i, k) * result.l_(j, k) * result.d_[k];
        result.l_(i, j) = sum / pivot;
      }
    }
    return result;
  }

  /// Entry (i, j) of P; symmetric to the bit. O(N).
  [[nodiscard]] S operator()(int i, int j) const {
    const int last = i < j ? i : j;
    S sum = S(0);
    for (int k = 0; k <= last; ++k) sum += (l_(i, k) * l_(j, k)) * d_[k];
    return sum;
  }

  /// The block of P of the first M states. O(M³/3).
  template <int M = N>
  [[nodiscard]] Mat<S, M> matrix() const {
    Mat<S, M> p;
    for (int j = 0; j < M; ++j) {
      for (int i = j; i < M; ++i) p(i, j) = p(j, i) = (*this)(i, j);
    }
    return p;
  }

  /// f, g and hᵀPh of a row h of which only the first M entries are not zero. O(M²).
  template <int M>
  [[nodiscard]] ProjectedRow<S, M> project(const Vec<S, M>& row) const {
    static_assert(M <= N, "a row has no more entries than there are states");
    ProjectedRow<S, M> projected;
    if constexpr (M > kDense) {
      projected.f = Vec<S, M>::Zero();
      for (int i = 0; i < M; ++i) {
        const S h = row[i];
        if (h == S(0)) continue;
        for (int j = 0; j < i; ++j) projected.f[j] += l_(i, j) * h;
        projected.f[i] += h;
      }
    } else {
      for (int j = 0; j < M; ++j) {
        S sum = row[j];
        for (int i = j + 1; i < M; ++i) sum += l_(i, j) * row[i];
        projected.f[j] = sum;
      }
    }
    for (int j = 0; j < M; ++j) {
      projected.g[j] = d_[j] * projected.f[j];
      projected.variance += projected.f[j] * projected.g[j];
    }
    return projected;
  }

  /// (2) and (3) for a row projected before, of this very covariance, and a noise variance
  /// `noise` > 0. States from `size` on are correlated to none, and no part of the row. Returns the
  /// gain K. O(M·size), M + 1 divisions.
  template <int M>
  Vec<S, N> update(const ProjectedRow<S, M>& row, S noise, int size = N) {
    Vec<S, N> b = Vec<S, N>::Zero();
    S inverse = S(1) / noise;  // of α
    S alpha = noise;
    for (int j = M - 1; j >= 0; --j) {
      const S f = row.f[j];
      if (M > kDense && f == S(0)) continue;
      const S g = row.g[j];
      const S step = f * inverse;
      const S before = alpha;
      alpha += f * g;
      inverse = S(1) / alpha;
      d_[j] *= before * inverse;
      for (int i = j + 1; i < size; ++i) {
        const S old = l_(i, j);
        l_(i, j) = old - step * b[i];
        b[i] += g * old;
      }
      b[j] = g;
    }
    for (int i = 0; i < N; ++i) b[i] *= inverse;
    return b;
  }

  /// (4) with Q independent noises of variances `q` ≥ 0 that enter through the columns of `g`.
  /// Zeros of F cost nothing. O(N²(N + Q)).
  template <int Q>
  void predict(const Mat<S, N>& f, const Eigen::Matrix<S, N, Q>& g, const Vec<S, Q>& q) {
    // Rows of W stand in columns, so that memory is walked in order.
    Eigen::Matrix<S, N + Q, N> w = Eigen::Matrix<S, N + Q, N>::Zero();
    for (int i = 0; i < N; ++i) {
      for (int k = 0; k < N; ++k) {
        const S factor = f(i, k);
        if (factor == S(0)) continue;
        for (int j = 0; j < k; ++j) w(j, i) += factor * l_(k, j);
        w(k, i) += factor;
      }
      for (int k = 0; k < Q; ++k) w(N + k, i) = g(i, k);
    }
    Vec<S, N + Q> weight;
    for (int k = 0; k < N; ++k) weight[k] = d_[k];
    for (int k = 0; k < Q; ++k) weight[N + k] = q[k];
    detail::orthogonalise<N>(l_, d_, w, weight, N);
  }

  /// The same where only the first M states move, by `f` and the noises of `g`, and all others
  /// stay; those from `size` on are correlated to none. O(size²·(M + Q)).
  template <int M, int Q>
  void predict_first(const Mat<S, M>& f, const Eigen::Matrix<S, M, Q>& g, const Vec<S, Q>& q,
                     int size = N) {
    detail::predict_first(l_, d_, f, g, q, size);
  }

  /// State k becomes `kept` times itself and a noise of variance `noise` ≥ 0; states from `size` on
  /// are correlated to none. O((size − k)²).
  void predict_process(int k, S kept, S noise, int size = N) {
    detail::predict_process(l_, d_, k, kept, noise, size);
  }

  /// L; its strictly upper part is zero.
  [[nodiscard]] const Mat<S, N>& factor() const { return l_; }
  /// d.
  [[nodiscard]] const Vec<S, N>& diagonal() const { return d_; }

 private:
  static constexpr int kDense = 8;  // a longer row is mostly zeros: biases of others

  Mat<S, N> l_;
  Vec<S, N> d_;
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
