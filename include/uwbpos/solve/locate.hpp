// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The front door: a position from whatever ranges or range differences there are. For ranges it
/// takes the two roots of
/// toa_roots.hpp, descends to the maximum likelihood of toa_least_squares.hpp from each that the
/// measurements leave open, and answers the one that the measurements, or the caller's side or
/// prior position, tell from its mirror image; or says that it cannot.

#include "uwbpos/solve/tdoa_least_squares.hpp"
#include "uwbpos/solve/tdoa_pairs.hpp"
#include "uwbpos/solve/toa_least_squares.hpp"

namespace uwbpos {

namespace detail {

inline constexpr int kLocateIterations = 100;

/// Flat anchors: two images that fit equally well, or the plane itself.
template <class S, int D>
Result<Minimum<S, D>> locate_flat(RangeSpan<S, D> ranges, const ToaRoots<S, D>& roots,
                                  const LocateOptions<S, D>& options) {
  const S sigma = std::sqrt(roots.square_variance);
  const bool exactly_determined = ranges.size() == static_cast<std::size_t>(D);
  if (exactly_determined && roots.square < -(roots.rounding() + S(5) * sigma)) {
    return std::unexpected(Error::InconsistentRanges);
  }
  // Near the plane τ² is known to ± sigma and τ itself not to first order.
  DirectionPrior<S, D> prior;
  prior.point = roots.foot;
  prior.direction = roots.direction;
  prior.information = S(4) * roots.square < sigma ? S(1) / sigma : S(0);

  Vec<S, D> start = roots.foot;
  S towards = S(0);
  if (roots.square > roots.rounding()) {
    const Vec<S, D> root = std::sqrt(roots.square) * roots.direction;
    LocateOptions<S, D> relative = options;
    if (relative.prior) *relative.prior -= roots.center;
    const MirrorChoice choice =
        choose_by_knowledge<S, D>(roots.foot + root, roots.foot - root, relative);
    if (choice != MirrorChoice::Unknown) {
      towards = choice == MirrorChoice::First ? S(1) : S(-1);
    } else if (roots.square > S(0.01) * sigma) {
      return std::unexpected(Error::AmbiguousSolution);
    }
    start += towards * root;
    prior.point = start;
  }
  Result<Minimum<S, D>> descent =
      descend<S, D>(ranges, roots.center, start, roots.largest, kLocateIterations, prior);
  if (descent && towards != S(0)) {
    // A step may cross the plane into the other image: back to the one that was chosen.
    const Vec<S, D> from_foot = descent->state - roots.foot;
    const S height = dot(from_foot, roots.direction);
    if (height * towards < S(0)) descent->state -= S(2) * height * roots.direction;
  }
  return descent;
}

/// Anchors that span the space: one true minimum, and perhaps a second that only noise could hide.
template <class S, int D>
Result<Minimum<S, D>> locate_spanned(RangeSpan<S, D> ranges, const ToaRoots<S, D>& roots,
                                     const LocateOptions<S, D>& options) {
  const auto from = [&](const Vec<S, D>& start) {
    return descend<S, D>(ranges, roots.center, start, roots.largest, kLocateIterations);
  };
  const RootChoice<S> choice = weigh_roots(roots);
  Result<Minimum<S, D>> best = from(roots.foot + choice.likely * roots.direction);
  // The linear system's own Δχ² between the roots: beyond this nothing can turn it round.
  constexpr S kBeyondDoubt = S(100);
  const S doubt = S(4) * roots.linear_information * std::abs(choice.likely * roots.linear);
  if (best && (!choice.two_minima || doubt > kBeyondDoubt)) return best;

  Result<Minimum<S, D>> other = from(roots.foot + choice.other * roots.direction);
  LocateOptions<S, D> relative = options;
  if (relative.prior) *relative.prior -= roots.center;
  return settle_images<S, D, D>(best, other, relative, static_cast<int>(ranges.size()) - D,
                                roots.largest, chi_squared_rounding(ranges, roots.largest));
}

template <class S, int D>
Result<Fix<S, D>> locate_ranges(RangeSpan<S, D> ranges, const LocateOptions<S, D>& options) {
  if (is_range_count(ranges.size(), D) && !check_options(options)) {
    const auto direct = direct_ranges<S, D, S>(ranges);
    const int freedom = static_cast<int>(ranges.size()) - D;
    if (direct.clear && is_without_doubt(direct.chi_squared, direct.other, freedom)) {
      return direct_fix<S, D>(ranges.front().anchor, direct.from_first, direct.covariance,
                              direct.chi_squared, freedom);
    }
  }
  if (const auto error = check_ranges<S, D>(ranges, D)) return std::unexpected(*error);
  if (const auto error = check_options(options)) return std::unexpected(*error);
  const Result<ToaRoots<S, D>> roots = toa_roots<S, D>(ranges);
  if (!roots) return std::unexpected(roots.error());
  const Result<Minimum<S, D>> found = roots->flat() ? locate_flat(ranges, *roots, options)
                                                    : locate_spanned(ranges, *roots, options);
  if (!found) return std::unexpected(found.error());
  // The descent's χ² has what is known of the height of flat anchors in it.
  if (roots->flat())
    return make_fix<S, D>(ranges, roots->center + found->state, found->information);
  return make_fix<S, D>(ranges.size(), roots->center + found->state, found->information,
                        found->chi_squared);
}

}  // namespace detail

/// Position [m] from 2…64 ranges in the plane or 3…64 in space, in the anchors' frame, by maximum
/// likelihood, with its covariance, at the Cramér-Rao bound. Anchors may be anywhere: in general
/// position, on one ceiling, in one row. Two mirror images that the ranges cannot tell apart are
/// settled by `options.side` or `options.prior`. O(n·D²), at most two descents; no allocation.
///
/// Errors: those of `check_ranges` (too few, too many, not finite, bad sigma, negative);
/// Error::NotFinite in an option; Error::DegenerateGeometry, anchors in one point, or in one line
/// in space; Error::AmbiguousSolution, mirror images and neither side nor prior;
/// Error::InconsistentRanges, circles or spheres that miss one another beyond noise and no
/// redundancy to say where; Error::NotConverged; Error::NumericOverflow.
template <RangeSet R>
[[nodiscard]] auto locate(
    const R& ranges,
    const std::type_identity_t<LocateOptions<RangeSetScalar<R>, kRangeSetDimension<R>>>& options =
        {}) -> Result<Fix<RangeSetScalar<R>, kRangeSetDimension<R>>> {
  return detail::locate_ranges<RangeSetScalar<R>, kRangeSetDimension<R>>(as_range_span(ranges),
                                                                         options);
}

/// Position [m] from differences |p − aᵢ| − |p − reference| of arrivals with standard deviation
/// `sigma` [m]: `tdoa_least_squares`, whose errors and cost are these. Takes D + 1…64 differences
/// in general (D where the anchors and the caller's knowledge leave one answer).
template <DifferenceSet R>
[[nodiscard]] auto locate(
    const std::type_identity_t<Vec<DifferenceScalar<R>, kDifferenceDimension<R>>>& reference,
    const R& differences, std::type_identity_t<DifferenceScalar<R>> sigma,
    const std::type_identity_t<LocateOptions<DifferenceScalar<R>, kDifferenceDimension<R>>>&
        options = {}) -> Result<Fix<DifferenceScalar<R>, kDifferenceDimension<R>>> {
  return tdoa_least_squares(reference, differences, sigma, options);
}

/// Position [m] from differences between any pairs of anchors: `tdoa_least_squares` for pairs,
/// whose errors and cost are these.
template <PairDifferenceSet R>
[[nodiscard]] auto locate(
    const R& differences,
    const std::type_identity_t<LocateOptions<DifferenceScalar<R>, kDifferenceDimension<R>>>&
        options = {}) -> Result<Fix<DifferenceScalar<R>, kDifferenceDimension<R>>> {
  return tdoa_least_squares(differences, options);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
