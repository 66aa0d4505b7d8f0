// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Pseudoranges to anchors that are flat: the mirror image that every minimum of χ² has, and what
/// is known of the height near the plane (flat_height.hpp).

#include <algorithm>
#include <utility>

#include "uwbpos/solve/flat_height.hpp"
#include "uwbpos/solve/pseudorange_descent.hpp"

namespace uwbpos {

/// What is known of the height of a minimum beside flat anchors, and how place and bias depend on
/// its square. The bias is eliminated first: unit vectors of a tag far off differ by little. O(n·D²
/// + D³), no allocation.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] FlatHeight<S, D + 1> height_at(const V& view, const PseudorangeRoots<S, D>& roots,
                                             const PseudorangeMinimum<S, D>& minimum) {
  constexpr int N = D + 1;  // place, u
  const auto row_of = [&](const auto& r) {
    const auto to = predict_range<S, D>(minimum.position, r.anchor - roots.center);
    Vec<S, N> row;
    for (int k = 0; k < D; ++k) row[k] = to.gradient[k];
    row[D] = S(0.5) / std::max(to.range, r.sigma);
    return std::pair{row,
                     S(((r.range - roots.mean_pseudorange) - to.range) - minimum.profile.bias)};
  };
  const Vec<S, N> first = row_of(view[0]).first;
  Vec<S, N> mean = Vec<S, N>::Zero();  // of what departs from the first
  S total = S(0);
  for (std::size_t i = 0; i < view.size(); ++i) {
    const S weight = S(1) / (view[i].sigma * view[i].sigma);
    mean += weight * (row_of(view[i]).first - first);
    total += weight;
  }
  mean /= total;
  Mat<S, N> normal = Mat<S, N>::Zero();
  Vec<S, N> pull = Vec<S, N>::Zero();
  for (std::size_t i = 0; i < view.size(); ++i) {
    const auto [row, e] = row_of(view[i]);
    const S weight = S(1) / (view[i].sigma * view[i].sigma);
    const Vec<S, N> apart = (row - first) - mean;
    add_outer<S, N>(normal, apart, weight);
    pull += (weight * e) * apart;
  }
  const S height = dot(roots.across, minimum.position);
  const FlatHeight<S, D> of_place = flat_height<S, D, N>(normal, pull, roots.across, height);
  FlatHeight<S, D + 1> known{of_place.information, {}, of_place.spread};
  // δb = −(ḡᵀ δp + t̄ δu).
  S bias = -(first[D] + mean[D]);
  for (int k = 0; k < D; ++k) {
    known.by_square[k] = of_place.by_square[k];
    bias -= (first[k] + mean[k]) * of_place.by_square[k];
  }
  known.by_square[D] = known.spread > S(0) ? bias : S(0);
  return known;
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
