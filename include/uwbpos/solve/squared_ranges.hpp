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

#include "uwbpos/model/range_set.hpp"

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
  S largest;         ///< the greatest length met, |u_i| or r_i [m]: the scale of rounding errors
};

/// Builds the system from checked ranges. O(n·D²), no allocation.
template <class S, int D>
[[nodiscard]] SquaredRanges<S, D> squared_ranges(RangeSpan<S, D> ranges) {
  S longest = S(0);
  for (const RangeTo<S, D>& r : ranges) longest = std::max(longest, std::abs(r.range));
  // A range of zero would weigh without bound: no range is known better than it can be written.
  const S rounding = std::numeric_limits<S>::epsilon() * longest;
  const auto weight = [rounding](const RangeTo<S, D>& r) {
    const S variance = r.sigma * r.sigma;
    return S(1) / (S(4) * variance * (r.range * r.range + variance / 2 + rounding * rounding));
  };

  SquaredRanges<S, D> system;
  const Vec<S, D> origin = ranges.front().anchor;
  S total = S(0);
  Vec<S, D> mean = Vec<S, D>::Zero();
  for (const RangeTo<S, D>& r : ranges) {
    const S w = weight(r);
    total += w;
    mean += w * (r.anchor - origin);
  }
  mean /= total;
  system.total_weight = total;
  system.center = origin + mean;

  const auto offset = [&](const RangeTo<S, D>& r) -> Vec<S, D> {
    return (r.anchor - origin) - mean;
  };
  S farthest = S(0);
  S rho_squared = S(0);
  for (const RangeTo<S, D>& r : ranges) {
    const S square = squared_norm<S, D>(offset(r));
    rho_squared += weight(r) * (r.range * r.range - square);
    farthest = std::max(farthest, square);
  }
  system.rho_squared = rho_squared / total;
  system.largest = std::max(longest, std::sqrt(farthest));

  system.normal.setZero();
  system.rhs.setZero();
  for (const RangeTo<S, D>& r : ranges) {
    const Vec<S, D> u = offset(r);
    const S w = weight(r);
    add_outer(system.normal, u, w);
    const S half = (squared_norm(u) - r.range * r.range + system.rho_squared) / 2;
    system.rhs += (w * half) * u;
  }
  return system;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
