// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Pose of a level body from the ranges of its tags, all at once: the minimum over (p, ψ) of
/// \f[ \chi^2(p, \psi) = \sum_i (\rho_i - |p + R(\psi)\, l_i - a_i|)^2 / \sigma_i^2, \f]
/// with the lever arms l, and so the distances between the tags, as knowledge. Source: posture of a
/// mobile robot from two UWB tags (002), which locates each tag and then takes the arctangent.
///
/// The descent of pose_minima.hpp starts at the heading that the caller knows, at that of the
/// linear system of heading_guess.hpp where it is sure, or else at every direction in turn; the
/// minima found are compared, and one is answered only where the ranges, or the caller, tell it
/// from its images: mirrored, or turned by 180°.

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "uwbpos/core/chi_squared.hpp"
#include "uwbpos/solve/pose_minima.hpp"

namespace uwbpos {

namespace detail {

/// The minimum to answer.
template <class S, int D>
Result<Minimum<S, D + 1>> lowest_minimum(const PoseProblem<S, D>& problem,
                                         const PoseOptions<S, D>& options, int freedom) {
  const S rounding = chi_squared_rounding<S>(problem.ranges, problem.largest);
  PoseMinima<S, D> minima;
  std::optional<HeadingGuess<S>> linear;
  if (!problem.heading.pinned) linear = guess_heading(problem);
  std::optional<S> guess;
  if (options.heading) guess = options.heading->value;
  if (linear && !(guess && options.heading->variance < linear->variance)) guess = linear->heading;
  if (guess) descend_at<S, D>(problem, *guess, minima);

  // A heading whose least χ² is so far above the lowest met holds no pose to be answered.
  const bool by_squares = problem.robust.loss == Loss::Squares;
  const auto ruled_out = [&](int k) {
    constexpr S kNeeded = S(30);
    return by_squares && minima.best &&
           rules_out(minima.best->chi_squared, least_chi_squared(problem, linear, k), freedom,
                     kNeeded, rounding);
  };
  bool sure = problem.heading.pinned;
  if (!sure && guess) {
    // Headings within 60° of the guess are taken to lie in its basin.
    constexpr S kNear = S(0.5);
    const Turn<S> at = turn_of(*guess);
    sure = true;
    for (int k = 0; k < kPoseHeadings && sure; ++k) {
      const Turn<S>& turn = kPoseTurns<S>[static_cast<std::size_t>(k)];
      const bool near = at.cosine * turn.cosine + at.sine * turn.sine > kNear;
      sure = near || ruled_out(k);
    }
  }
  for (int k = 0; k < kPoseHeadings && !sure; ++k) {
    if (!ruled_out(k)) descend_at<S, D>(problem, pose_heading<S>(k), minima);
  }
  if (!minima.best || !minima.other) return minima.best;

  // Beside each other on the circle, relative to the anchors' centre, the images are compared.
  const S circle = S(2) * std::numbers::pi_v<S> * problem.arm;
  const S apart = std::remainder(minima.other->state[D] - minima.best->state[D], circle);
  minima.other->state[D] = minima.best->state[D] + apart;
  LocateOptions<S, D> relative{options.side, options.prior};
  if (relative.prior) *relative.prior -= problem.center;
  return settle_images<S, D, D + 1>(minima.best, minima.other, relative, freedom, problem.largest,
                                    rounding);
}

/// The covariance of (p, ψ) at a minimum: the inverse of the information, zero for what is known
/// exactly. Error::DegenerateGeometry.
template <class S, int D>
Result<Mat<S, D + 1>> pose_covariance(PoseProblem<S, D> problem, const Vec<S, D + 1>& state) {
  problem.heading.pinned = problem.heading.pinned && !(problem.heading.information > S(0));
  problem.height.pinned = problem.height.pinned && !(problem.height.information > S(0));
  const Ldlt<S, D + 1> factor{pose_normal<S, D>(problem, state).information};
  if (!factor.positive_definite()) return std::unexpected(Error::DegenerateGeometry);
  Mat<S, D + 1> covariance = factor.inverse();
  for (int k = 0; k <= D; ++k) {
    covariance(D, k) /= problem.arm;
    covariance(k, D) /= problem.arm;
  }
  if (problem.heading.pinned) covariance(D, D) = S(0);
  if (D == 3 && problem.height.pinned) covariance(D - 1, D - 1) = S(0);
  return covariance;
}

/// Whether a pose leaves residuals that sigmas twice as great, and rounding, do not explain.
template <class S, int D>
bool contradicts(TagRangeSpan<S, D> ranges, const PoseFix<S, D>& fix) {
  if (fix.degrees_of_freedom < 1) return false;
  S largest = S(0);
  for (const TagRange<S, D>& r : ranges) {
    largest = std::max({largest, std::abs(r.range), norm(r.anchor), norm(fix.pose.position)});
  }
  const S allowed = S(4) * chi_squared_gate(fix.degrees_of_freedom, S(5));
  return fix.chi_squared > allowed + chi_squared_rounding<S>(ranges, largest);
}

template <class S, int D>
Result<PoseFix<S, D>> solve_pose(TagRangeSpan<S, D> ranges, const PoseOptions<S, D>& options) {
  if (const auto error = check_tag_ranges<S, D>(ranges)) return std::unexpected(*error);
  if (const auto error = check_options(options)) return std::unexpected(*error);
  const int known = (options.heading ? 1 : 0) + (options.height ? 1 : 0);
  const int freedom = static_cast<int>(ranges.size()) + known - (D + 1);
  if (ranges.empty() || freedom < 0) return std::unexpected(Error::TooFewMeasurements);
  const Result<PoseProblem<S, D>> problem = pose_problem(ranges, options);
  if (!problem) return std::unexpected(problem.error());
  const Result<Minimum<S, D + 1>> found = lowest_minimum(*problem, options, freedom);
  if (!found) return std::unexpected(found.error());
  // Five standard deviations, where there is no redundancy to say which range it is.
  if (freedom == 0 && found->chi_squared > S(25)) return std::unexpected(Error::InconsistentRanges);
  const auto covariance = pose_covariance(*problem, found->state);
  if (!covariance) return std::unexpected(covariance.error());

  PoseFix<S, D> fix;
  fix.pose.position = problem->center + found->state.template head<D>();
  fix.pose.heading = wrap_angle(found->state[D] / problem->arm);
  fix.pose.covariance = *covariance;
  fix.chi_squared = found->chi_squared;
  fix.degrees_of_freedom = freedom;
  if (!all_finite(fix.pose.position) || !std::isfinite(fix.pose.heading) ||
      !all_finite(fix.pose.covariance) || !std::isfinite(fix.chi_squared)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return fix;
}

}  // namespace detail

/// Pose of a level body from up to 64 ranges of two tags or more (one, where `options.heading` is
/// given), in the anchors' frame, with χ². Ranges of `TagRange<S, 2>` give (x, y, heading), those
/// of `TagRange<S, 3>` (x, y, z, heading); with `options.height` z is known, and slant ranges need
/// no projection. The pose is that of the origin of the lever arms. Covariance: inverse information
/// of the ranges, weighted as the loss has it. O(n·D²) an evaluation, some 4 as a rule; where the
/// linear system does not settle the heading, or with a robust loss, up to 24 descents. Some 8 kB
/// of stack in double, 4 kB in float, no allocation.
///
/// Errors: those of `check_tag_ranges` (too many, not finite, bad sigma, negative);
/// Error::TooFewMeasurements; Error::NotFinite, Error::InvalidOption for the options;
/// Error::HeadingUndetermined, tags in one place and no heading given; Error::DegenerateGeometry,
/// anchors that do not determine a pose; Error::AmbiguousSolution, two poses that explain the
/// ranges; Error::InconsistentRanges, no pose explains as many ranges as unknowns (with more, χ²
/// tells);
/// Error::NotConverged; Error::NumericOverflow.
template <TagRangeSet R>
[[nodiscard]] auto solve_pose(
    const R& ranges,
    const std::type_identity_t<PoseOptions<TagRangeScalar<R>, kTagRangeDimension<R>>>& options = {})
    -> Result<PoseFix<TagRangeScalar<R>, kTagRangeDimension<R>>> {
  return detail::solve_pose<TagRangeScalar<R>, kTagRangeDimension<R>>(as_tag_range_span(ranges),
                                                                      options);
}

/// The pose alone of `solve_pose`, whose cost and errors are these: a `Pose2` in the plane, a
/// `LevelPose` in space. Where no robust loss is asked for it judges what it does not return:
/// Error::InconsistentRanges also if χ² is beyond five standard deviations for sigmas twice
/// as great, as wrong lever arms, a wrong baseline or an outlier make it.
template <TagRangeSet R>
[[nodiscard]] auto pose_from_ranges(
    const R& ranges,
    const std::type_identity_t<PoseOptions<TagRangeScalar<R>, kTagRangeDimension<R>>>& options = {})
    -> Result<PoseOf<TagRangeScalar<R>, kTagRangeDimension<R>>> {
  const auto fix = solve_pose(ranges, options);
  if (!fix) return std::unexpected(fix.error());
  if (options.robust.loss == Loss::Squares &&
      detail::contradicts(as_tag_range_span(ranges), *fix)) {
    return std::unexpected(Error::InconsistentRanges);
  }
  return fix->pose;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
