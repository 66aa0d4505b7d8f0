// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Chan's two-stage weighted least squares for ranges (Chan, Ho, IEEE Trans. Signal Process. 42(8),
/// 1994, with [s; R = |s|²] as the unknown). Stage 1 takes s and R as independent:
/// \f[ s_1 = N^{-1} h, \quad C_1 = N^{-1}/4, \qquad R_1 = \rho^2, \quad v_1 = 1/\textstyle\sum w.
/// \f] Stage 2 restores g = R − |s|² = 0 by projecting along the covariance, which is the
/// first-order form of Chan's signed square roots without their poles on the axes:
/// \f[ s = s_1 + \frac{2 C_1 s_1}{v_1 + 4 s_1^T C_1 s_1} (R_1 - |s_1|^2), \qquad
///     C^{-1} = 4 N + 4 s_1 s_1^T / v_1. \f]

#include "uwbpos/solve/fix.hpp"
#include "uwbpos/solve/squared_ranges.hpp"
#include "uwbpos/solve/weak_line.hpp"

namespace uwbpos {

namespace detail {

/// `toa_chan` for one scalar and dimension.
template <class S, int D>
Result<Fix<S, D>> toa_chan(RangeSpan<S, D> span) {
  if (const auto error = check_ranges<S, D>(span, D + 1)) return std::unexpected(*error);

  const SquaredRanges<S, D> system = squared_ranges<S, D>(span);
  const Ldlt<S, D> normal{system.normal};
  if (lacks_rank<S, D>(system.normal) || !normal.positive_definite()) {
    return std::unexpected(Error::DegenerateGeometry);
  }
  const Vec<S, D> s = normal.solve(system.rhs);

  const Vec<S, D> gain = normal.solve(s) * S(0.5);  // 2 C₁ s₁
  const S innovation_variance = S(1) / system.total_weight + S(2) * dot(s, gain);
  const S innovation = system.rho_squared - squared_norm(s);

  Mat<S, D> information = system.normal * S(4);
  add_outer(information, s, S(4) * system.total_weight);
  return make_fix<S, D>(span, system.center + s + gain * (innovation / innovation_variance),
                        information);
}

}  // namespace detail

/// Position [m] from n ≥ D + 1 ranges to anchors that span the space, in the anchors' frame.
/// Reaches the bound while noise is small beside the distances. O(n·D²), no allocation.
/// Errors: those of `check_ranges`; Error::DegenerateGeometry when the anchors do not span;
/// Error::NumericOverflow.
template <RangeSet R>
[[nodiscard]] auto toa_chan(const R& ranges)
    -> Result<Fix<RangeSetScalar<R>, kRangeSetDimension<R>>> {
  return detail::toa_chan<RangeSetScalar<R>, kRangeSetDimension<R>>(as_range_span(ranges));
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
