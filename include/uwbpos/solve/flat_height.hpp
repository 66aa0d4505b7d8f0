// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// How high a tag is above or below anchors that all lie in one plane (in one line, in the plane).
/// A range depends on the height h by u = h² alone, ∂r/∂u = 1/(2 r), so that near h = 0 no more is
/// known of h to first order: what is known is u ± σ, from a linear solution K of the place x in
/// the plane, what else is unknown, and u. A covariance C of the first order becomes
/// \f[ C + d\,d^T e, \qquad d = K_{xu} / \sigma^2, \qquad (1) \f]
/// with e what u may depart from h² beyond what J says already. Where 4 h² < σ, var h = σ, and e =
/// σ² · σ/(4h² + σ); where the minimum is the plane itself and the linear solution has u < 0, what
/// a normal distribution cut off at zero leaves of it: 2/(2 + 1.1 |z| + z²) to 5 %, z = u/σ.
/// Elsewhere e = 2 (σ²/4h²)², the variance of (δh)².

#include <algorithm>
#include <cmath>
#include <limits>

#include "uwbpos/core/linalg.hpp"

namespace uwbpos {

/// What is known of the height beside flat anchors; of N unknowns, the first D a place.
template <class S, int N>
struct FlatHeight {
  S information = S(0);  ///< of h beside J, zero far from the plane [1/m²]
  Vec<S, N> by_square;   ///< d of (1) [1/m], [1/m] of what is a length
  S spread = S(0);       ///< e of (1) [m⁴]
};

/// (1) at `height` [m] of a minimum. `normal`: Σ w y yᵀ, lower triangle, `pull`: Σ w y e, of rows y
/// that hold the derivatives by the place (D), by what else is unknown, and by u last, and
/// residuals e; `across`: the unit normal. O(N³), no allocation.
template <class S, int D, int N>
[[nodiscard]] FlatHeight<S, N - 1> flat_height(Mat<S, N> normal, const Vec<S, N>& pull,
                                               const Vec<S, D>& across, S height) {
  FlatHeight<S, N - 1> known;
  known.by_square.setZero();
  // What the gradients say along the normal is the same once more: it is taken for known.
  S scale = S(0);
  for (int k = 0; k < D; ++k) scale += normal(k, k);
  for (int j = 0; j < D; ++j) {
    for (int i = j; i < D; ++i) normal(i, j) += scale * across[i] * across[j];
  }
  const Ldlt<S, N> factor{normal};
  if (!factor.positive_definite()) return known;
  const Vec<S, N> column = factor.inverse().col(N - 1);
  const S variance = column[N - 1];
  const S sigma = std::sqrt(variance);
  const S square = S(4) * height * height;
  for (int k = 0; k < N - 1; ++k) known.by_square[k] = column[k] / variance;
  if (square < sigma) {
    known.information = S(1) / sigma;
    const S z = std::min(factor.solve(pull)[N - 1] / sigma, S(0));
    const S left = S(2) / (S(2) - S(1.1) * z + z * z);
    known.spread = variance * left * sigma / (square + sigma);
  } else {
    known.spread = S(2) * (variance / square) * (variance / square);
  }
  return known;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
