// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Maximum-likelihood position from range differences between any pairs of anchors, which no
/// reference shares: the minimum of
/// \f[ \chi^2(p) = \sum (d_i - |p - b_i| + |p - a_i|)^2 / \sigma_i^2 \qquad (1) \f]
/// by the descent of newton.hpp. Its start: pairs that hang together give every anchor a potential,
/// a pseudorange but for a common bias, by least squares over the graph (relaxed a few times);
/// those go through the closed form of pseudorange_roots.hpp. Pairs too scattered for that are
/// descended from a grid of 5^D places about the anchors' middle.

#include <array>

#include "uwbpos/model/range_difference.hpp"
#include "uwbpos/solve/fix.hpp"
#include "uwbpos/solve/mirror_choice.hpp"
#include "uwbpos/solve/pseudorange_roots.hpp"

namespace uwbpos {

template <class S, int D>
using PairSpan = std::span<const PairDifference<S, D>>;

/// The anchors of the largest set of pairs that hang together, as pseudoranges.
template <class S, int D>
struct PairPotentials {
  std::array<RangeTo<S, D>, kMaxMeasurements> anchors;
  std::size_t size = 0;
  bool connected = true;  ///< no pair was left out

  /// The entries in use.
  [[nodiscard]] RangeSpan<S, D> span() const { return {anchors.data(), size}; }
};

/// Potentials of the largest connected set of anchors, relaxed over its pairs. O(n²), about
/// 90 bytes of stack per pair in double, no allocation. Error::TooManyMeasurements, more than
/// `kMaxMeasurements` anchors.
template <class S, int D>
[[nodiscard]] Result<PairPotentials<S, D>> pair_potentials(PairSpan<S, D> pairs) {
  constexpr auto kMost = static_cast<std::size_t>(kMaxMeasurements);
  PairPotentials<S, D> nodes;
  std::array<std::uint8_t, kMost> from;
  std::array<std::uint8_t, kMost> to;
  const auto node_of = [&](const Vec<S, D>& anchor) -> std::size_t {
    for (std::size_t i = 0; i < nodes.size; ++i) {
      if (nodes.anchors[i].anchor == anchor) return i;
    }
    if (nodes.size < kMost) nodes.anchors[nodes.size] = {anchor, S(0), S(1)};
    return nodes.size++;
  };
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    from[i] = static_cast<std::uint8_t>(node_of(pairs[i].anchor_a));
    if (nodes.size > kMost) return std::unexpected(Error::TooManyMeasurements);
    to[i] = static_cast<std::uint8_t>(node_of(pairs[i].anchor_b));
    if (nodes.size > kMost) return std::unexpected(Error::TooManyMeasurements);
  }

  // Connected sets by the smallest node in each, and potentials along the first way found.
  std::array<std::uint8_t, kMost> set{};
  for (std::size_t i = 0; i < nodes.size; ++i) set[i] = static_cast<std::uint8_t>(i);
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const std::size_t a = from[i];
      const std::size_t b = to[i];
      if (set[a] == set[b]) continue;
      changed = true;
      const std::size_t follow = set[a] < set[b] ? b : a;
      const S shift = follow == b
                          ? nodes.anchors[a].range + pairs[i].difference - nodes.anchors[b].range
                          : nodes.anchors[b].range - pairs[i].difference - nodes.anchors[a].range;
      const std::uint8_t old = set[follow];
      const std::uint8_t joined = std::min(set[a], set[b]);
      for (std::size_t j = 0; j < nodes.size; ++j) {
        if (set[j] != old) continue;
        set[j] = joined;
        nodes.anchors[j].range += shift;
      }
    }
  }
  std::array<std::uint8_t, kMost> members{};
  std::size_t largest = 0;
  for (std::size_t i = 0; i < nodes.size; ++i) {
    if (++members[set[i]] > members[largest]) largest = set[i];
  }

  // Half-way to each node's weighted mean over its pairs: converges on every graph.
  for (int sweep = 0; sweep < 8; ++sweep) {
    std::array<S, kMost> sum{};
    std::array<S, kMost> weights{};
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const S w = S(1) / (pairs[i].sigma * pairs[i].sigma);
      const S excess =
          nodes.anchors[from[i]].range + pairs[i].difference - nodes.anchors[to[i]].range;
      sum[to[i]] += w * excess;
      sum[from[i]] -= w * excess;
      weights[to[i]] += w;
      weights[from[i]] += w;
    }
    for (std::size_t i = 0; i < nodes.size; ++i)
      nodes.anchors[i].range += sum[i] / (2 * weights[i]);
  }
  S sigma = S(0);
  for (const PairDifference<S, D>& d : pairs) sigma = std::max(sigma, d.sigma);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < nodes.size; ++i) {
    if (set[i] != largest) continue;
    nodes.anchors[kept] = nodes.anchors[i];
    nodes.anchors[kept++].sigma = sigma;
  }
  nodes.connected = kept == nodes.size;
  nodes.size = kept;
  return nodes;
}

