// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Maximum-likelihood position from ranges: the minimum of
/// \f$ \chi^2(p) = \sum (r_i - |p - a_i|)^2 / \sigma_i^2 \f$ by the descent of newton.hpp, with
/// g the unit vectors of model/range.hpp and \f$ \partial^2 h = (I - g g^T) / |p - a| \f$;
/// cov(p) = J⁻¹. All of it relative to the anchors' centre, because a float has 24 bits and squares
/// of building coordinates eat them.

#include <algorithm>

#include "uwbpos/solve/direct_ranges.hpp"
#include "uwbpos/solve/fix.hpp"
#include "uwbpos/solve/range_normal.hpp"
#include "uwbpos/solve/toa_closed_form.hpp"

namespace uwbpos {

/// Where the descent starts and when it gives up.
template <class S, int D>
struct LeastSquaresOptions {
  /// Where to start [m]; without it, the closed form.
  std::optional<Vec<S, D>> initial = std::nullopt;
  /// Most evaluations of (1) before Error::NotConverged; from the closed form two or three
  /// suffice.
  int max_iterations = 30;
};

/// Descends from `start` to the minimum in whose basin it lies. All relative to `center`;
/// `largest` is the scale of rounding errors [m]. No allocation. Error::NotConverged.
template <class S, int D>
[[nodiscard]] Result<Minimum<S, D>> descend(RangeSpan<S, D> ranges, const Vec<S, D>& center,
                                            const Vec<S, D>& start, S largest, int max_iterations,
                                            const DirectionPrior<S, D>& prior = {}) {
  const auto evaluate = [&](const Vec<S, D>& position, Curvature curvature)
                            __attribute__((always_inline)) {
                              return range_normal<S, D>(ranges, center, position, prior, curvature);
                            };
  const S rounding = S(4) * std::numeric_limits<S>::epsilon() * largest;
  return minimise<S, D>(evaluate, start, rounding, max_iterations);
}

namespace detail {

/// `toa_least_squares` for one scalar and dimension.
template <class S, int D>
Result<Fix<S, D>> toa_least_squares(RangeSpan<S, D> span,
                                    const LeastSquaresOptions<S, D>& options) {
  if (!options.initial && options.max_iterations > 0 && is_range_count(span.size(), D)) {
    const auto direct = direct_ranges<S, D, S>(span);
    if (direct.clear) {
      return direct_fix<S, D>(span.front().anchor, direct.from_first, direct.covariance,
                              direct.chi_squared, static_cast<int>(span.size()) - D);
    }
  }
  if (const auto error = check_ranges<S, D>(span, D)) return std::unexpected(*error);
  if (options.max_iterations < 1) return std::unexpected(Error::InvalidOption);

  Vec<S, D> center;
  Vec<S, D> start;
  S largest;
  if (options.initial) {
    if (!all_finite(*options.initial)) return std::unexpected(Error::NotFinite);
    center = span.front().anchor;
    start = *options.initial - center;
    largest = norm(start);
    for (const RangeTo<S, D>& r : span) largest = std::max(largest, std::abs(r.range));
  } else {
    const Result<ToaRoots<S, D>> roots = toa_roots<S, D>(span);
    if (!roots) return std::unexpected(roots.error());
    if (roots->flat()) return std::unexpected(Error::AmbiguousSolution);
    center = roots->center;
    start = roots->foot + weigh_roots(*roots).likely * roots->direction;
    largest = roots->largest;
  }
  const Result<Minimum<S, D>> minimum =
      descend<S, D>(span, center, start, largest, options.max_iterations);
  if (!minimum) return std::unexpected(minimum.error());
  return make_fix<S, D>(span.size(), center + minimum->state, minimum->information,
                        minimum->chi_squared);
}

}  // namespace detail

/// Position [m] from n ≥ D ranges, in the anchors' frame, at the minimum of χ² whose basin holds
/// the start: `options.initial`, or the closed form's likelier root. Where mirror images may
/// confuse, and for flat anchors, call `locate`. O(n·D²) an iteration, no allocation.
/// Errors: those of `check_ranges`; Error::NotFinite, Error::InvalidOption for the options;
/// Error::DegenerateGeometry; Error::AmbiguousSolution, flat anchors and no initial position;
/// Error::NotConverged; Error::NumericOverflow.
template <RangeSet R>
[[nodiscard]] auto toa_least_squares(
    const R& ranges,
    const std::type_identity_t<LeastSquaresOptions<RangeSetScalar<R>, kRangeSetDimension<R>>>&
        options = {}) -> Result<Fix<RangeSetScalar<R>, kRangeSetDimension<R>>> {
  return detail::toa_least_squares<RangeSetScalar<R>, kRangeSetDimension<R>>(as_range_span(ranges),
                                                                             options);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
