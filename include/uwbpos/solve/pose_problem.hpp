// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Checked ranges and options of a pose, brought into the coordinates of its descent: positions
/// relative to the anchors' centre, the heading as a length, what is known beforehand as an
/// information.

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "uwbpos/core/linalg.hpp"
#include "uwbpos/solve/pose_options.hpp"

namespace uwbpos {

/// One unknown known beforehand: exactly, or with an information to be weighed against the rest.
template <class S>
struct Knowledge {
  bool pinned = false;   ///< to be left at `value`
  S value = S(0);        ///< in units of the state
  S information = S(0);  ///< 1/variance; 0 when nothing is known, or all
};

/// What a descent to a pose works on; positions relative to `center`.
template <class S, int D>
struct PoseProblem {
  TagRangeSpan<S, D> ranges;  ///< checked
  Vec<S, D> center;           ///< mean of the anchors [m]
  S arm;                      ///< L: the longest arm in plan [m], or 1 where all are zero
  S largest;                  ///< the greatest length met [m]: the scale of rounding errors
  RobustLoss<S> robust;       ///< what is made small
  Knowledge<S> heading;       ///< of Lψ, on the circle
  Knowledge<S> height;        ///< of z − center z
};

namespace detail {

/// `known` as the descent takes it, in units of the state; next to the ranges' own information,
/// `most`, knowledge a hundred times sharper is a constant.
template <class S>
Knowledge<S> knowledge_of(const std::optional<Measured<S>>& known, S scale, S origin, S most) {
  if (!known) return {};
  const S information = S(1) / (known->variance * scale * scale);
  const bool pinned = !(information < S(1e4) * most);
  return {pinned, known->value * scale - origin, std::isfinite(information) ? information : S(0)};
}

/// Brings checked input to the anchors' centre. Errors: Error::HeadingUndetermined;
/// Error::DegenerateGeometry; Error::NumericOverflow, also where the longest length leaves nothing
/// of the anchors' distances.
template <class S, int D>
Result<PoseProblem<S, D>> pose_problem(TagRangeSpan<S, D> ranges,
                                       const PoseOptions<S, D>& options) {
  constexpr S kRounding = S(4) * std::numeric_limits<S>::epsilon();
  const auto plan = [](const Vec<S, D>& v) { return Vec<S, 2>{v[0], v[1]}; };
  PoseProblem<S, D> problem{};
  problem.ranges = ranges;
  problem.robust = options.robust;
  const TagRange<S, D>& first = ranges.front();
  Vec<S, D> mean = Vec<S, D>::Zero();
  S arms_apart = S(0);
  S anchors_apart = S(0);
  S information = S(0);
  S shortest = std::abs(first.range);
  S surest = first.sigma;
  for (const TagRange<S, D>& r : ranges) {
    shortest = std::min(shortest, std::abs(r.range));
    surest = std::min(surest, r.sigma);
    mean += r.anchor - first.anchor;
    anchors_apart = std::max(anchors_apart, norm(plan(r.anchor - first.anchor)));
    arms_apart = std::max(arms_apart, norm(plan(r.lever_arm - first.lever_arm)));
    problem.arm = std::max(problem.arm, norm(plan(r.lever_arm)));
    information += S(1) / (r.sigma * r.sigma);
  }
  problem.center = first.anchor + mean / static_cast<S>(ranges.size());
  for (const TagRange<S, D>& r : ranges) {
    problem.largest = std::max({problem.largest, std::abs(r.range), norm(r.lever_arm),
                                norm<S, D>(r.anchor - problem.center)});
  }
  // Squared ranges are weighted by the inverse of their variances.
  const S square = problem.largest * problem.largest + surest * surest;
  if (!std::isfinite(square * square) || !std::isfinite(information)) {
    return std::unexpected(Error::NumericOverflow);
  }
  if (!options.heading) {
    if (!(arms_apart > kRounding * problem.arm)) return std::unexpected(Error::HeadingUndetermined);
    if (!(anchors_apart > kRounding * problem.largest)) {
      return std::unexpected(anchors_apart > kRounding * shortest ? Error::NumericOverflow
                                                                  : Error::DegenerateGeometry);
    }
  }
  if (!(problem.arm > S(0))) problem.arm = S(1);
  problem.heading = knowledge_of(options.heading, problem.arm, S(0), information);
  if constexpr (D == 3) {
    problem.height = knowledge_of(options.height, S(1), problem.center[2], information);
  }
  return problem;
}

}  // namespace detail

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
