// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Ranges that share one unknown bias (a tag's clock, an ultrasonic lag):
/// \f[ h(p, b) = |p - a| + b, \qquad \partial h / \partial (p, b) = (g^T, 1). \f]
/// Range differences against a shared reference are the same thing: with \f$ \rho_0 = 0 \f$ and
/// \f$ \rho_i = d_i \f$, all of standard deviation σ, profiling b out of the pseudoranges leaves
/// exactly the differences' \f$ e^T Q^{-1} e \f$ with \f$ Q = \sigma^2 (I + 1 1^T) \f$.

#include <concepts>

#include "uwbpos/model/difference_set.hpp"
#include "uwbpos/model/range.hpp"

namespace uwbpos {

/// A predicted pseudorange [m] and its gradient with respect to (position, bias).
template <class S, int D>
struct PseudorangePrediction {
  S pseudorange;           ///< |p − a| + b [m]
  Vec<S, D + 1> gradient;  ///< (g, 1)
};

/// Predicts |`position` − `anchor`| + `bias` [m]. O(D), no allocation.
template <class S, int D>
[[nodiscard]] PseudorangePrediction<S, D> predict_pseudorange(const Vec<S, D>& position, S bias,
                                                              const Vec<S, D>& anchor) {
  const RangePrediction<S, D> range = predict_range(position, anchor);
  PseudorangePrediction<S, D> prediction;
  prediction.pseudorange = range.range + bias;
  for (int i = 0; i < D; ++i) prediction.gradient[i] = range.gradient[i];
  prediction.gradient[D] = S(1);
  return prediction;
}

/// What the solvers of pseudoranges read: `size()` entries, each a `RangeTo` whose range is a
/// pseudorange. A span of `RangeTo` is one, a `DifferenceView` another.
template <class V, class S, int D>
concept PseudorangeView = requires(const V& view, std::size_t i) {
  { view.size() } -> std::convertible_to<std::size_t>;
  { view[i] } -> std::convertible_to<RangeTo<S, D>>;
};

/// A pseudorange as a view shows it: what a `RangeTo` holds, the anchor by reference.
template <class S, int D>
struct PseudorangeEntry {
  const Vec<S, D>& anchor;  ///< [m]
  S range;                  ///< the pseudorange [m]
  S sigma;                  ///< standard deviation [m]

  /// A copy.
  operator RangeTo<S, D>() const {  // NOLINT(google-explicit-constructor): it is one
    return {anchor, range, sigma};
  }
};

/// Differences against a shared reference, read as pseudoranges. Refers to the caller's data.
template <class S, int D>
struct DifferenceView {
  Vec<S, D> reference;                              ///< a₀ [m]
  std::span<const DifferenceTo<S, D>> differences;  ///< |p − aᵢ| − |p − a₀| [m]
  S sigma;                                          ///< of one arrival [m]

  /// One more than there are differences: the reference comes first.
  [[nodiscard]] std::size_t size() const { return differences.size() + 1; }
  /// Entry `i` of the pseudoranges.
  [[nodiscard]] PseudorangeEntry<S, D> operator[](std::size_t i) const {
    if (i == 0) return {reference, S(0), sigma};
    return {differences[i - 1].anchor, differences[i - 1].difference, sigma};
  }
};

/// eᵀ Q⁻¹ e of differences against a shared reference at `position`. O(n·D), no allocation.
template <class S, int D>
[[nodiscard]] S difference_chi_squared(const DifferenceView<S, D>& view,
                                       const Vec<S, D>& position) {
  const auto residual = [&](std::size_t i) {
    const auto r = view[i];
    return r.range - predict_range(position, r.anchor).range;
  };
  S mean = S(0);
  for (std::size_t i = 0; i < view.size(); ++i) mean += residual(i);
  mean /= static_cast<S>(view.size());
  S sum = S(0);
  for (std::size_t i = 0; i < view.size(); ++i) {
    const S e = (residual(i) - mean) / view.sigma;
    sum += e * e;
  }
  return sum;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