/// The normal equations of (1) at `position`, relative to `center`. O(n·D²), no allocation.
template <class S, int D>
[[nodiscard]] NormalEquations<S, D> pairs_normal(PairSpan<S, D> pairs, const Vec<S, D>& center,
                                                 const Vec<S, D>& position) {
  NormalEquations<S, D> normal;
  S curvature = S(0);
  for (const PairDifference<S, D>& d : pairs) {
    const RangePrediction<S, D> a = predict_range<S, D>(position, d.anchor_a - center);
    const RangePrediction<S, D> b = predict_range<S, D>(position, d.anchor_b - center);
    const Vec<S, D> gradient = b.gradient - a.gradient;
    const S weight = S(1) / (d.sigma * d.sigma);
    const S residual = d.difference - (b.range - a.range);
    const S weighted = residual * weight;
    add_outer(normal.information, gradient, weight);
    normal.gradient += weighted * gradient;
    normal.chi_squared += weighted * residual;
    const S bend_a = a.range > S(0) ? -weighted / a.range : S(0);
    const S bend_b = b.range > S(0) ? weighted / b.range : S(0);
    add_outer(normal.hessian, a.gradient, bend_a);
    add_outer(normal.hessian, b.gradient, bend_b);
    curvature += bend_a + bend_b;
  }
  normal.hessian += normal.information;
  for (int i = 0; i < D; ++i) normal.hessian(i, i) -= curvature;
  return normal;
}

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
  using S = DifferenceScalar<R>;
  constexpr int D = kDifferenceDimension<R>;
  const PairSpan<S, D> pairs{std::ranges::data(differences), std::ranges::size(differences)};
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
  const auto evaluate = [&](const Vec<S, D>& position) {
    return pairs_normal<S, D>(pairs, center, position);
  };
  const int freedom = static_cast<int>(pairs.size()) - D;
  Result<Minimum<S, D>> first = std::unexpected(Error::NotConverged);
  Result<Minimum<S, D>> second = std::unexpected(Error::NotConverged);
  // Keeps the two lowest minima that differ.
  const auto try_from = [&](const Vec<S, D>& start) {
    const Result<Minimum<S, D>> found = minimise<S, D>(evaluate, start, rounding, 100);
    if (!found || !Ldlt<S, D>{found->information}.positive_definite()) return;
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
  if (anchors.size() > static_cast<std::size_t>(D)) {
    if (const auto roots = pseudorange_roots<S, D>(anchors); roots) {
      for (int i = 0; i < roots->count; ++i) {
        const Vec<S, D + 1> state = refined_candidate<S, D>(anchors, *roots, i);
        Vec<S, D> start;
        for (int k = 0; k < D; ++k) start[k] = state[k] + roots->center[k] - center[k];
        try_from(start);
      }
    }
  }
  if (options.prior) try_from(*options.prior - center);
  if (!first || !potentials->connected || !is_believable(first->chi_squared, freedom)) {
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
  S noise = S(0);
  for (const PairDifference<S, D>& d : pairs) noise += (rounding / d.sigma) * (rounding / d.sigma);
  const Result<Minimum<S, D>> found =
      settle_images<S, D, D>(first, second, relative, freedom, largest, noise);
  if (!found) return std::unexpected(found.error());
  const Ldlt<S, D> factor{found->information};
  const Fix<S, D> fix{center + found->state, factor.inverse(), evaluate(found->state).chi_squared,
                      freedom};
  if (!all_finite(fix.position) || !all_finite(fix.covariance) || !std::isfinite(fix.chi_squared)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return fix;
}

}  // namespace uwbpos
