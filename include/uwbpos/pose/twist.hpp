// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Velocity and turn rate between two poses Δt apart. Source: posture of a mobile robot (002).
/// \f[ v = \Delta p / \Delta t, \qquad v_b = R(-\psi_m)\, v, \qquad
///     \omega = \operatorname{wrap}(\Delta\psi) / \Delta t, \qquad
///     \psi_m = \psi_1 + \tfrac12 \operatorname{wrap}(\Delta\psi) \qquad (1) \f]
/// On an arc of constant speed and turn rate the chord points along the mid heading: then v_b has
/// no sideways part, and is the speed but for the factor sin(Δψ/2)/(Δψ/2). Covariances to first
/// order, from poses whose errors are independent of each other.

#include <cmath>
#include <type_traits>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/core/trigonometry.hpp"
#include "uwbpos/pose/check_pose.hpp"

namespace uwbpos {

/// Motion in the plane, seen from the map and from the body.
template <class S>
struct Twist2 {
  Vec<S, 2> global_velocity;    ///< along the map's axes [m/s]
  Vec<S, 2> body_velocity;      ///< forward and to the left, at the mid heading [m/s]
  S turn_rate;                  ///< counter-clockwise [rad/s]
  Mat<S, 3> global_covariance;  ///< of (global velocity, turn rate) [m²/s², m·rad/s², rad²/s²]
  Mat<S, 3> body_covariance;    ///< of (body velocity, turn rate)
};

/// The mean motion from `first` to `second`, `dt` [s] later; a turn by more than half a circle in
/// between cannot be told from the shorter way. One sine and cosine; no allocation.
/// Errors: Error::NotFinite; Error::InvalidCovariance; Error::TimeNotIncreasing, `dt` of zero or
/// less; Error::NumericOverflow, a `dt` so short that the result is not finite.
template <class S>
[[nodiscard]] Result<Twist2<S>> twist_between(const Pose2<S>& first, const Pose2<S>& second,
                                              std::type_identity_t<S> dt) {
  if (const auto error = check_pose(first)) return std::unexpected(*error);
  if (const auto error = check_pose(second)) return std::unexpected(*error);
  if (!std::isfinite(dt)) return std::unexpected(Error::NotFinite);
  if (!(dt > S(0))) return std::unexpected(Error::TimeNotIncreasing);

  const S turn = angle_difference(second.heading, first.heading);
  const S middle = first.heading + turn / 2;
  const S c = cosine(middle);
  const S s = sine(middle);
  Twist2<S> twist;
  twist.global_velocity = (second.position - first.position) / dt;  // (1)
  const Vec<S, 2>& v = twist.global_velocity;
  twist.body_velocity = {c * v[0] + s * v[1], c * v[1] - s * v[0]};
  twist.turn_rate = turn / dt;

  // ∂(v, ω)/∂pose is ±I/Δt.
  twist.global_covariance =
      without_rounding<S, 3>((first.covariance + second.covariance) / (dt * dt));
  // A turn of the mid heading by δ turns v_b by −δ: ∂v_b/∂ψ = (v_b,y, −v_b,x)/2 for either pose.
  const auto jacobian = [&](S sign) {
    const S rate = sign / dt;
    Mat<S, 3> j = Mat<S, 3>::Zero();
    j(0, 0) = rate * c;
    j(0, 1) = rate * s;
    j(1, 0) = -rate * s;
    j(1, 1) = rate * c;
    j(0, 2) = twist.body_velocity[1] / 2;
    j(1, 2) = -twist.body_velocity[0] / 2;
    j(2, 2) = rate;
    return j;
  };
  const Mat<S, 3> of_first = congruence(jacobian(S(-1)), first.covariance);
  twist.body_covariance =
      without_rounding<S, 3>(of_first + congruence(jacobian(S(1)), second.covariance));
  if (!all_finite(twist.body_velocity) || !std::isfinite(twist.turn_rate) ||
      !all_finite(twist.global_covariance) || !all_finite(twist.body_covariance)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return twist;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
