// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What solvers and bounds accept as ranges: any contiguous range of `RangeTo<S, D>` (array,
/// vector, span), checked once, in one place.

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <ranges>
#include <span>
#include <type_traits>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/linalg.hpp"
#include "uwbpos/core/result.hpp"

namespace uwbpos {

/// Scalar and dimension of a `RangeTo<S, D>`; empty for any other type.
template <class T>
struct RangeToTraits {};

/// Those of a `RangeTo<S, D>`.
template <class S, int D>
struct RangeToTraits<RangeTo<S, D>> {
  using Scalar = S;                     ///< float or double
  static constexpr int kDimension = D;  ///< of the space
};

/// A contiguous, sized range of `RangeTo<S, D>` with D = 2 or 3.
template <class R>
concept RangeSet =
    std::ranges::contiguous_range<R> && std::ranges::sized_range<R> &&
    (RangeToTraits<std::remove_cv_t<std::ranges::range_value_t<R>>>::kDimension == 2 ||
     RangeToTraits<std::remove_cv_t<std::ranges::range_value_t<R>>>::kDimension == 3);

/// S of a range of `RangeTo<S, D>`.
template <RangeSet R>
using RangeSetScalar =
    typename RangeToTraits<std::remove_cv_t<std::ranges::range_value_t<R>>>::Scalar;

/// D of a range of `RangeTo<S, D>`.
template <RangeSet R>
inline constexpr int kRangeSetDimension =
    RangeToTraits<std::remove_cv_t<std::ranges::range_value_t<R>>>::kDimension;

/// What the solvers are compiled for: one instantiation per scalar and dimension.
template <class S, int D>
using RangeSpan = std::span<const RangeTo<S, D>>;

/// The one type that the solvers' insides take. O(1).
template <RangeSet R>
[[nodiscard]] constexpr auto as_range_span(const R& ranges) {
  return RangeSpan<RangeSetScalar<R>, kRangeSetDimension<R>>{std::ranges::data(ranges),
                                                             std::ranges::size(ranges)};
}

/// How many standard deviations below zero a range may lie and still be noise around zero.
inline constexpr int kNegativeRangeSigmas = 3;

/// The smallest standard deviation of a range that is believed [m]; its fourth power is still a
/// normal float.
template <class S>
inline constexpr S kSmallestSigma = S(1e-9);

/// Whether so many measurements are neither too few nor too many.
[[nodiscard]] constexpr bool is_range_count(std::size_t count, int at_least) {
  return count >= static_cast<std::size_t>(at_least) &&
         count <= static_cast<std::size_t>(kMaxMeasurements);
}

/// The first thing wrong with a set of ranges, which may lie `negative_sigmas` below zero, or
/// nothing. O(n), no allocation.
/// Error::TooFewMeasurements below `at_least`, Error::TooManyMeasurements above `kMaxMeasurements`;
/// Error::NotFinite; Error::NonPositiveSigma below `kSmallestSigma`; Error::NegativeRange.
template <class S, int D>
[[nodiscard]] std::optional<Error> check_range_values(
    RangeSpan<S, D> ranges, int at_least, S negative_sigmas = std::numeric_limits<S>::infinity()) {
  if (ranges.size() < static_cast<std::size_t>(at_least)) return Error::TooFewMeasurements;
  if (ranges.size() > static_cast<std::size_t>(kMaxMeasurements)) {
    return Error::TooManyMeasurements;
  }
  for (const RangeTo<S, D>& r : ranges) {
    const S zero = zero_if_finite(r.anchor) + S(0) * r.range + S(0) * r.sigma;
    if (!(zero == S(0))) return Error::NotFinite;
    if (!(r.sigma >= kSmallestSigma<S>)) return Error::NonPositiveSigma;
    if (r.range < -negative_sigmas * r.sigma) return Error::NegativeRange;
  }
  return std::nullopt;
}

/// The same for distances, which lie no more than three sigma below zero.
template <class S, int D>
[[nodiscard]] std::optional<Error> check_ranges(RangeSpan<S, D> ranges, int at_least) {
  return check_range_values<S, D>(ranges, at_least, S(kNegativeRangeSigmas));
}

/// Sum over the ranges of ((range − |position − anchor|) / sigma)². O(n·D), no allocation.
template <class S, int D>
[[nodiscard]] S chi_squared(RangeSpan<S, D> ranges, const Vec<S, D>& position) {
  S sum = S(0);
  for (const RangeTo<S, D>& r : ranges) {
    const Vec<S, D> offset = position - r.anchor;
    const S residual = (r.range - norm(offset)) / r.sigma;
    sum += residual * residual;
  }
  return sum;
}

/// The χ² that rounding alone may leave at the true position when the lengths met reach `largest`
/// [m]: of ranges, pseudoranges or differences, anything with a size and elements with a `sigma`.
/// O(n), no allocation.
template <class S, class V>
[[nodiscard]] S chi_squared_rounding(const V& measurements, S largest) {
  const S length = S(4) * std::numeric_limits<S>::epsilon() * largest;
  S sum = S(0);
  for (std::size_t i = 0; i < measurements.size(); ++i) {
    const S normalised = length / measurements[i].sigma;
    sum += normalised * normalised;
  }
  return sum;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
