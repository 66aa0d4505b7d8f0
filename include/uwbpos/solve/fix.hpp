// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The last step of every solver of ranges: from a position and its information to a `Fix`.

#include "uwbpos/model/range_set.hpp"

namespace uwbpos {

/// A fix at `position` [m] with covariance `information`⁻¹ (lower triangle, 1/m²) from `count` of
/// ranges, which leave `chi_squared`. O(D³), no allocation.
/// Error::DegenerateGeometry, singular information; Error::NumericOverflow, a result that is not
/// finite.
template <class S, int D>
[[nodiscard]] Result<Fix<S, D>> make_fix(std::size_t count, const Vec<S, D>& position,
                                         const Mat<S, D>& information, S chi_squared) {
  const Ldlt<S, D> factor{information};
  if (!factor.positive_definite()) return std::unexpected(Error::DegenerateGeometry);
  Fix<S, D> fix{position, factor.inverse(), chi_squared, static_cast<int>(count) - D};
  for (int k = 0; k < D; ++k) {
    // A variance that drowned in the rounding of the others.
    if (fix.covariance(k, k) < S(0)) return std::unexpected(Error::DegenerateGeometry);
  }
  if (!all_finite(fix.position) || !all_finite(fix.covariance) || !std::isfinite(fix.chi_squared)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return fix;
}

/// The same with χ² computed. O(n·D + D³).
template <class S, int D>
[[nodiscard]] Result<Fix<S, D>> make_fix(RangeSpan<S, D> ranges, const Vec<S, D>& position,
                                         const Mat<S, D>& information) {
  return make_fix<S, D>(ranges.size(), position, information,
                        uwbpos::chi_squared<S, D>(ranges, position));
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
