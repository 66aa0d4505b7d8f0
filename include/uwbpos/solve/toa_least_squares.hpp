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

#include "uwbpos/model/range.hpp"
#include "uwbpos/solve/fix.hpp"
#include "uwbpos/solve/newton.hpp"
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

/// Knowledge about one direction that ranges alone leave open: `direction` · (p − `point`) is zero,
/// with `information`.
template <class S, int D>
struct DirectionPrior {
  Vec<S, D> point = Vec<S, D>::Zero();      ///< [m]
  Vec<S, D> direction = Vec<S, D>::Zero();  ///< unit length
  S information = S(0);                     ///< 1/variance [1/m²]; zero: nothing is known
};

/// The normal equations at `position`, relative to `center` like `prior`. O(n·D²), no allocation.
template <class S, int D>
[[nodiscard]] NormalEquations<S, D> range_normal(RangeSpan<S, D> ranges, const Vec<S, D>& center,
                                                 const Vec<S, D>& position,
                                                 const DirectionPrior<S, D>& prior) {
  NormalEquations<S, D> normal;
  add_outer(normal.information, prior.direction, prior.information);
  const Vec<S, D> to_prior = prior.point - position;
  const S off_prior = dot(prior.direction, to_prior);
  normal.gradient = prior.direction * (prior.information * off_prior);
  normal.chi_squared = prior.information * off_prior * off_prior;
  S curvature = S(0);
  for (const RangeTo<S, D>& r : ranges) {
    const Vec<S, D> anchor = r.anchor - center;
    const RangePrediction<S, D> predicted = predict_range(position, anchor);
    const S weight = S(1) / (r.sigma * r.sigma);
    const S residual = std::max(r.range, S(0)) - predicted.range;  // no cusp at the anchor
    const S weighted = residual * weight;
    add_outer(normal.information, predicted.gradient, weight);
    normal.gradient += weighted * predicted.gradient;
    normal.chi_squared += weighted * residual;
    const S bend = predicted.range > S(0) ? weighted / predicted.range : S(0);
    add_outer(normal.hessian, predicted.gradient, bend);
    curvature += bend;
  }
  normal.hessian += normal.information;
  for (int i = 0; i < D; ++i) normal.hessian(i, i) -= curvature;
  return normal;
}

/// Descends from `start` to the minimum in whose basin it lies. All relative to `center`;
/// `largest` is the scale of rounding errors [m]. No allocation. Error::NotConverged.
template <class S, int D>
[[nodiscard]] Result<Minimum<S, D>> descend(RangeSpan<S, D> ranges, const Vec<S, D>& center,
                                            const Vec<S, D>& start, S largest, int max_iterations,
                                            const DirectionPrior<S, D>& prior = {}) {
  const auto evaluate = [&](const Vec<S, D>& position) {
    return range_normal<S, D>(ranges, center, position, prior);
  };
  const S rounding = S(4) * std::numeric_limits<S>::epsilon() * largest;
  return minimise<S, D>(evaluate, start, rounding, max_iterations);
}

namespace detail {

/// `toa_least_squares` for one scalar and dimension.
template <class S, int D>
Result<Fix<S, D>> toa_least_squares(RangeSpan<S, D> span,
                                    const LeastSquaresOptions<S, D>& options) {
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
  return make_fix<S, D>(span, center + minimum->state, minimum->information);
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
