// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Maximum-likelihood position and common bias from pseudoranges: the minimum of
/// \f[ \chi^2(p, b) = \sum (\rho_i - |p - a_i| - b)^2 / \sigma_i^2 \f]
/// by the descent of newton.hpp from the closed form's roots. For range differences against a
/// shared reference it is the minimum with their full Q⁻¹ (model/pseudorange.hpp).

#include "uwbpos/solve/mirror_choice.hpp"
#include "uwbpos/solve/pseudorange_roots.hpp"

namespace uwbpos {

/// A position and the bias that all ranges share. `position`, `bias` [m]; `covariance` of
/// (position, bias) [m²]; χ² at the solution; measurements − unknowns.
template <class S, int D>
struct BiasedFix {
  Vec<S, D> position;        ///< [m]
  S bias;                    ///< [m]
  Mat<S, D + 1> covariance;  ///< of (position, bias) [m²]
  S chi_squared;             ///< at the solution
  int degrees_of_freedom;    ///< measurements − unknowns
};

/// The normal equations at (position, bias), relative to `center` and `mean`. O(n·D²).
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] NormalEquations<S, D + 1> pseudorange_normal(const V& view, const Vec<S, D>& center,
                                                           S mean, const Vec<S, D + 1>& state) {
  NormalEquations<S, D + 1> normal;
  Vec<S, D> position;
  for (int k = 0; k < D; ++k) position[k] = state[k];
  S curvature = S(0);
  for (std::size_t i = 0; i < view.size(); ++i) {
    const RangeTo<S, D>& r = view[i];
    const Vec<S, D> anchor = r.anchor - center;
    const PseudorangePrediction<S, D> predicted = predict_pseudorange(position, state[D], anchor);
    const S weight = S(1) / (r.sigma * r.sigma);
    const S residual = (r.range - mean) - predicted.pseudorange;
    const S weighted = residual * weight;
    add_outer(normal.information, predicted.gradient, weight);
    normal.gradient += weighted * predicted.gradient;
    normal.chi_squared += weighted * residual;
    const S range = predicted.pseudorange - state[D];
    const S bend = range > S(0) ? weighted / range : S(0);
    Vec<S, D + 1> direction = predicted.gradient;
    direction[D] = S(0);
    add_outer(normal.hessian, direction, bend);
    curvature += bend;
  }
  normal.hessian += normal.information;
  for (int i = 0; i < D; ++i) normal.hessian(i, i) -= curvature;
  return normal;
}

/// Position and bias from checked pseudoranges, mirror images settled. O(n·D²) an iteration, at
/// most two descents, no allocation.
/// Errors: Error::DegenerateGeometry; Error::InconsistentRanges, no root with positive ranges;
/// Error::AmbiguousSolution; Error::NotConverged; Error::NumericOverflow.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] Result<BiasedFix<S, D>> solve_pseudoranges(const V& view,
                                                         const LocateOptions<S, D>& options) {
  constexpr int kIterations = 100;
  const Result<PseudorangeRoots<S, D>> roots = pseudorange_roots<S, D>(view);
  if (!roots) return std::unexpected(roots.error());
  if (roots->count == 0) return std::unexpected(Error::InconsistentRanges);
  const S rounding = S(4) * std::numeric_limits<S>::epsilon() * roots->largest;
  const auto from = [&](const Vec<S, D + 1>& start) {
    const auto evaluate = [&](const Vec<S, D + 1>& state) {
      return pseudorange_normal<S, D>(view, roots->center, roots->mean_pseudorange, state);
    };
    return minimise<S, D + 1>(evaluate, start, rounding, kIterations);
  };
  const int freedom = static_cast<int>(view.size()) - (D + 1);
  // The refined root is near its minimum unless noise has sent it astray, which shows in a χ² that
  // is not believable.
  const auto settle = [&](int i) {
    Result<Minimum<S, D + 1>> minimum = from(refined_candidate<S, D>(view, *roots, i));
    if (minimum && is_believable(minimum->chi_squared, freedom)) return minimum;
    const Result<Minimum<S, D + 1>> again = from(roots->candidates[i]);
    if (!minimum || (again && again->chi_squared < minimum->chi_squared)) minimum = again;
    return minimum;
  };
  Result<Minimum<S, D + 1>> found = settle(0);
  if (roots->count == 2) {
    LocateOptions<S, D> relative = options;
    if (relative.prior) *relative.prior -= roots->center;
    S noise = S(0);
    for (std::size_t i = 0; i < view.size(); ++i) {
      const S normalised = rounding / view[i].sigma;
      noise += normalised * normalised;
    }
    found = settle_images<S, D, D + 1>(found, settle(1), relative, freedom, roots->largest, noise);
  }
  if (!found) return std::unexpected(found.error());

  const Ldlt<S, D + 1> factor{found->information};
  if (!factor.positive_definite()) return std::unexpected(Error::DegenerateGeometry);
  BiasedFix<S, D> fix;
  for (int k = 0; k < D; ++k) fix.position[k] = roots->center[k] + found->state[k];
  fix.bias = roots->mean_pseudorange + found->state[D];
  fix.covariance = factor.inverse();
  fix.chi_squared =
      pseudorange_normal<S, D>(view, roots->center, roots->mean_pseudorange, found->state)
          .chi_squared;
  fix.degrees_of_freedom = freedom;
  if (!all_finite(fix.position) || !std::isfinite(fix.bias) || !all_finite(fix.covariance) ||
      !std::isfinite(fix.chi_squared)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return fix;
}

/// Position and common bias [m] from n ≥ D + 1 pseudoranges: `RangeTo` whose ranges are distances
/// plus one unknown bias, of either sign. Mirror images as in `locate`. No allocation.
/// Errors: Error::TooFewMeasurements, Error::TooManyMeasurements, Error::NotFinite,
/// Error::NonPositiveSigma; those of `solve_pseudoranges`.
template <RangeSet R>
[[nodiscard]] auto locate_with_bias(
    const R& pseudoranges,
    const std::type_identity_t<LocateOptions<RangeSetScalar<R>, kRangeSetDimension<R>>>& options =
        {}) -> Result<BiasedFix<RangeSetScalar<R>, kRangeSetDimension<R>>> {
  using S = RangeSetScalar<R>;
  constexpr int D = kRangeSetDimension<R>;
  const RangeSpan<S, D> span = as_range_span(pseudoranges);
  if (const auto error = check_range_values<S, D>(span, D + 1)) return std::unexpected(*error);
  if (const auto error = check_options(options)) return std::unexpected(*error);
  return solve_pseudoranges<S, D>(span, options);
}

}  // namespace uwbpos
