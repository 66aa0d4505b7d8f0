// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The range from a tag on the arm l of a level body at p with heading ψ, for solver and bound:
/// model/range.hpp through the chain rule of model/lever_arm.hpp. With r = R(ψ) l and r' = ∂r/∂ψ,
/// r turned by +90° in plan,
/// \f[ h(p, \psi) = \lVert p + r - a \rVert, \qquad
///     \frac{\partial h}{\partial p} = g^T = \frac{(p + r - a)^T}{h}, \qquad
///     \frac{\partial h}{\partial \psi} = g^T r'. \f]

#include "uwbpos/model/lever_arm.hpp"
#include "uwbpos/model/range.hpp"

namespace uwbpos {

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
  prediction.heading_gradient = heading_gradient(prediction.arm, range.gradient);
  return prediction;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
