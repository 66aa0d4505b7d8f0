// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What solvers and bounds of poses accept: any contiguous range of `TagRange<S, D>`, checked once,
/// in one place.

#include <cmath>
#include <cstddef>
#include <optional>
#include <ranges>
#include <span>
#include <type_traits>

#include "uwbpos/model/range_set.hpp"

namespace uwbpos {

/// Scalar and dimension of a `TagRange<S, D>`; empty for any other type.
template <class T>
struct TagRangeTraits {};

/// Those of a `TagRange<S, D>`.
template <class S, int D>
struct TagRangeTraits<TagRange<S, D>> {
  using Scalar = S;                     ///< float or double
  static constexpr int kDimension = D;  ///< of the space
};

/// A contiguous, sized range of `TagRange<S, D>` with D = 2 or 3.
template <class R>
concept TagRangeSet =
    std::ranges::contiguous_range<R> && std::ranges::sized_range<R> &&
    (TagRangeTraits<std::remove_cv_t<std::ranges::range_value_t<R>>>::kDimension == 2 ||
     TagRangeTraits<std::remove_cv_t<std::ranges::range_value_t<R>>>::kDimension == 3);

/// S of a range of `TagRange<S, D>`.
template <TagRangeSet R>
using TagRangeScalar =
    typename TagRangeTraits<std::remove_cv_t<std::ranges::range_value_t<R>>>::Scalar;

/// D of a range of `TagRange<S, D>`.
template <TagRangeSet R>
inline constexpr int kTagRangeDimension =
    TagRangeTraits<std::remove_cv_t<std::ranges::range_value_t<R>>>::kDimension;

/// The one type that the insides take.
template <class S, int D>
using TagRangeSpan = std::span<const TagRange<S, D>>;

/// Any `TagRangeSet` as that type. O(1).
template <TagRangeSet R>
[[nodiscard]] constexpr auto as_tag_range_span(const R& ranges) {
  return TagRangeSpan<TagRangeScalar<R>, kTagRangeDimension<R>>{std::ranges::data(ranges),
                                                                std::ranges::size(ranges)};
}

/// The first thing wrong with places and sigmas, or nothing; measured ranges are not looked at.
/// O(n), no allocation. Error::NotFinite; Error::NonPositiveSigma below `kSmallestSigma`.
template <class S, int D>
[[nodiscard]] std::optional<Error> check_tag_links(TagRangeSpan<S, D> ranges) {
  for (const TagRange<S, D>& r : ranges) {
    if (!all_finite(r.lever_arm) || !all_finite(r.anchor) || !std::isfinite(r.sigma)) {
      return Error::NotFinite;
    }
    if (!(r.sigma >= kSmallestSigma<S>)) return Error::NonPositiveSigma;
  }
  return std::nullopt;
}

/// The first thing wrong with a set of ranges, or nothing. O(n), no allocation. Those of
/// `check_tag_links`; Error::TooManyMeasurements above `kMaxMeasurements`; Error::NotFinite;
/// Error::NegativeRange, more than three sigma below zero.
template <class S, int D>
[[nodiscard]] std::optional<Error> check_tag_ranges(TagRangeSpan<S, D> ranges) {
  if (ranges.size() > static_cast<std::size_t>(kMaxMeasurements)) {
    return Error::TooManyMeasurements;
  }
  if (const auto error = check_tag_links<S, D>(ranges)) return error;
  for (const TagRange<S, D>& r : ranges) {
    if (!std::isfinite(r.range)) return Error::NotFinite;
    if (r.range < -S(kNegativeRangeSigmas) * r.sigma) return Error::NegativeRange;
  }
  return std::nullopt;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
