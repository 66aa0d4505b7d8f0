// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// How time moves a covariance that is kept as \f$ P = L\,\mathrm{diag}(d)\,L^T \f$.
///
/// **All of it.** \f$ P \leftarrow F P F^T + G\,\mathrm{diag}(q)\,G^T = W\,\mathrm{diag}(w)\,W^T
/// \f$ with W = [F L, G], w = (d, q): Gram and Schmidt's orthogonalisation, modified, of the rows
/// of W with weights w (Thornton 1976),
///   (4) \f$ d_j = W_j w W_j^T,\quad L_{ij} = W_i w W_j^T / d_j,\quad W_i \leftarrow W_i - L_{ij}
///       W_j,\ i > j \f$.
///
/// **One noise** of variance c that enters through the column v needs no W (Agee, Turner 1972):
/// from the first state on,
///   (5) \f$ d_j' = d_j + c\,v_j^2,\quad v_i \leftarrow v_i - v_j L_{ij},\quad L_{ij} \leftarrow
///       L_{ij} + v_i\,c\,v_j/d_j',\quad c \leftarrow c\,d_j/d_j' \f$.

#include <algorithm>
#include <limits>

#include "uwbpos/core/types.hpp"

namespace uwbpos::detail {

// All of it for the first `size` states; those behind are correlated to none.

// (4) for the first M rows of W, which stand in columns, so that memory is walked in order.
template <int M, class S, int N, int Width>
void orthogonalise(Mat<S, N>& l, Vec<S, N>& d, Eigen::Matrix<S, Width, N>& w,
                   const Vec<S, Width>& weight, int size) {
  Vec<S, Width> weighted;
  for (int j = 0; j < M; ++j) {
    S square = S(0);
    for (int k = 0; k < Width; ++k) {
      weighted[k] = weight[k] * w(k, j);
      square += weighted[k] * w(k, j);
    }
    // What is too little to divide by is none.
    const bool any = square >= std::numeric_limits<S>::min();
    d[j] = any ? square : S(0);
    const S inverse = any ? S(1) / square : S(0);
    for (int i = j + 1; i < size; ++i) {
      S product = S(0);
      for (int k = 0; k < Width; ++k) product += weighted[k] * w(k, i);
      const S ratio = product * inverse;
      l(i, j) = ratio;
      for (int k = 0; k < Width; ++k) w(k, i) -= ratio * w(k, j);
    }
  }
}

// (5) for a v that is zero before `first`; v is used up.
template <class S, int N>
void add_noise(Mat<S, N>& l, Vec<S, N>& d, Vec<S, N>& v, S c, int first, int size) {
  for (int j = first; j < size; ++j) {
    const S own = v[j];
    if (own == S(0)) continue;
    const S before = d[j];
    const S after = before + c * own * own;
    if (!(after > S(0))) continue;
    d[j] = after;
    const S step = c * own / after;
    c *= before / after;
    for (int i = j + 1; i < size; ++i) {
      v[i] -= own * l(i, j);
      l(i, j) += step * v[i];
    }
  }
}

// (4) and (5) where only the first M states move.
template <class S, int N, int M, int Q>
void predict_first(Mat<S, N>& l, Vec<S, N>& d, const Mat<S, M>& f, const Eigen::Matrix<S, M, Q>& g,
                   const Vec<S, Q>& q, int size) {
  static_assert(M < N);
  // F turns the space of the first M columns in itself: of the other rows nothing is left there.
  Eigen::Matrix<S, M, N> w = l.template leftCols<M>().transpose();
  w.template leftCols<M>().setZero();
  for (int i = 0; i < M; ++i) {
    for (int k = 0; k < M; ++k) {
      const S factor = f(i, k);
      if (factor == S(0)) continue;
      for (int j = 0; j < k; ++j) w(j, i) += factor * l(k, j);
      w(k, i) += factor;
    }
  }
  const Vec<S, M> weight = d.template head<M>();
  orthogonalise<M>(l, d, w, weight, size);
  for (int k = 0; k < Q; ++k) {
    if (!(q[k] > S(0))) continue;
    Vec<S, N> column = Vec<S, N>::Zero();
    column.template head<M>() = g.col(k);
    add_noise(l, d, column, q[k], 0, size);
  }
}

// State k becomes `kept` times itself and a noise: its column and the noise's span two dimensions,
// of which one stays its own and (5) hands on the other.
template <class S, int N>
void predict_process(Mat<S, N>& l, Vec<S, N>& d, int k, S kept, S noise, int size) {
  for (int j = 0; j < k; ++j) l(k, j) *= kept;
  const S before = d[k];
  const S after = kept * kept * before + noise;
  d[k] = after;
  if (!(after > S(0))) return;
  Vec<S, N> column = Vec<S, N>::Zero();
  const S share = kept * before / after;
  const int end = std::min(size, N);
  for (int i = k + 1; i < end; ++i) {
    column[i] = l(i, k);
    l(i, k) *= share;
  }
  add_noise(l, d, column, S(noise * before / after), k + 1, size);
}

}  // namespace uwbpos::detail

#include "uwbpos/core/macros_back.hpp"
