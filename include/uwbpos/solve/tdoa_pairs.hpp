// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Maximum-likelihood position from range differences between any pairs of anchors, which no
/// reference shares: the minimum of
/// \f[ \chi^2(p) = \sum (d_i - |p - b_i| + |p - a_i|)^2 / \sigma_i^2 \qquad (1) \f]
/// by the descent of newton.hpp. Its start: the potentials of pair_potentials.hpp through the
/// closed form of pseudorange_roots.hpp. Pairs too scattered for that are
/// descended from a grid of 5^D places about the anchors' middle.

#include "uwbpos/model/range_difference.hpp"
#include "uwbpos/solve/mirror_choice.hpp"
#include "uwbpos/solve/pair_potentials.hpp"
#include "uwbpos/solve/pseudorange_roots.hpp"

namespace uwbpos {

/// The normal equations of (1) at `position`, relative to `center`. O(n·D²), no allocation.
template <class S, int D>
[[nodiscard]] NormalEquations<S, D> pairs_normal(PairSpan<S, D> pairs, const Vec<S, D>& center,
                                                 const Vec<S, D>& position, Curvature curvature) {
  NormalEquations<S, D> normal;
  S bends = S(0);
  for (const PairDifference<S, D>& d : pairs) {
    const RangePrediction<S, D> a = predict_range<S, D>(position, d.anchor_a - center);
    const RangePrediction<S, D> b = predict_range<S, D>(position, d.anchor_b - center);
    const Vec<S, D> gradient = b.gradient - a.gradient;
    const S weight = S(1) / (d.sigma * d.sigma);
    const S residual = d.difference - (b.range - a.range);
    const S weighted = residual * weight;
    add_outer(normal.matrix, gradient, weight);
    normal.trace += weight * squared_norm(gradient);
    normal.gradient += weighted * gradient;
    normal.chi_squared += weighted * residual;
    if (curvature == Curvature::Information) continue;
    const S bend_a = a.range > S(0) ? -weighted / a.range : S(0);
    const S bend_b = b.range > S(0) ? weighted / b.range : S(0);
    add_outer(normal.matrix, a.gradient, bend_a);
    add_outer(normal.matrix, b.gradient, bend_b);
    bends += bend_a + bend_b;
  }
  for (int i = 0; i < D; ++i) normal.matrix(i, i) -= bends;
  return normal;
}

/// The unit normal of the plane (line in the plane) through `center`, their mean, in which all
/// anchors lie; NaN where they do not, or in fewer dimensions. O(n·D² + D³), no allocation.
template <class S, int D>
[[nodiscard]] Vec<S, D> flat_normal(PairSpan<S, D> pairs, const Vec<S, D>& center) {
  Mat<S, D> scatter = Mat<S, D>::Zero();
  for (const PairDifference<S, D>& d : pairs) {
    add_outer<S, D>(scatter, d.anchor_a - center, S(1));
    add_outer<S, D>(scatter, d.anchor_b - center, S(1));
  }
  const Result<WeakLine<S, D>> line = weak_line<S, D>(scatter, Vec<S, D>::Zero());
  if (line && !(line->information > S(0))) return line->direction;
  return Vec<S, D>::Constant(std::numeric_limits<S>::quiet_NaN());
}

namespace detail {

/// `tdoa_least_squares` for one scalar and dimension.
template <class S, int D>
Result<Fix<S, D>> tdoa_least_squares(PairSpan<S, D> pairs, const LocateOptions<S, D>& options) {
  if (const auto error = check_pairs<S, D>(pairs, D)) return std::unexpected(*error);
  if (const auto error = check_options(options)) return std::unexpected(*error);
  const Result<PairPotentials<S, D>> potentials = pair_potentials<S, D>(pairs);
  if (!potentials) return std::unexpected(potentials.error());

  Vec<S, D> center = Vec<S, D>::Zero();
  for (const PairDifference<S, D>& d : pairs) {
    center += (d.anchor_a + d.anchor_b) / (S(2) * static_cast<S>(pairs.size()));
  }
  S largest = S(0);
  for (const PairDifference<S, D>& d : pairs) {
    largest = std::max(largest, norm<S, D>(d.anchor_a - center));
    largest = std::max(largest, norm<S, D>(d.anchor_b - center));
  }
  const S rounding = S(4) * std::numeric_limits<S>::epsilon() * largest;
  const auto evaluate = [&](const Vec<S, D>& position, Curvature curvature) {
    return pairs_normal<S, D>(pairs, center, position, curvature);
  };
  const int freedom = static_cast<int>(pairs.size()) - D;
  Result<Minimum<S, D>> first = std::unexpected(Error::NotConverged);
  Result<Minimum<S, D>> second = std::unexpected(Error::NotConverged);
  // Keeps the two lowest minima that differ.
  const auto try_from = [&](const Vec<S, D>& start) {
    const Result<Minimum<S, D>> found = minimise<S, D>(evaluate, start, rounding, 100);
    if (!found || !is_determined<S, D>(*found, found->state, largest)) return;
    const auto same = [&](const Result<Minimum<S, D>>& other) {
      return other && norm<S, D>(other->state - found->state) < S(1e-3) * largest;
    };
    if (!first || (found->chi_squared < first->chi_squared && !same(first))) {
      second = first;
      first = found;
    } else if (!same(first) && (!second || found->chi_squared < second->chi_squared)) {
      second = found;
    }
  };

  const RangeSpan<S, D> anchors = potentials->span();
  Result<PseudorangeRoots<S, D>> roots = std::unexpected(Error::TooFewMeasurements);
  if (anchors.size() > static_cast<std::size_t>(D)) roots = pseudorange_roots<S, D>(anchors);
  const auto relative_to_center = [&](const Vec<S, D + 1>& state) {
    Vec<S, D> start;
    for (int k = 0; k < D; ++k) start[k] = state[k] + roots->center[k] - center[k];
    return start;
  };
  for (int i = 0; roots && i < roots->count; ++i) {
    try_from(relative_to_center(refined_candidate<S, D>(anchors, *roots, i)));
  }
  if (options.prior) try_from(*options.prior - center);
  // Flat anchors have two images, even where noise leaves one root, in their plane.
  if (first && !second) {
    if (const Vec<S, D> across = flat_normal<S, D>(pairs, center); all_finite(across)) {
      try_from(first->state - across * (S(2) * dot(across, first->state)));
    }
  }
  if (first && !is_believable(first->chi_squared, freedom)) {
    for (int i = 0; roots && i < roots->count; ++i) {
      try_from(relative_to_center(roots->candidates[i]));
    }
    try_from(Vec<S, D>::Zero());
  }
  if (!first || !potentials->connected) {
    constexpr int kPlaces = D == 2 ? 25 : 125;
    for (int place = 0; place < kPlaces; ++place) {
      Vec<S, D> start;
      for (int k = 0, rest = place; k < D; ++k, rest /= 5) {
        start[k] = largest * (static_cast<S>(rest % 5) / S(4) - S(0.5));
      }
      try_from(start);
    }
  }
  if (!first) return std::unexpected(Error::DegenerateGeometry);

  LocateOptions<S, D> relative = options;
  if (relative.prior) *relative.prior -= center;
  const S noise = chi_squared_rounding(pairs, largest);
  const Result<Minimum<S, D>> found =
      second ? settle_images<S, D, D>(first, second, relative, freedom, largest, noise) : first;
  if (!found) return std::unexpected(found.error());
  const Ldlt<S, D> factor{found->information};
  Fix<S, D> fix{center + found->state, factor.inverse(), found->chi_squared, freedom};
  if (!all_finite(fix.position) || !all_finite(fix.covariance) || !std::isfinite(fix.chi_squared)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return fix;
}

}  // namespace detail

/// Position [m] from n ≥ D differences between pairs of anchors, each with its own sigma and
/// independent noise, with its covariance. Two positions that explain them are settled by
/// `options`. O(n² + n·D²) and at most 5^D + 3 descents; no allocation, about 6 kB of stack in
/// double. Errors: those of `check_pairs`; Error::NotFinite in an option;
/// Error::TooManyMeasurements, more than 64 anchors; Error::DegenerateGeometry;
/// Error::AmbiguousSolution; Error::NotConverged; Error::NumericOverflow.
template <PairDifferenceSet R>
[[nodiscard]] auto tdoa_least_squares(
    const R& differences,
    const std::type_identity_t<LocateOptions<DifferenceScalar<R>, kDifferenceDimension<R>>>&
        options = {}) -> Result<Fix<DifferenceScalar<R>, kDifferenceDimension<R>>> {
  return detail::tdoa_least_squares<DifferenceScalar<R>, kDifferenceDimension<R>>(
      as_pair_span(differences), options);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
