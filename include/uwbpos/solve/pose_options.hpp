// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a caller of `pose_from_ranges` may know and want, and what comes back.

#include <cmath>
#include <optional>
#include <type_traits>

#include "uwbpos/model/tag_range_set.hpp"
#include "uwbpos/solve/mirror_choice.hpp"
#include "uwbpos/solve/robust_loss.hpp"

namespace uwbpos {

/// Knowledge beside the ranges; all of it may be left out.
template <class S, int D>
struct PoseOptions {
  /// The heading [rad] as a compass or the track has it; a variance of zero is exact. With it one
  /// tag is enough.
  std::optional<Measured<S>> heading = std::nullopt;
  /// In space: the height z of the body's origin [m]; a variance of zero is exact.
  std::optional<Measured<S>> height = std::nullopt;
  /// A direction in which the body lies from the anchors, where mirror images are possible.
  Vec<S, D> side = Vec<S, D>::Zero();
  /// A position nearer to the body than to its image [m], such as the last one. Neither it nor
  /// `side` is heard where the images are in one place, to three standard deviations of it, and
  /// differ in heading: `heading` tells those apart.
  std::optional<Vec<S, D>> prior = std::nullopt;
  /// What is made small. A robust loss tries every heading and costs some 50 times as much.
  RobustLoss<S> robust = {};
};

/// `Pose2` in the plane, `LevelPose` in space.
template <class S, int D>
using PoseOf = std::conditional_t<D == 2, Pose2<S>, LevelPose<S>>;

/// A pose, and how well it explains the ranges.
template <class S, int D>
struct PoseFix {
  PoseOf<S, D> pose;       ///< with its covariance
  S chi_squared;           ///< the loss at the pose, knowledge of heading and height included
  int degrees_of_freedom;  ///< ranges and knowledge − unknowns
};

/// The part of a level pose that is in the plane, with its covariance. O(1).
template <class S>
[[nodiscard]] Pose2<S> in_plan(const LevelPose<S>& pose) {
  constexpr int from[3] = {0, 1, 3};
  Pose2<S> plan{pose.position.template head<2>(), pose.heading, {}};
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) plan.covariance(i, j) = pose.covariance(from[i], from[j]);
  }
  return plan;
}

/// The first thing wrong with options, or nothing. O(1). Error::NotFinite; Error::InvalidOption, a
/// negative variance, a height in the plane, a negative tuning.
template <class S, int D>
[[nodiscard]] std::optional<Error> check_options(const PoseOptions<S, D>& options) {
  for (const std::optional<Measured<S>>& known : {options.heading, options.height}) {
    if (!known) continue;
    if (!std::isfinite(known->value) || !std::isfinite(known->variance)) return Error::NotFinite;
    if (known->variance < S(0)) return Error::InvalidOption;
  }
  if (D == 2 && options.height) return Error::InvalidOption;
  if (!std::isfinite(options.robust.tuning)) return Error::NotFinite;
  if (options.robust.tuning < S(0)) return Error::InvalidOption;
  return check_options(LocateOptions<S, D>{options.side, options.prior});
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
