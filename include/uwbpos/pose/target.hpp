// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Where a target is as the robot sees it. Source: posture of a mobile robot (002). With Δ from the
/// robot to the target, u = Δ/|Δ| and t = u turned by +90°,
/// \f[ r = |\Delta|, \qquad
///     \beta = \operatorname{wrap}(\operatorname{atan2}(\Delta_y, \Delta_x) - \psi), \qquad
///     \text{ahead} \iff |\beta| \le \pi/2 \qquad (1) \f]
/// \f[ \partial r / \partial(p, \psi) = (-u^T, 0), \qquad
///     \partial \beta / \partial(p, \psi) = (-t^T / r, -1). \qquad (2) \f]

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <type_traits>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/pose/check_pose.hpp"

namespace uwbpos {

/// A target seen from a robot.
template <class S>
struct Target {
  S distance;           ///< [m]
  S bearing;            ///< from the robot's forward axis counter-clockwise, in (−π, π] [rad]
  bool ahead;           ///< |bearing| ≤ π/2; behind otherwise
  S distance_variance;  ///< [m²]
  S bearing_variance;   ///< [rad²]
};

/// Distance and bearing of `target` [m], a known place in the pose's frame. The variances (2) hold
/// while the distance is some standard deviations of the position or more. One arctangent, one
/// root; no allocation.
/// Errors: Error::NotFinite; Error::InvalidCovariance; Error::BearingUndefined, a target on the
/// robot, to rounding or because the position's error across gives the bearing more variance than
/// any direction at all has; Error::NumericOverflow.
template <class S>
[[nodiscard]] Result<Target<S>> bearing_to(const Pose2<S>& pose,
                                           const std::type_identity_t<Vec<S, 2>>& target) {
  if (const auto error = check_pose(pose)) return std::unexpected(*error);
  if (!all_finite(target)) return std::unexpected(Error::NotFinite);
  const Vec<S, 2> offset = target - pose.position;
  const S distance = norm(offset);
  if (!std::isfinite(distance)) return std::unexpected(Error::NumericOverflow);
  const S rounding =
      S(4) * std::numeric_limits<S>::epsilon() * std::max(norm(target), norm(pose.position));
  if (!(distance > rounding)) return std::unexpected(Error::BearingUndefined);

  Target<S> seen;
  seen.distance = distance;
  seen.bearing = wrap_angle(direction_of(offset[0], offset[1]) - pose.heading);
  seen.ahead = std::abs(seen.bearing) <= std::numbers::pi_v<S> / 2;
  const Vec<S, 2> along{-offset[0] / distance, -offset[1] / distance};
  const Vec<S, 2> aside{-along[1] / distance, along[0] / distance};
  const Mat<S, 3>& c = pose.covariance;
  const auto variance = [&](const Vec<S, 2>& row) {
    return row[0] * (row[0] * c(0, 0) + row[1] * (c(0, 1) + c(1, 0))) + row[1] * row[1] * c(1, 1);
  };
  const S across = variance(aside);
  if (across > kAnyDirectionVariance<S>) return std::unexpected(Error::BearingUndefined);
  const S turning = aside[0] * (c(0, 2) + c(2, 0)) + aside[1] * (c(1, 2) + c(2, 1));
  seen.distance_variance = std::max(variance(along), S(0));
  seen.bearing_variance = std::max(across - turning + c(2, 2), S(0));
  if (!std::isfinite(seen.distance_variance) || !std::isfinite(seen.bearing_variance)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return seen;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
