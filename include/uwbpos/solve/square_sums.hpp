// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The linear system of squares, summed in one pass, for squared_ranges.hpp and
/// pseudorange_roots.hpp. With points d about a place o, weights w, η = diag(1, …, 1, ±1) and q =
/// dᵀ η d less an `offset` that all share, the system about the weighted mean c of the points, m =
/// c − o, is
/// \f[ A = \sum w\, d d^T - W m m^T, \qquad
///     b = \tfrac12 \left( \sum w q d - m \sum w q \right) - A \eta m, \qquad
///     \Lambda = m^T \eta m - \overline{q} - \text{offset}. \qquad (1) \f]

#include <algorithm>
#include <limits>

#include "uwbpos/core/cofactors.hpp"
#include "uwbpos/core/lanes.hpp"
#include "uwbpos/core/linalg.hpp"

namespace uwbpos {

/// Where sums of weighted points about o lose no digits when they are moved to the weighted mean:
/// at the plain mean, or at a point that outweighs the others.
template <class S, int N>
class SumOrigin {
 public:
  /// Notes `point`, whose weight is near 1/`price`. O(N).
  void add(const S (&point)[N], S price) {
    if (!(price >= least_)) {
      least_ = price;
#pragma GCC unroll 5
      for (int k = 0; k < N; ++k) heaviest_[k] = point[k];
    }
#pragma GCC unroll 5
    for (int k = 0; k < N; ++k) sum_[k] += point[k];
    prices_ += price;
  }
  /// o, of `count` points.
  void place(S (&origin)[N], S count) const {
    const bool outweighs = S(4) * count * least_ < prices_;
#pragma GCC unroll 5
    for (int k = 0; k < N; ++k) origin[k] = outweighs ? heaviest_[k] : sum_[k] / count;
  }

 private:
  S least_ = std::numeric_limits<S>::infinity();
  S heaviest_[N] = {};
  S sum_[N] = {};
  S prices_ = S(0);
};

/// Where the sums of (1) are.
template <int N>
struct SquareSums {
  static constexpr int kMean = N * (N + 1) / 2;  ///< Σ w d, after Σ w d dᵀ
  static constexpr int kPull = kMean + N;        ///< Σ w q d
  static constexpr int kSquare = kPull + N;      ///< Σ w q
  static constexpr int kWeight = kSquare + 1;    ///< W
  static constexpr int kCount = kWeight + 1;     ///< how many they are
};

/// Adds what a point, or a pair of points, has in (1). O(N²).
template <int N, class P, int K>
[[gnu::always_inline]] inline void add_square(Numbers<P, K>& sum, const Numbers<P, N>& d,
                                              const P& q, const P& w) {
  using At = SquareSums<N>;
  const P wq = w * q;
  add_lower<N, 0>(sum, d, w);
  unroll<N>([&](auto k) __attribute__((always_inline)) {
    sum[At::kMean + k] += w * d[k];
    sum[At::kPull + k] += wq * d[k];
  });
  sum[At::kSquare] += wq;
  sum[At::kWeight] += w;
}

/// Sets the first D of `d` to an element's anchor less `first`, and returns their squares' sum.
template <int D, class P, int N, class Take, class X>
[[nodiscard, gnu::always_inline]] inline P anchor_offset(Numbers<P, N>& d, const Take& take,
                                                         const X& first) {
  P square = P{};
  unroll<D>([&](auto k) __attribute__((always_inline)) {
    d[k] = take([&](const auto& r) { return r.anchor[int(k)]; }) - first[k];
    square += d[k] * d[k];
  });
  return square;
}

/// A about the weighted mean, and what the clear cases need beside it, numbers or lanes of numbers.
template <class P, int N>
struct CentredSums {
  Lower<P, N> normal;   ///< A
  Numbers<P, N> terms;  ///< of A's diagonal, before the mean was taken off
  Numbers<P, N> mean;   ///< m
  Numbers<P, N> pull;   ///< Σ w q d − m Σ w q
  P square;             ///< the mean of q
  P each;               ///< 1/W
};

/// Moves sums about a place near the points to their weighted mean; no digits are looked after.
/// O(N²), no allocation.
template <class S, int N, class P, int K>
[[nodiscard, gnu::always_inline]] inline CentredSums<P, N> centred_sums(const Numbers<P, K>& sums) {
  using At = SquareSums<N>;
  CentredSums<P, N> about;
  about.each = S(1) / sums[At::kWeight];
  about.square = sums[At::kSquare] * about.each;
  unroll<N>([&](auto j) __attribute__((always_inline)) {
    about.terms[j] = sums[lower_index<N>(j, j)];
    about.mean[j] = sums[At::kMean + j] * about.each;
    about.pull[j] = sums[At::kPull + j] - about.mean[j] * sums[At::kSquare];
  });
  unroll<N>([&](auto j) __attribute__((always_inline)) {
    unroll<N - j>([&](auto i) __attribute__((always_inline)) {
      constexpr int k = lower_index<N>(j + i, j);
      about.normal[k] = sums[k] - sums[At::kMean + j + i] * about.mean[j];
    });
  });
  return about;
}

/// (1) about the weighted mean.
template <class S, int N>
struct SquareSystem {
  Mat<S, N> normal;  ///< A, lower triangle
  Vec<S, N> rhs;     ///< b
  Vec<S, N> mean;    ///< m, from o
  S square;          ///< Λ
  S total_weight;    ///< W
};

/// Moves sums about o to the weighted mean. `last`: the last entry of η. O(N²), no allocation.
template <class S, int N>
[[nodiscard, gnu::always_inline]] inline SquareSystem<S, N> square_system(
    const Numbers<S, SquareSums<N>::kCount>& sums, S offset, S last) {
  using At = SquareSums<N>;
  SquareSystem<S, N> system;
  system.total_weight = sums[At::kWeight];
  Vec<S, N>& m = system.mean;
  Vec<S, N> flipped;  // η m
#pragma GCC unroll 4
  for (int k = 0; k < N; ++k) {
    m[k] = sums[At::kMean + k] / system.total_weight;
    flipped[k] = k < N - 1 ? m[k] : last * m[k];
  }
  system.square = dot<S, N>(m, flipped) - (sums[At::kSquare] / system.total_weight + offset);
#pragma GCC unroll 4
  for (int j = 0; j < N; ++j) {
#pragma GCC unroll 4
    for (int i = j; i < N; ++i) {
      system.normal(i, j) = sums[lower_index<N>(i, j)] - sums[At::kMean + i] * m[j];
    }
  }
#pragma GCC unroll 4
  for (int j = 0; j < N; ++j) {
    S along = S(0);
#pragma GCC unroll 4
    for (int i = 0; i < N; ++i) {
      along += system.normal(std::max(i, j), std::min(i, j)) * flipped[i];
    }
    system.rhs[j] = (sums[At::kPull + j] - m[j] * sums[At::kSquare]) / 2 - along;
  }
  return system;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
