// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Angles on the circle.

#include <cmath>
#include <numbers>

#include "uwbpos/core/trigonometry.hpp"

namespace uwbpos {

/// `angle` [rad] brought into (−π, π]. NaN and infinity give NaN. O(1), no allocation.
template <class S>
[[nodiscard]] S wrap_angle(S angle) {
  constexpr S pi = std::numbers::pi_v<S>;
  const S wrapped = std::remainder(angle, 2 * pi);
  return wrapped <= -pi ? pi : wrapped;
}

/// Where (`x`, `y`) points, from +x counter-clockwise, in (−π, π] [rad]. One arctangent, no
/// allocation.
template <class S>
[[nodiscard]] S direction_of(S x, S y) {
  constexpr S pi = std::numbers::pi_v<S>;
  const S angle = arctangent(y, x);
  return angle <= -pi ? pi : angle;
}

/// Smallest turn [rad] from `from` to `to`, in (−π, π].
template <class S>
[[nodiscard]] S angle_difference(S to, S from) {
  return wrap_angle(to - from);
}

/// The variance of a direction of which nothing is known, π²/3 [rad²]: no estimate of one says
/// anything beyond it.
template <class S>
inline constexpr S kAnyDirectionVariance = std::numbers::pi_v<S> * std::numbers::pi_v<S> / S(3);

/// Degrees in radians.
template <class S>
[[nodiscard]] constexpr S degrees_to_radians(S degrees) {
  return degrees * (std::numbers::pi_v<S> / S(180));
}

/// Radians in degrees.
template <class S>
[[nodiscard]] constexpr S radians_to_degrees(S radians) {
  return radians * (S(180) / std::numbers::pi_v<S>);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
