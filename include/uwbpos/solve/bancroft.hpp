// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Position and common bias from pseudoranges in closed form (Bancroft, IEEE Trans. AES 21(1),
/// 1985), by pseudorange_roots.hpp: any number of anchors from D + 1, flat or not.

#include "uwbpos/solve/pseudorange_roots.hpp"

namespace uwbpos {

/// The two solutions, equal where there is one; the first fits no worse.
template <class S, int D>
struct BancroftSolution {
  BiasedPosition<S, D> first;   ///< fits no worse
  BiasedPosition<S, D> second;  ///< the other root
};

namespace detail {

/// `bancroft` for one scalar and dimension.
template <class S, int D>
Result<BancroftSolution<S, D>> bancroft(RangeSpan<S, D> span) {
  if (const auto error = check_range_values<S, D>(span, D + 1)) return std::unexpected(*error);
  const Result<PseudorangeRoots<S, D>> roots = pseudorange_roots<S, D>(span);
  if (!roots) return std::unexpected(roots.error());
  if (roots->count == 0) return std::unexpected(Error::InconsistentRanges);
  const auto misfit = [&](const BiasedPosition<S, D>& at) {
    S sum = S(0);
    for (const RangeTo<S, D>& r : span) {
      const S e =
          (r.range - predict_pseudorange(at.position, at.bias, r.anchor).pseudorange) / r.sigma;
      sum += e * e;
    }
    return sum;
  };
  BancroftSolution<S, D> both{roots->at(0), roots->at(roots->count - 1)};
  if (misfit(both.second) < misfit(both.first)) std::swap(both.first, both.second);
  return both;
}

}  // namespace detail

/// The solutions that n ≥ D + 1 pseudoranges [m] allow. Exact on exact pseudoranges; weighted by
/// their sigmas, unpolished. O(n·D²), no allocation.
/// Errors: those of `check_range_values`; Error::DegenerateGeometry; Error::InconsistentRanges,
/// none with positive ranges; Error::NumericOverflow.
template <RangeSet R>
[[nodiscard]] auto bancroft(const R& pseudoranges)
    -> Result<BancroftSolution<RangeSetScalar<R>, kRangeSetDimension<R>>> {
  return detail::bancroft<RangeSetScalar<R>, kRangeSetDimension<R>>(as_range_span(pseudoranges));
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
