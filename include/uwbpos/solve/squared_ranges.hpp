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
#include "uwbpos/solve/square_sums.hpp"

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
    apart[D] = square - range_square;
    farthest = std::max(farthest, square);
    near.add(apart, range_square * (r.sigma * r.sigma));
  }
  S middle[D + 1];
  near.place(middle, count);
  // |d|² − r² there; taken from every square it leaves small numbers, which keep their digits.
  S offset = middle[D];
#pragma GCC unroll 4
  for (int k = 0; k < D; ++k) offset -= middle[k] * middle[k];
  // A range of zero would weigh without bound: no range is known better than it can be written.
  const S rounding = std::numeric_limits<S>::epsilon() * longest;
  const S floor = rounding * rounding;
  const auto sums = sum_in_lanes<S, SquareSums<D>::kCount>(
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
        add_square<D, P>(sum, d, square - range * range - offset, w);
      });
  const SquareSystem<S, D> about = square_system<S, D>(sums, offset, S(1));

  SquaredRanges<S, D> system;
#pragma GCC unroll 4
  for (int k = 0; k < D; ++k) system.center[k] = first[k] + (middle[k] + about.mean[k]);
  system.normal = about.normal;
  system.rhs = about.rhs;
  system.rho_squared = about.square;
  system.total_weight = about.total_weight;
  system.largest = std::max(longest, std::sqrt(farthest));
  return system;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
