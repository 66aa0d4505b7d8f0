// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Maximum-likelihood position and common bias from pseudoranges: the minimum of
/// \f[ \chi^2(p, b) = \sum (\rho_i - |p - a_i| - b)^2 / \sigma_i^2 \f]
/// by the descents of pseudorange_descent.hpp from the closed form's roots. For range differences
/// against a shared reference it is the minimum with their full Q⁻¹ (model/pseudorange.hpp).

#include "uwbpos/solve/direct_pseudoranges.hpp"
#include "uwbpos/solve/pseudorange_flat.hpp"

namespace uwbpos {

/// The fix at a minimum that `pseudorange_minimum` found. O(D³), no allocation; of flat anchors
/// O(n·D²). Errors: Error::DegenerateGeometry, Error::NumericOverflow.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] Result<BiasedFix<S, D>> biased_fix_at(const V& view,
                                                    const PseudorangeRoots<S, D>& roots,
                                                    const PseudorangeMinimum<S, D>& minimum) {
  const auto fix_of = [&](const PseudorangeProfile<S, D>& profile) {
    return make_biased_fix<S, D>(profile, roots.center, roots.mean_pseudorange, minimum.position,
                                 static_cast<int>(view.size()) - (D + 1));
  };
  if (!roots.flat()) return fix_of(minimum.profile);
  const FlatHeight<S, D + 1> height = height_at<S, D>(view, roots, minimum);
  PseudorangeProfile<S, D> profile = minimum.profile;
  add_outer<S, D>(profile.normal.matrix, roots.across, height.information);
  Result<BiasedFix<S, D>> fix = fix_of(profile);
  if (fix) fix->covariance += height.spread * height.by_square * height.by_square.transpose();
  return fix;
}

/// The fix at the minimum in whose basin root `i` lies. O(n·D²) an iteration, no allocation.
/// Errors: those of `pseudorange_minimum` and `biased_fix_at`.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] Result<BiasedFix<S, D>> minimum_from(const V& view,
                                                   const PseudorangeRoots<S, D>& roots, int i) {
  const Result<PseudorangeMinimum<S, D>> minimum = pseudorange_minimum<S, D>(view, roots, i);
  if (!minimum) return std::unexpected(minimum.error());
  return biased_fix_at<S, D>(view, roots, *minimum);
}

/// The fix one step of Gauss and Newton from root `i`, its χ² what the next step would leave: the
/// minimum but for what noise squared does, at a fifth of its price. O(n·D²), no allocation.
/// Errors: Error::NotConverged, a step of more than a fiftieth of the greatest length;
/// Error::DegenerateGeometry, Error::NumericOverflow.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] Result<BiasedFix<S, D>> step_from(const V& view, const PseudorangeRoots<S, D>& roots,
                                                int i) {
  Vec<S, D> position = roots.candidates[i].template head<D>();
  const auto at = [&] {
    return pseudorange_profile<S, D>(view, roots.center, roots.mean_pseudorange, position,
                                     Curvature::Information, S(0));
  };
  const PseudorangeProfile<S, D> first = at();
  const Ldlt<S, D> factor{first.normal.matrix};
  if (!factor.positive_definite()) return std::unexpected(Error::DegenerateGeometry);
  const Vec<S, D> step = factor.solve(first.normal.gradient);
  constexpr S kFar = S(0.02);
  if (!(norm(step) < kFar * roots.largest)) return std::unexpected(Error::NotConverged);
  position += step;
  const PseudorangeProfile<S, D> second = at();
  Result<BiasedFix<S, D>> fix =
      make_biased_fix<S, D>(second, roots.center, roots.mean_pseudorange, position,
                            static_cast<int>(view.size()) - (D + 1));
  if (!fix) return fix;
  const Mat<S, D> covariance = fix->covariance.template topLeftCorner<D, D>();
  for (int j = 0; j < D; ++j) {
    for (int k = 0; k < D; ++k) {
      fix->chi_squared -= second.normal.gradient[j] * covariance(j, k) * second.normal.gradient[k];
    }
  }
  fix->chi_squared = std::max(fix->chi_squared, S(0));
  return fix;
}

/// Whether a solution in the clear case is the answer, whatever the caller knows. O(1).
template <class S, int D, class Mask, class V>
[[nodiscard]] bool is_answer(const DirectPseudoranges<S, D, Mask>& direct, const V& view) {
  return direct.clear && is_without_doubt(direct.chi_squared, direct.other,
                                          static_cast<int>(view.size()) - (D + 1));
}

/// Position and bias from checked pseudoranges, mirror images settled. O(n·D²) an iteration, at
/// most two descents, no allocation.
/// Errors: Error::DegenerateGeometry; Error::InconsistentRanges, no root with positive ranges;
/// Error::AmbiguousSolution; Error::NotConverged; Error::NumericOverflow.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] Result<BiasedFix<S, D>> solve_pseudoranges(const V& view,
                                                         const LocateOptions<S, D>& options) {
  const Result<PseudorangeRoots<S, D>> roots = pseudorange_roots<S, D>(view);
  if (!roots) return std::unexpected(roots.error());
  const int freedom = static_cast<int>(view.size()) - (D + 1);
  const bool flat = roots->flat();
  Result<PseudorangeMinimum<S, D>> first = std::unexpected(Error::InconsistentRanges);
  if (roots->count > 0) first = pseudorange_minimum<S, D>(view, *roots, 0);
  if (flat && !first) {
    // Beside flat anchors noise sends roots far off: from the middle, aside of it.
    for (const S aside : {S(0.25), S(1), S(0.5), S(0.05)}) {
      Vec<S, D + 1> middle = Vec<S, D + 1>::Zero();
      middle.template head<D>() = aside * roots->largest * roots->across;
      const auto found = descend_pseudoranges<S, D>(view, *roots, middle);
      if (!found || !is_believable(found->profile.normal.chi_squared, freedom)) continue;
      first = found;
      break;
    }
  }
  if (roots->count < 2 && (!flat || !first)) {
    if (!first) return std::unexpected(first.error());
    return biased_fix_at<S, D>(view, *roots, *first);
  }
  // Flat anchors have two images, even where noise leaves one root, in their plane.
  const Result<PseudorangeMinimum<S, D>> second = flat && first
                                                      ? mirror_image<S, D>(*first, roots->across)
                                                      : pseudorange_minimum<S, D>(view, *roots, 1);
  const auto image = [](const Result<PseudorangeMinimum<S, D>>& m) -> Result<Minimum<S, D + 1>> {
    if (!m) return std::unexpected(m.error());
    return with_bias<S, D>(m->profile, m->position);
  };
  LocateOptions<S, D> relative = options;
  if (relative.prior) *relative.prior -= roots->center;
  const S noise = chi_squared_rounding<S>(view, roots->largest);
  const Result<Minimum<S, D + 1>> found = settle_images<S, D, D + 1>(
      image(first), image(second), relative, freedom, roots->largest, noise);
  if (!found) return std::unexpected(found.error());
  const bool is_first = first && found->state.template head<D>() == first->position;
  return biased_fix_at<S, D>(view, *roots, is_first ? *first : *second);
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
  if (is_range_count(span.size(), D + 1) && !check_options(options)) {
    const auto direct = direct_pseudoranges<S, D, S>(span);
    if (is_answer<S, D>(direct, span)) return biased_fix_of<S, D>(direct, span);
  }
  if (const auto error = check_range_values<S, D>(span, D + 1)) return std::unexpected(*error);
  if (const auto error = check_options(options)) return std::unexpected(*error);
  return solve_pseudoranges<S, D>(span, options);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
