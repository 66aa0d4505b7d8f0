// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The Kalman filter of N states, whose covariance is that of filter/factored_covariance.hpp:
/// \f[ x \leftarrow F x,\quad P \leftarrow F P F^T + G\,\mathrm{diag}(q)\,G^T \tag{1} \f]
/// \f[ x \leftarrow x + K \nu,\quad \nu = z - h(x) \tag{2} \f]
/// one scalar measurement after the other, each touching only the columns that it uses. Correlated
/// measurements are made independent first; for a nonlinear h the row is its gradient and the
/// caller gives ν (extended Kalman filter).

#include "uwbpos/filter/factored_covariance.hpp"
#include "uwbpos/model/range_set.hpp"

namespace uwbpos {

/// State and covariance. Aggregate of fixed size, nothing allocates.
template <class S, int N>
struct KalmanFilter {
  Vec<S, N> state = Vec<S, N>::Zero();  ///< x
  FactoredCovariance<S, N> covariance;  ///< P

  /// (1) of a linear motion; see `FactoredCovariance::predict` for shapes and cost.
  template <int Q>
  void predict(const Mat<S, N>& f, const Eigen::Matrix<S, N, Q>& g, const Vec<S, Q>& q) {
    Vec<S, N> next;
    for (int i = 0; i < N; ++i) {
      next[i] = f(i, 0) * state[0];
      for (int k = 1; k < N; ++k) next[i] += f(i, k) * state[k];
    }
    state = next;
    covariance.predict(f, g, q);
  }

  /// (2) for `innovation` ν, gradient `row` with respect to the first M states, zero for all
  /// others, and a noise variance `noise`. Returns ν's own variance hᵀPh + r, for tests of
  /// consistency. O(M·N). Errors: NotFinite; NonPositiveSigma, a variance below that of
  /// `kSmallestSigma`.
  /// On an error nothing changes.
  template <int M>
  [[nodiscard]] Result<S> update(S innovation, const Vec<S, M>& row, S noise) {
    if (!std::isfinite(innovation) || !all_finite(row) || !std::isfinite(noise)) {
      return std::unexpected(Error::NotFinite);
    }
    if (!(noise >= kSmallestSigma<S> * kSmallestSigma<S>))
      return std::unexpected(Error::NonPositiveSigma);
    const ProjectedRow<S, M> projected = covariance.project(row);
    const Vec<S, N> gain = covariance.update(projected, noise);
    for (int i = 0; i < N; ++i) state[i] += gain[i] * innovation;
    return projected.variance + noise;
  }
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
