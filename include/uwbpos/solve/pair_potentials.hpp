// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Pseudoranges from range differences between any pairs of anchors: pairs that hang together give
/// every anchor a potential, its range but for a common bias, by weighted least squares over the
/// graph, relaxed a few times.

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "uwbpos/model/difference_set.hpp"

namespace uwbpos {

/// The anchors of the largest set of pairs that hang together, as pseudoranges.
template <class S, int D>
struct PairPotentials {
  std::array<RangeTo<S, D>, kMaxMeasurements> anchors;  ///< the first `size` count
  std::size_t size = 0;                                 ///< entries in use
  bool connected = true;                                ///< no pair was left out

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

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
