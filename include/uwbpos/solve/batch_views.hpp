// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Measurements of many epochs, as arrays by anchor, so that neighbours in memory are neighbours in
/// a register; and a register full of them as solvers of the clear case read it (solve/batch.hpp).

#include <cstddef>
#include <span>

#include "uwbpos/core/types.hpp"
#include "uwbpos/core/wide.hpp"

namespace uwbpos {

/// Ranges of many epochs to the same n anchors.
template <class S, int D>
struct RangeBatch {
  std::span<const Vec<S, D>> anchors;  ///< n places [m]
  std::span<const S> sigmas;           ///< n standard deviations [m]
  /// Range i of epoch e, of E, at [i · E + e] [m]; not a number where there is none.
  std::span<const S> ranges;
};

/// Range differences of many epochs, |p − aᵢ| − |p − reference|, at the same n anchors.
template <class S, int D>
struct DifferenceBatch {
  Vec<S, D> reference;                 ///< a₀ [m]
  std::span<const Vec<S, D>> anchors;  ///< n places [m]
  S sigma;                             ///< of one arrival [m]
  /// Difference i of epoch e, of E, at [i · E + e] [m]; not a number where there is none.
  std::span<const S> differences;
};

namespace detail {

/// An element of a view that solvers read, for a register full of epochs.
template <class S, int D>
struct WideRange {
  const Vec<S, D>& anchor;  ///< the same for all [m]
  Wide<S> range;            ///< [m]
  S sigma;                  ///< the same for all [m]
};

/// Epochs `begin` … `begin + kLanes` of a `RangeBatch` of `epochs`.
template <class S, int D>
struct WideRanges {
  const RangeBatch<S, D>& batch;  ///< whose
  std::size_t epochs;             ///< how many it has
  std::size_t begin;              ///< the first in the register

  [[nodiscard]] std::size_t size() const { return batch.anchors.size(); }
  /// Where sums begin: as in a single solve, at the first anchor that an epoch has.
  [[nodiscard]] Numbers<Wide<S>, D> first() const {
    std::size_t last = 0;
    while (last + 1 < size() && !is_certain(one(last) > Wide<S>{})) ++last;
    Numbers<Wide<S>, D> place = {};
    for (std::size_t i = last + 1; i-- > 0;) {
      const auto present = one(i) > Wide<S>{};
      for (int k = 0; k < D; ++k) place[k] = present ? Wide<S>{} + batch.anchors[i][k] : place[k];
    }
    return place;
  }
  [[nodiscard]] Wide<S> one(std::size_t i) const {
    const Wide<S> range = load_lanes(&batch.ranges[i * epochs + begin]);
    return is_number(range) ? Wide<S>{} + S(1) : Wide<S>{};
  }
  [[nodiscard, gnu::always_inline]] inline WideRange<S, D> operator[](std::size_t i) const {
    const Wide<S> range = load_lanes(&batch.ranges[i * epochs + begin]);
    // What is not there has no weight; any number does.
    return {batch.anchors[i], is_number(range) ? range : Wide<S>{} + S(1), batch.sigmas[i]};
  }
};

/// The same of a `DifferenceBatch`, as pseudoranges: the reference comes first.
template <class S, int D>
struct WideDifferences {
  const DifferenceBatch<S, D>& batch;  ///< whose
  std::size_t epochs;                  ///< how many it has
  std::size_t begin;                   ///< the first in the register

  [[nodiscard]] std::size_t size() const { return batch.anchors.size() + 1; }
  [[nodiscard]] Wide<S> one(std::size_t i) const {
    if (i == 0) return Wide<S>{} + S(1);
    const Wide<S> d = load_lanes(&batch.differences[(i - 1) * epochs + begin]);
    return is_number(d) ? Wide<S>{} + S(1) : Wide<S>{};
  }
  [[nodiscard, gnu::always_inline]] inline WideRange<S, D> operator[](std::size_t i) const {
    if (i == 0) return {batch.reference, Wide<S>{}, batch.sigma};
    const Wide<S> d = load_lanes(&batch.differences[(i - 1) * epochs + begin]);
    return {batch.anchors[i - 1], is_number(d) ? d : Wide<S>{}, batch.sigma};
  }
};

/// How many elements there are in each lane.
template <class V>
[[nodiscard]] auto how_many(const V& view) {
  auto count = view.one(0);
  for (std::size_t i = 1; i < view.size(); ++i) count += view.one(i);
  return count;
}

}  // namespace detail

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
