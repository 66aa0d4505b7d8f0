// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Maximum-likelihood position from ranges: Gauss-Newton on
/// \f$ \chi^2(p) = \sum (r_i - |p - a_i|)^2 / \sigma_i^2 \f$, with g the unit vectors of
/// model/range.hpp:
/// \f[ J = \sum g_i g_i^T / \sigma_i^2, \qquad
///     J \, \Delta p = \sum g_i (r_i - |p - a_i|) / \sigma_i^2, \qquad
///     \operatorname{cov}(p) = J^{-1}, \qquad (1) \f]
/// damped as Levenberg has it only where a step would not help. All of it relative to the anchors'
/// centre, because a float has 24 bits and squares of building coordinates eat them.

#include "uwbpos/model/range.hpp"
#include "uwbpos/solve/fix.hpp"
#include "uwbpos/solve/toa_closed_form.hpp"

namespace uwbpos {

/// `initial`: where to start [m]; without it, the closed form. `max_iterations`: most evaluations
/// of (1) before Error::NotConverged; from the closed form two or three suffice.
template <class S, int D>
struct LeastSquaresOptions {
  std::optional<Vec<S, D>> initial = std::nullopt;
  int max_iterations = 30;
};

/// Knowledge about one direction that ranges alone leave open: `direction` · (p − `point`) is zero
/// with this `information` [1/m²]. Zero information: nothing is known.
template <class S, int D>
struct DirectionPrior {
  Vec<S, D> point = Vec<S, D>::Zero();
  Vec<S, D> direction = Vec<S, D>::Zero();
  S information = S(0);
};

/// The normal equations (1) at one position, relative to a centre.
template <class S, int D>
struct RangeNormal {
  Mat<S, D> information;  ///< J, lower triangle
  Vec<S, D> gradient;     ///< right-hand side of (1)
  S chi_squared;
  S pull;  ///< Σ |r − ρ| / (ρ σ²) over ranges shorter than predicted: bounds what J leaves out
};

/// Evaluates (1) at `position`, relative to `center` like `prior`. O(n·D²), no allocation.
template <class S, int D>
[[nodiscard]] RangeNormal<S, D> range_normal(RangeSpan<S, D> ranges, const Vec<S, D>& center,
                                             const Vec<S, D>& position,
                                             const DirectionPrior<S, D>& prior) {
  RangeNormal<S, D> normal;
  normal.information.setZero();
  add_outer(normal.information, prior.direction, prior.information);
  const Vec<S, D> to_prior = prior.point - position;
  normal.gradient = prior.direction * (prior.information * dot(prior.direction, to_prior));
  normal.chi_squared = S(0);
  normal.pull = S(0);
  for (const RangeTo<S, D>& r : ranges) {
    const Vec<S, D> anchor = r.anchor - center;
    const RangePrediction<S, D> predicted = predict_range(position, anchor);
    const S weight = S(1) / (r.sigma * r.sigma);
    const S residual = r.range - predicted.range;
    const S weighted = residual * weight;
    add_outer(normal.information, predicted.gradient, weight);
    normal.gradient += weighted * predicted.gradient;
    normal.chi_squared += weighted * residual;
    if (weighted < S(0)) normal.pull -= weighted / predicted.range;
  }
  return normal;
}

/// Where the descent from one start ended, relative to the centre, and J there.
template <class S, int D>
struct Descent {
  Vec<S, D> position;
  Mat<S, D> information;
  S chi_squared;
};

/// Descends (1) from `start` to the minimum in whose basin it lies. All relative to `center`;
/// `largest` is the scale of rounding errors [m]. Each iteration O(n·D²), no allocation.
/// Error::NotConverged.
template <class S, int D>
[[nodiscard]] Result<Descent<S, D>> descend(RangeSpan<S, D> ranges, const Vec<S, D>& center,
                                            const Vec<S, D>& start, S largest, int max_iterations,
                                            const DirectionPrior<S, D>& prior = {}) {
  constexpr S kEpsilon = std::numeric_limits<S>::epsilon();
  constexpr S kSmallStep = S(1e-8);  // a ten-thousandth of a standard deviation, squared
  constexpr S kLeastDamping = S(1e-3);
  const S rounding = S(4) * kEpsilon * largest;
  Vec<S, D> position = start;
  RangeNormal<S, D> normal = range_normal(ranges, center, position, prior);
  S damping = S(0);
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    S trace = S(0);
    for (int i = 0; i < D; ++i) trace += normal.information(i, i);
    const Ldlt<S, D> undamped{normal.information};
    Vec<S, D> step = undamped.solve(normal.gradient);
    bool still = undamped.positive_definite() && dot(step, normal.gradient) <= kSmallStep;
    if (damping > S(0) || !undamped.positive_definite()) {
      Mat<S, D> damped = normal.information;
      for (int i = 0; i < D; ++i) damped(i, i) += std::max(damping, kLeastDamping) * trace;
      step = Ldlt<S, D>{damped}.solve(normal.gradient);
    }
    still = still || squared_norm(step) <= rounding * rounding;
    const Vec<S, D> trial = position + step;
    const RangeNormal<S, D> next = range_normal(ranges, center, trial, prior);
    // No worse than what rounding of every residual may add to χ².
    const S worst = std::sqrt(normal.chi_squared) + std::sqrt(trace) * rounding;
    if (next.chi_squared <= worst * worst) {
      position = trial;
      normal = next;
      damping = damping > S(4) * kLeastDamping ? damping / S(4) : S(0);
    } else if (!still) {
      // Gauss-Newton lacks the curvature of the residuals; their pull bounds it.
      damping = std::max(damping * S(4), std::max(normal.pull / trace, kLeastDamping));
    }
    if (still) return Descent<S, D>{position, normal.information, normal.chi_squared};
    if (!(damping < S(1e6))) break;
  }
  return std::unexpected(Error::NotConverged);
}

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
  using S = RangeSetScalar<R>;
  constexpr int D = kRangeSetDimension<R>;
  const RangeSpan<S, D> span = as_range_span(ranges);
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
    start = likely_root(*roots);
    largest = roots->largest;
  }
  const Result<Descent<S, D>> descent =
      descend<S, D>(span, center, start, largest, options.max_iterations);
  if (!descent) return std::unexpected(descent.error());
  return make_fix<S, D>(span, center + descent->position, descent->information);
}

}  // namespace uwbpos
