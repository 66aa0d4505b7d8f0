// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Pose of a level body from the ranges of its tags, all at once: the minimum over (p, ψ) of
/// \f[ \chi^2(p, \psi) = \sum_i (\rho_i - |p + R(\psi)\, l_i - a_i|)^2 / \sigma_i^2, \f]
/// with the lever arms l, and so the distances between the tags, as knowledge. Source: posture of a
/// mobile robot from two UWB tags (002), which locates each tag and then takes the arctangent.
///
/// The descents are those of pose_minima.hpp; pose_choice.hpp tells which minimum to answer.

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "uwbpos/core/chi_squared.hpp"
#include "uwbpos/solve/pose_choice.hpp"

namespace uwbpos {

namespace detail {

/// The covariance of (p, ψ) at a minimum: the inverse of the information, zero for what is known
/// exactly. Error::DegenerateGeometry.
template <class S, int D>
Result<Mat<S, D + 1>> pose_covariance(PoseProblem<S, D> problem, const Vec<S, D + 1>& state) {
  problem.heading.pinned = problem.heading.pinned && !(problem.heading.information > S(0));
  problem.height.pinned = problem.height.pinned && !(problem.height.information > S(0));
  const Ldlt<S, D + 1> factor{pose_normal<S, D>(problem, state, Curvature::Information).matrix};
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

/// Whether χ² exceeds what chance, as rare as so many standard deviations, and rounding explain.
template <class S, int D>
bool exceeds_chance(TagRangeSpan<S, D> ranges, const PoseFix<S, D>& fix, int sigmas) {
  if (fix.degrees_of_freedom < 1) return false;
  S largest = S(0);
  for (const TagRange<S, D>& r : ranges) {
    largest = std::max({largest, std::abs(r.range), norm(r.anchor), norm(fix.pose.position)});
  }
  const S allowed = chi_squared_gate(fix.degrees_of_freedom, static_cast<S>(sigmas));
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
  if ((*covariance)(D, D) > kAnyDirectionVariance<S>) {
    return std::unexpected(Error::HeadingUndetermined);
  }

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
/// of the ranges, weighted as the loss has it: it is what the sigmas promise, whatever χ² says.
/// O(n·D²) an evaluation, some 4 as a rule; where the linear system does not settle the heading
/// some ten descents, with a robust loss up to 24. Some 8 kB of stack in double, 4 kB in float, no
/// allocation.
///
/// Errors: those of `check_tag_ranges` (too many, not finite, bad sigma, negative);
/// Error::TooFewMeasurements; Error::NotFinite, Error::InvalidOption for the options;
/// Error::HeadingUndetermined, tags in one place, or so near each other that the heading's variance
/// exceeds that of any direction at all; Error::DegenerateGeometry, anchors that do not determine a
/// pose; Error::AmbiguousSolution, two poses of which Δχ² < 9 does not rule out the worse, which
/// may be anywhere: a heading chooses, and a side or a prior
/// where they are in different places; Error::InconsistentRanges, no pose
/// explains as many ranges as unknowns (with more, χ² tells), or two miss them by tens of sigmas;
/// Error::NotConverged; Error::NumericOverflow, also lengths that leave nothing of the anchors'.
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
/// Error::InconsistentRanges also if χ² is beyond chance (`kPoseSigmas`), as wrong lever arms, a
/// wrong baseline, an outlier, or sigmas that leave biases out make it; and where χ² is doubtful
/// (`kPoseDoubtSigmas`) the covariance is `solve_pose`'s times χ² over its degrees of freedom.
///
/// A mistake shows in χ² by the part of it that no pose takes up; with that part's λ, the χ² of the
/// answer is noncentral. Two tags 0.6 m apart and four anchors around, σ 0.1 m: a baseline given as
/// 1 m has λ = 14 and is refused one time in a hundred, as 1.5 m λ = 70 and 98 in a hundred; a
/// range 1 m late likewise. A tag 0.6 m further forward than it is given looks like another heading
/// but for λ = 5, and tags exchanged wholly: no test of the ranges sees those.
template <TagRangeSet R>
[[nodiscard]] auto pose_from_ranges(
    const R& ranges,
    const std::type_identity_t<PoseOptions<TagRangeScalar<R>, kTagRangeDimension<R>>>& options = {})
    -> Result<PoseOf<TagRangeScalar<R>, kTagRangeDimension<R>>> {
  auto fix = solve_pose(ranges, options);
  if (!fix) return std::unexpected(fix.error());
  const auto beyond = [&](int sigmas) {
    return options.robust.loss == Loss::Squares &&
           detail::exceeds_chance(as_tag_range_span(ranges), *fix, sigmas);
  };
  if (beyond(kPoseSigmas)) return std::unexpected(Error::InconsistentRanges);
  if (beyond(kPoseDoubtSigmas)) {
    using S = TagRangeScalar<R>;
    fix->pose.covariance *= fix->chi_squared / static_cast<S>(fix->degrees_of_freedom);
  }
  return fix->pose;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
