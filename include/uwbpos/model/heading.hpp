// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The heading model: the direction in plan of a body's forward axis f = R e_x,
/// \f[ h(R) = \operatorname{atan2}(f_y, f_x), \qquad
///     \frac{\partial h}{\partial \theta} = \frac{(-f_x f_z,\; -f_y f_z,\; f_x^2 + f_y^2)}
///     {f_x^2 + f_y^2} \f]
/// for a small turn θ of the body in axes of the map.

#include <cmath>

#include "uwbpos/core/linalg.hpp"
#include "uwbpos/core/trigonometry.hpp"

namespace uwbpos {

/// A predicted heading and its gradient with respect to a turn of the body in axes of the map.
template <class S>
struct HeadingPrediction {
  S heading;           ///< from +x counter-clockwise, in [−π, π] [rad]
  Vec<S, 3> gradient;  ///< (−f_x f_z, −f_y f_z, 1 − f_z²)/(1 − f_z²); (0, 0, 1) when level
};

/// Predicts the heading of a body from its unit `forward` axis in the map. Pointing straight up or
/// down it has none: the heading is then zero and the gradient too. O(1), no allocation.
template <class S>
[[nodiscard]] HeadingPrediction<S> predict_heading(const Vec<S, 3>& forward) {
  const S in_plan = forward[0] * forward[0] + forward[1] * forward[1];
  if (!(in_plan > S(1e-6))) return {S(0), Vec<S, 3>::Zero()};
  const S tilt = -forward[2] / in_plan;
  return {arctangent(forward[1], forward[0]), {tilt * forward[0], tilt * forward[1], S(1)}};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
