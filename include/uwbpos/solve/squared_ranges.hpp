// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The linear system that squared ranges form, shared by the closed form, the linear solution and
/// Chan's. With weights \f$ w_i = 1 / (4 r_i^2 \sigma_i^2 + 2 \sigma_i^4) \f$, the inverse
/// variances of the squares, c the weighted mean of the anchors, \f$ u_i = a_i - c \f$ and \f$ s =
/// p - c \f$:
/// \f[ r_i^2 = |s|^2 - 2 u_i^T s + |u_i|^2. \f]
/// The weighted mean of these and the differences from it are independent of each other:
/// \f[ |s|^2 = \overline{r^2 - |u|^2} =: \rho^2, \qquad
///     u_i^T s = \tfrac12 \left( |u_i|^2 - r_i^2 + \rho^2 \right) \qquad (1), (2) \f]

#include <algorithm>
#include <cmath>
#include <limits>

#include "uwbpos/core/lanes.hpp"
#include "uwbpos/model/range_set.hpp"
#include "uwbpos/solve/sum_origin.hpp"

namespace uwbpos {

/// Normal equations of (2), `normal` · s = `rhs`, and (1). Positions relative to `center` [m].
/// cov(s) = normal⁻¹/4 and var(ρ²) = 1/`total_weight`, uncorrelated.
template <class S, int D>
struct SquaredRanges {
  Vec<S, D> center;  ///< weighted mean of the anchors [m]
  Mat<S, D> normal;  ///< Σ w u uᵀ [1/m²], lower triangle
  Vec<S, D> rhs;     ///< right-hand side [1/m]
  S rho_squared;     ///< ρ² [m²]
  S total_weight;    ///< Σ w [1/m⁴]
  S largest;         ///< the greatest length met, from the first anchor or r_i [m]: the scale of
                     ///< rounding errors
};

/// Builds the system from checked ranges: one pass for a place o near c, one for sums about it,
/// from which those about c follow, with m = c − o. O(n·D²), no allocation.
template <class S, int D>
[[nodiscard]] SquaredRanges<S, D> squared_ranges(RangeSpan<S, D> ranges) {
  const Vec<S, D> first = ranges.front().anchor;
  const S count = static_cast<S>(ranges.size());
  S longest = S(0);
  S farthest = S(0);
  SumOrigin<S, D + 1> near;
  for (const RangeTo<S, D>& r : ranges) {
    longest = std::max(longest, std::abs(r.range));
    const S range_square = r.range * r.range;
    S apart[D + 1];
    S square = S(0);
#pragma GCC unroll 4
    for (int k = 0; k < D; ++k) {
      apart[k] = r.anchor[k] - first[k];
      square += apart[k] * apart[k];
    }
    apart[D] = range_square - square;
    farthest = std::max(farthest, square);
    near.add(apart, range_square * (r.sigma * r.sigma));
  }
  S middle[D + 1];
  near.place(middle, count);
  // r² − |d|² there; taken from every square it leaves small numbers, which keep their digits.
  S offset = middle[D];
#pragma GCC unroll 4
  for (int k = 0; k < D; ++k) offset += middle[k] * middle[k];
  // A range of zero would weigh without bound: no range is known better than it can be written.
  const S rounding = std::numeric_limits<S>::epsilon() * longest;
  const S floor = rounding * rounding;
  constexpr int kMean = D * (D + 1) / 2;  // Σ w d, after Σ w d dᵀ
  constexpr int kPull = kMean + D;        // Σ w q d
  constexpr int kSquare = kPull + D;      // Σ w q
  constexpr int kWeight = kSquare + 1;    // Σ w
  const auto sums = sum_in_lanes<S, kWeight + 1>(
      ranges, [&](auto& sum, const auto& take, const auto& one) __attribute__((always_inline)) {
        using P = std::remove_cvref_t<decltype(one)>;
        Numbers<P, D> d;
        P square = P{};
        unroll<D>([&](auto k) __attribute__((always_inline)) {
          d[k] = (take([&](const auto& r) { return r.anchor[int(k)]; }) - first[int(k)]) -
                 middle[int(k)];
          square += d[k] * d[k];
        });
        const P range = take([&](const auto& r) { return r.range; });
        const P sigma = take([&](const auto& r) { return r.sigma; });
        const P variance = sigma * sigma;
        const P w = one / (S(4) * variance * (range * range + variance * S(0.5) + floor));
        const P q = range * range - square - offset;
        const P wq = w * q;
        add_lower<D, 0>(sum, d, w);
        unroll<D>([&](auto k) __attribute__((always_inline)) {
          sum[kMean + k] += w * d[k];
          sum[kPull + k] += wq * d[k];
        });
        sum[kSquare] += wq;
        sum[kWeight] += w;
      });

  SquaredRanges<S, D> system;
  const S total = sums[kWeight];
  const S mean_square = sums[kSquare] / total;
  S m[D];
  S shift = S(0);
#pragma GCC unroll 4
  for (int k = 0; k < D; ++k) {
    m[k] = sums[kMean + k] / total;
    shift += m[k] * m[k];
    system.center[k] = first[k] + (middle[k] + m[k]);
  }
#pragma GCC unroll 4
  for (int j = 0; j < D; ++j) {
#pragma GCC unroll 4
    for (int i = j; i < D; ++i) {
      system.normal(i, j) = sums[lower_index<D>(i, j)] - sums[kMean + i] * m[j];
    }
  }
#pragma GCC unroll 4
  for (int j = 0; j < D; ++j) {
    S along = S(0);
#pragma GCC unroll 4
    for (int i = 0; i < D; ++i) along += system.normal(std::max(i, j), std::min(i, j)) * m[i];
    system.rhs[j] = (m[j] * sums[kSquare] - sums[kPull + j]) / 2 - along;
  }
  system.rho_squared = offset + mean_square + shift;
  system.total_weight = total;
  system.largest = std::max(longest, std::sqrt(farthest));
  return system;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
