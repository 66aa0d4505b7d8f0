// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A position for a first fix to descend from: that of `locate_excluding`, with lever arms as noise
/// and, in the plane, slant ranges made level.

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>

#include "uwbpos/filter/first_fix_set.hpp"
#include "uwbpos/geometry/height.hpp"
#include "uwbpos/solve/exclude_outliers.hpp"

namespace uwbpos {

/// What is known beforehand.
template <class S, int D>
struct FirstFixOptions {
  S height = S(0);                                    ///< of the body, D = 2 [m]
  LocateOptions<S, D> locate{};                       ///< side or prior, against mirror images
  std::optional<Measured<S>> heading = std::nullopt;  ///< a heading known [rad], [rad²]
  bool wants_heading = false;                         ///< look for one
};

/// A position to descend from [m]. By the ranges if there are enough, else by the newest fourteen
/// differences.
/// Errors: those of `locate`.
template <class S, int D>
[[nodiscard]] Result<Vec<S, D>> first_position(const FirstReadings<S>& set,
                                               const FirstFixOptions<S, D>& options) {
  const bool by_ranges = set.ranges > D || set.ranges == set.count;
  const auto flat = [](const Vec<S, 3>& v) { return Vec<S, D>{v.template head<D>()}; };
  int n = 0;
  ExclusionOptions<S> exclusion;
  if (by_ranges) {
    exclusion.max_excluded = set.count / 3;
    std::array<RangeTo<S, D>, static_cast<std::size_t>(kMaxMeasurements)> ranges;
    for (int i = 0; i < set.count; ++i) {
      const FirstReading<S>& r = set.readings[static_cast<std::size_t>(i)];
      if (r.is_difference) continue;
      const S arm = squared_norm<S, 3>(r.lever);
      RangeTo<S, D> range{flat(r.b), r.value, std::sqrt(r.variance + arm)};
      if constexpr (D == 2) {
        const Result<Measured<S>> level =
            horizontal_range<S>({r.value, r.variance + arm}, r.b[2], options.height + r.lever[2]);
        range.range = level ? level->value : S(0);
        range.sigma = level ? std::sqrt(level->variance) : std::abs(r.b[2] - options.height);
      }
      ranges[static_cast<std::size_t>(n++)] = range;
    }
    const auto fix =
        locate_excluding(std::span<const RangeTo<S, D>>{ranges.data(), static_cast<std::size_t>(n)},
                         options.locate, exclusion);
    if (!fix) return std::unexpected(fix.error());
    return fix->fix.position;
  }
  // The newest will do: what is wanted is a place to start from.
  constexpr int kMost = 14;
  exclusion.max_excluded = std::min(set.count, kMost) / 3;
  std::array<PairDifference<S, D>, static_cast<std::size_t>(kMost)> pairs;
  for (int i = 0; i < set.count && n < kMost; ++i) {
    const FirstReading<S>& r = set.readings[static_cast<std::size_t>(i)];
    if (!r.is_difference) continue;
    const S arm = squared_norm<S, 3>(r.lever);
    pairs[static_cast<std::size_t>(n++)] = {flat(r.a), flat(r.b), r.value,
                                            std::sqrt(r.variance + arm)};
  }
  const auto fix = locate_excluding(
      std::span<const PairDifference<S, D>>{pairs.data(), static_cast<std::size_t>(n)},
      options.locate, exclusion);
  if (fix) return fix->fix.position;
  if constexpr (D == 3) return std::unexpected(fix.error());
  // Heights that the plane leaves out may have made them impossible; the middle will do.
  Vec<S, D> middle = Vec<S, D>::Zero();
  for (int i = 0; i < n; ++i) {
    const PairDifference<S, D>& pair = pairs[static_cast<std::size_t>(i)];
    middle += (pair.anchor_a + pair.anchor_b) / static_cast<S>(2 * n);
  }
  return middle;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
