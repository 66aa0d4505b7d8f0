// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The system of squared pseudoranges (pseudorange_roots.hpp) in the clear case, without a branch,
/// for scalars or for lanes of epochs. In y = (p, b), with η = diag(1, …, 1, −1), it says A z₀ = b
/// about the weighted mean, and ⟨z, z⟩ = Λ; together
/// \f[ f(z) = (z - z_0)^T A (z - z_0) + \tfrac{W}{4} \left( \langle z, z \rangle - \Lambda
/// \right)^2,
/// \f]
/// whose minimum comes by the update of an iterated Kalman filter, Λ its measurement. Along the
/// direction v that A holds worst, ⟨z, z⟩ has its value once more at the image
/// \f$ z - 2 \langle z, v \rangle v / \langle v, v \rangle \f$.

#include <limits>

#include "uwbpos/core/cofactors.hpp"
#include "uwbpos/model/pseudorange.hpp"
#include "uwbpos/solve/square_sums.hpp"

namespace uwbpos {

/// η z.
template <class P, int N>
[[nodiscard, gnu::always_inline]] inline Numbers<P, N> flipped(Numbers<P, N> z) {
  z[N - 1] = -z[N - 1];
  return z;
}

/// The system and its minimum, N = D + 1. `well_formed`, a bool or a mask of lanes: entries are
/// such as checks want them, no difference exceeds its baseline, and A keeps its digits.
template <class P, int N, class Mask = int>
struct SquareMinimum {
  Numbers<P, N> minimum;  ///< (p, b) at the minimum, from the first anchor and pseudorange [m]
  Numbers<P, N> image;    ///< that at its image
  P worse;                ///< χ² there, roughly, or the largest number where ranges are negative
  P squares;              ///< Σ |u|² + ϱ² + σ² [m²]
  P total_weight;         ///< W = Σ 1/σ² [1/m²]
  P each;                 ///< 1/W
  Mask well_formed;       ///< whether all this holds
};

/// The minimum of f, its squares weighed by 1/σ², as distances are unknown; `view` about its
/// `first` anchor and pseudorange. O(n·D²), no allocation.
template <class S, int D, class P, class V>
[[nodiscard, gnu::always_inline]] inline auto square_minimum(const V& view,
                                                             const Numbers<P, D>& first,
                                                             const P& first_range) {
  constexpr int N = D + 1;
  constexpr int kLast = lower_index<N>(D, D);
  using At = SquareSums<N>;
  constexpr int kFault = At::kCount;    // below zero where a sign is wrong
  constexpr int kSquares = kFault + 1;  // Σ |u|² + ϱ² + σ²
  const auto sums = sum_in_lanes<P, kSquares + 1>(
      view, [&](auto& sum, const auto& take, const auto& one) __attribute__((always_inline)) {
        using Q = std::remove_cvref_t<decltype(one)>;
        Numbers<Q, N> d;
        const Q square = anchor_offset<D>(d, take, first);
        d[D] = first_range - take([](const auto& r) { return r.range; });
        const Q sigma = take([](const auto& r) { return r.sigma; });
        const Q variance = sigma * sigma;
        const Q beyond = d[D] * d[D];
        const Q apart = square - beyond;
        add_square<N, Q>(sum, d, apart, one / variance);
        sum[kSquares] += square + beyond + variance;
        sum[kFault] += lesser(lesser(apart, Q{sigma - kSmallestSigma<S>}), Q{});
      });

  const CentredSums<P, N> about = centred_sums<S, N>(sums);
  const auto& [a, all_terms, m, twice_b, mean_square, each] = about;

  // A = (B, c; cᵀ, d), the bias last.
  Lower<P, D> block;
  Numbers<P, D> border;
  Numbers<P, D> terms;
  unroll<D>([&](auto j) __attribute__((always_inline)) {
    terms[j] = all_terms[j];
    border[j] = a[lower_index<N>(D, j)];
    unroll<D - j>([&](auto i) __attribute__((always_inline)) {
      block[lower_index<D>(j + i, j)] = a[lower_index<N>(j + i, j)];
    });
  });
  const Cofactors<P, D> of_block = cofactors<P, D>(block);
  const P inverse = S(1) / of_block.determinant;
  Numbers<P, D> share = times<P, D>(of_block.adjugate, border);
  const P pivot = a[kLast] - inverse * inner<P, D>(border, share);
  unroll<D>([&](auto k) __attribute__((always_inline)) { share[k] *= inverse; });
  P pivot_terms = all_terms[D];
  unroll<D>([&](auto k)
                __attribute__((always_inline)) { pivot_terms += terms[k] * share[k] * share[k]; });
  Lower<P, N> p;  // A⁻¹
  p[kLast] = S(1) / pivot;
  unroll<D>([&](auto j) __attribute__((always_inline)) {
    const P scaled = share[j] * p[kLast];
    p[lower_index<N>(D, j)] = -scaled;
    unroll<D - j>([&](auto i) __attribute__((always_inline)) {
      p[lower_index<N>(j + i, j)] =
          inverse * of_block.adjugate[lower_index<D>(j + i, j)] + scaled * share[j + i];
    });
  });

  const Numbers<P, N> turned = flipped(m);
  Numbers<P, N> linear = times<P, N>(p, twice_b);
  unroll<N>([&](auto k)
                __attribute__((always_inline)) { linear[k] = S(0.5) * linear[k] - turned[k]; });
  const P square = inner<P, N>(m, turned) - mean_square;
  Numbers<P, N> z = linear;
  for (int i = 0; i < 2; ++i) {
    const Numbers<P, N> row = flipped(z);
    const Numbers<P, N> towards = times<P, N>(p, row);
    const P off = square + inner<P, N>(z, row) - S(2) * inner<P, N>(linear, row);
    const P gain = S(0.5) * off / (inner<P, N>(row, towards) + each);
    unroll<N>([&](auto k) __attribute__((always_inline)) { z[k] = linear[k] + gain * towards[k]; });
  }

  // v, but for its length: the column of A⁻¹ with the greatest variance.
  const auto [weak, variance] = weak_column<P, N>(p);
  const Numbers<P, N> row = flipped(weak);
  const P back = S(2) * inner<P, N>(z, row) / inner<P, N>(weak, row);
  Numbers<P, N> minimum;
  Numbers<P, N> image;
  unroll<N>([&](auto k) __attribute__((always_inline)) {
    minimum[k] = z[k] + turned[k];
    image[k] = minimum[k] - back * weak[k];
  });
  // Squares weigh by four distances squared: f over twice the mean of those at the image. Ranges
  // that are negative there on the mean end it.
  const P mean = image[D] + m[D];  // less than zero, where ranges are not
  const P squares_there = each * a[kLast] + mean * mean;
  const P worse = ((mean > P{}) & (mean * mean > S(0.01) * squares_there))
                      ? P{} + std::numeric_limits<S>::max()
                      : back * back * variance / (S(8) * squares_there);
  constexpr S kLittle = S(1024) * std::numeric_limits<S>::epsilon();
  const auto well_formed = (sums[kFault] == P{}) & is_finite(sums[kSquares]) &
                           is_well_conditioned<S, P, D>(block, of_block, terms) &
                           (pivot > kLittle * pivot_terms);
  return SquareMinimum<P, N, std::remove_cv_t<decltype(well_formed)>>{
      minimum, image, worse, sums[kSquares], sums[At::kWeight], each, well_formed};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
