// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The range model, written once for solvers, bounds, filter and simulator:
/// \f[ h(p) = \lVert p - a \rVert, \qquad \partial h / \partial p = (p - a)^T / h(p). \f]

#include "uwbpos/core/linalg.hpp"

namespace uwbpos {

/// A predicted range and its gradient with respect to the position.
template <class S, int D>
struct RangePrediction {
  S range;  ///< [m]
  /// The unit vector from the anchor to the position; zero at the anchor itself, where there is
  /// none.
  Vec<S, D> gradient;
};

/// Predicts the range from `position` to `anchor`, both in one frame [m]. O(D), no allocation.
template <class S, int D>
[[nodiscard]] RangePrediction<S, D> predict_range(const Vec<S, D>& position,
                                                  const Vec<S, D>& anchor) {
  RangePrediction<S, D> prediction;
  const Vec<S, D> offset = position - anchor;
  prediction.range = norm(offset);
  const S inverse = prediction.range > S(0) ? S(1) / prediction.range : S(0);
  prediction.gradient = offset * inverse;
  return prediction;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
