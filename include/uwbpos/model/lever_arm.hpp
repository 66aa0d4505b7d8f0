// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a tag on a lever arm tells about the body that carries it: the chain rule from the tag's
/// place to the body's pose. With p the body's origin, R its orientation, l the arm in its frame
/// and r = R l, the tag is at p + r; a turn θ of the body in axes of the map moves it by θ × r, so
/// that anything of gradient g with respect to the tag's place has
/// \f[ \partial h / \partial p = g^T, \qquad
///     \partial h / \partial \theta = g^T (\theta \times r)_\theta = (r \times g)^T. \f]

#include <cmath>

#include "uwbpos/core/linalg.hpp"
#include "uwbpos/core/trigonometry.hpp"

namespace uwbpos {

/// A heading ψ as what turns vectors: R(ψ), about z.
template <class S>
struct Turn {
  S cosine;  ///< of the heading
  S sine;    ///< of the heading
};

/// The turn by `heading` [rad]. A sine and a cosine, whose last bits differ by C library in double.
template <class S>
[[nodiscard]] Turn<S> turn_of(S heading) {
  return {cosine(heading), sine(heading)};
}

/// R(ψ) v: the vector `v` of a level body, in axes of the map; z stays. No allocation.
template <class S, int D>
[[nodiscard]] Vec<S, D> turned(const Turn<S>& turn, const Vec<S, D>& v) {
  Vec<S, D> result = v;
  result[0] = turn.cosine * v[0] - turn.sine * v[1];
  result[1] = turn.sine * v[0] + turn.cosine * v[1];
  return result;
}

/// r × g: the gradient with respect to a small turn of the body in axes of the map [1/rad × unit
/// of h]. `arm`: r [m] in axes of the map; `gradient`: g. No allocation.
template <class S>
[[nodiscard]] Vec<S, 3> turn_gradient(const Vec<S, 3>& arm, const Vec<S, 3>& gradient) {
  return {arm[1] * gradient[2] - arm[2] * gradient[1], arm[2] * gradient[0] - arm[0] * gradient[2],
          arm[0] * gradient[1] - arm[1] * gradient[0]};
}

/// The third of these alone: the gradient with respect to the heading of a level body.
template <class S, int D>
[[nodiscard]] S heading_gradient(const Vec<S, D>& arm, const Vec<S, D>& gradient) {
  return arm[0] * gradient[1] - arm[1] * gradient[0];
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
