// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What a tag on a lever arm tells about the body that carries it: the chain rule from the tag's
/// place to the body's pose. With p the body's origin, R its orientation, l the arm in its frame
/// and r = R l, the tag is at p + r; a turn θ of the body in axes of the map moves it by θ × r, so
/// that anything of gradient g with respect to the tag's place has
/// \f[ \partial h / \partial p = g^T, \qquad
///     \partial h / \partial \theta = g^T (\theta \times r)_\theta = (r \times g)^T. \f]

#include "uwbpos/core/linalg.hpp"

namespace uwbpos {

/// r × g: the gradient with respect to a small turn of the body in axes of the map [1/rad × unit
/// of h]. `arm`: r [m] in axes of the map; `gradient`: g. No allocation.
template <class S>
[[nodiscard]] Vec<S, 3> turn_gradient(const Vec<S, 3>& arm, const Vec<S, 3>& gradient) {
  return {arm[1] * gradient[2] - arm[2] * gradient[1], arm[2] * gradient[0] - arm[0] * gradient[2],
          arm[0] * gradient[1] - arm[1] * gradient[0]};
}

/// The third of these alone: the gradient with respect to the heading of a planar body.
template <class S>
[[nodiscard]] S heading_gradient(const Vec<S, 3>& arm, const Vec<S, 3>& gradient) {
  return arm[0] * gradient[1] - arm[1] * gradient[0];
}

}  // namespace uwbpos
