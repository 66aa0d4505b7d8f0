// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The range from a tag on the arm l of a level body at p with heading ψ, written once for solver,
/// bound and filter. With R(ψ) the turn about z, r = R(ψ) l and r' = ∂r/∂ψ, r turned by +90° in
/// plan,
/// \f[ h(p, \psi) = \lVert p + r - a \rVert, \qquad
///     \frac{\partial h}{\partial p} = g^T = \frac{(p + r - a)^T}{h}, \qquad
///     \frac{\partial h}{\partial \psi} = g^T r'. \f]

#include <cmath>

#include "uwbpos/model/range.hpp"

namespace uwbpos {

/// A heading as what turns vectors.
template <class S>
struct Turn {
  S cosine;  ///< of the heading
  S sine;    ///< of the heading
};

/// The turn by `heading` [rad]. A sine and a cosine, whose last bits differ by C library.
template <class S>
[[nodiscard]] Turn<S> turn_of(S heading) {
  return {std::cos(heading), std::sin(heading)};
}

/// The body's vector `v` in axes of the map. O(1), no allocation.
template <class S, int D>
[[nodiscard]] Vec<S, D> turned(const Turn<S>& turn, const Vec<S, D>& v) {
  Vec<S, D> result = v;  // z stays
  result[0] = turn.cosine * v[0] - turn.sine * v[1];
  result[1] = turn.sine * v[0] + turn.cosine * v[1];
  return result;
}

/// A predicted range, its gradient, and the arm it was seen along.
template <class S, int D>
struct TagRangePrediction {
  S range;             ///< h [m]
  Vec<S, D> gradient;  ///< ∂h/∂p: the unit vector from the anchor to the tag, zero at the anchor
  S heading_gradient;  ///< ∂h/∂ψ [m/rad]
  Vec<S, D> arm;       ///< r, in axes of the map [m]
};

/// Predicts the range from the tag on `lever_arm` of a body at `position`, turned by `turn`, to
/// `anchor` [m]. O(D), no allocation.
template <class S, int D>
[[nodiscard]] TagRangePrediction<S, D> predict_tag_range(const Vec<S, D>& position,
                                                         const Turn<S>& turn,
                                                         const Vec<S, D>& lever_arm,
                                                         const Vec<S, D>& anchor) {
  TagRangePrediction<S, D> prediction;
  prediction.arm = turned<S, D>(turn, lever_arm);
  const RangePrediction<S, D> range =
      predict_range<S, D>(Vec<S, D>{position + prediction.arm}, anchor);
  prediction.range = range.range;
  prediction.gradient = range.gradient;
  prediction.heading_gradient =
      prediction.arm[0] * range.gradient[1] - prediction.arm[1] * range.gradient[0];
  return prediction;
}

}  // namespace uwbpos
