// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Weighted linear least squares on squared ranges: (2) of squared_ranges.hpp solved as it stands.
/// It leaves |s|² = ρ² unused, so anchors must span the space (no ceiling, no line), and its error
/// exceeds the bound; in return it is one linear solve that never iterates.

#include "uwbpos/solve/fix.hpp"
#include "uwbpos/solve/squared_ranges.hpp"
#include "uwbpos/solve/weak_line.hpp"

namespace uwbpos {

namespace detail {

/// `toa_linear` for one scalar and dimension.
template <class S, int D>
Result<Fix<S, D>> toa_linear(RangeSpan<S, D> span) {
  if (const auto error = check_ranges<S, D>(span, D + 1)) return std::unexpected(*error);

  const SquaredRanges<S, D> system = squared_ranges<S, D>(span);
  const Ldlt<S, D> normal{system.normal};
  if (lacks_rank<S, D>(system.normal) || !normal.positive_definite()) {
    return std::unexpected(Error::DegenerateGeometry);
  }
  const Vec<S, D> s = normal.solve(system.rhs);

  return make_fix<S, D>(span, system.center + s, system.normal * S(4));
}

}  // namespace detail

/// Position [m] from n ≥ D + 1 ranges to anchors that span the space, in the anchors' frame.
/// Covariance to first order. O(n·D²), no allocation.
/// Errors: those of `check_ranges`; Error::DegenerateGeometry when the anchors do not span;
/// Error::NumericOverflow.
template <RangeSet R>
[[nodiscard]] auto toa_linear(const R& ranges)
    -> Result<Fix<RangeSetScalar<R>, kRangeSetDimension<R>>> {
  return detail::toa_linear<RangeSetScalar<R>, kRangeSetDimension<R>>(as_range_span(ranges));
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
