// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The range-difference model of any two anchors a, b:
/// \f[ h(p) = |p - b| - |p - a|, \qquad \partial h / \partial p = (g_b - g_a)^T, \f]
/// g the unit vectors of model/range.hpp.

#include "uwbpos/model/range.hpp"

namespace uwbpos {

/// A predicted difference [m] and its gradient with respect to the position.
template <class S, int D>
struct RangeDifferencePrediction {
  S difference;        ///< |p − b| − |p − a| [m]
  Vec<S, D> gradient;  ///< g_b − g_a
};

/// Predicts |`position` − `anchor_b`| − |`position` − `anchor_a`| [m]. O(D), no allocation.
template <class S, int D>
[[nodiscard]] RangeDifferencePrediction<S, D> predict_range_difference(const Vec<S, D>& position,
                                                                       const Vec<S, D>& anchor_a,
                                                                       const Vec<S, D>& anchor_b) {
  const RangePrediction<S, D> a = predict_range(position, anchor_a);
  const RangePrediction<S, D> b = predict_range(position, anchor_b);
  return {b.range - a.range, b.gradient - a.gradient};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
