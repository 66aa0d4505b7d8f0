// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Pseudoranges to anchors that are flat: the mirror image that every minimum of χ² has, and what
/// is known of the height near the plane (flat_height.hpp).

#include <algorithm>

#include "uwbpos/solve/flat_height.hpp"
#include "uwbpos/solve/pseudorange_descent.hpp"

namespace uwbpos {

/// What is known of the height of a minimum near flat anchors, and how place and bias depend on it.
/// O(n·D² + D³), no allocation.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] FlatHeight<S, D + 1> height_at(const V& view, const PseudorangeRoots<S, D>& roots,
                                             const PseudorangeMinimum<S, D>& minimum) {
  constexpr int N = D + 2;
  Mat<S, N> normal = Mat<S, N>::Zero();
  Vec<S, N> pull = Vec<S, N>::Zero();
  for (std::size_t i = 0; i < view.size(); ++i) {
    const auto& r = view[i];
    const auto to = predict_range<S, D>(minimum.position, r.anchor - roots.center);
    Vec<S, N> row;
    for (int k = 0; k < D; ++k) row[k] = to.gradient[k];
    row[D] = S(1);
    row[D + 1] = S(0.5) / std::max(to.range, r.sigma);
    const S weight = S(1) / (r.sigma * r.sigma);
    add_outer<S, N>(normal, row, weight);
    const S e = ((r.range - roots.mean_pseudorange) - to.range) - minimum.profile.bias;
    pull += row * (weight * e);
  }
  return flat_height<S, D, N>(normal, pull, roots.across, dot(roots.across, minimum.position));
}

/// The mirror image of a minimum of flat anchors, which is another. O(D³).
template <class S, int D>
[[nodiscard]] PseudorangeMinimum<S, D> mirror_image(PseudorangeMinimum<S, D> minimum,
                                                    const Vec<S, D>& across) {
  const auto mirrored = [&](const Vec<S, D>& v) -> Vec<S, D> {
    return v - across * (S(2) * dot(across, v));
  };
  minimum.position = mirrored(minimum.position);
  minimum.profile.mean_gradient = mirrored(minimum.profile.mean_gradient);
  NormalEquations<S, D>& normal = minimum.profile.normal;
  normal.gradient = mirrored(normal.gradient);
  normal.matrix = symmetric_from_lower<S, D>(normal.matrix);
  for (int side = 0; side < 2; ++side) {
    for (int k = 0; k < D; ++k) normal.matrix.col(k) = mirrored(normal.matrix.col(k));
    normal.matrix = normal.matrix.transpose().eval();
  }
  return minimum;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
