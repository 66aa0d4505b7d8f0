// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What solvers accept as range differences: any contiguous range of `DifferenceTo<S, D>` or of
/// `PairDifference<S, D>`, checked once, in one place.

#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <ranges>
#include <span>
#include <type_traits>

#include "uwbpos/model/range_set.hpp"

namespace uwbpos {

/// Scalar and dimension of a difference; empty for any other type.
template <class T>
struct DifferenceTraits {};

/// Those of a difference against a shared reference.
template <class S, int D>
struct DifferenceTraits<DifferenceTo<S, D>> {
  using Scalar = S;                      ///< of all its numbers
  static constexpr int kDimension = D;   ///< of its anchor
  static constexpr bool kShared = true;  ///< one reference for all
};

/// Those of a difference between two anchors of its own.
template <class S, int D>
struct DifferenceTraits<PairDifference<S, D>> {
  using Scalar = S;                       ///< of all its numbers
  static constexpr int kDimension = D;    ///< of its anchors
  static constexpr bool kShared = false;  ///< no reference that others share
};

/// The traits of what a range holds.
template <class R>
using DifferenceTraitsOf = DifferenceTraits<std::remove_cv_t<std::ranges::range_value_t<R>>>;

/// A contiguous, sized range of `DifferenceTo<S, D>`, D = 2 or 3.
template <class R>
concept DifferenceSet =
    std::ranges::contiguous_range<R> && std::ranges::sized_range<R> &&
    DifferenceTraitsOf<R>::kShared &&
    (DifferenceTraitsOf<R>::kDimension == 2 || DifferenceTraitsOf<R>::kDimension == 3);

/// A contiguous, sized range of `PairDifference<S, D>`, D = 2 or 3.
template <class R>
concept PairDifferenceSet =
    std::ranges::contiguous_range<R> && std::ranges::sized_range<R> &&
    !DifferenceTraitsOf<R>::kShared &&
    (DifferenceTraitsOf<R>::kDimension == 2 || DifferenceTraitsOf<R>::kDimension == 3);

/// The scalar of a range of differences.
template <class R>
using DifferenceScalar = typename DifferenceTraitsOf<R>::Scalar;

/// The dimension of a range of differences.
template <class R>
inline constexpr int kDifferenceDimension = DifferenceTraitsOf<R>::kDimension;

/// What the solvers are compiled for: one instantiation per scalar and dimension.
template <class S, int D>
using DifferenceSpan = std::span<const DifferenceTo<S, D>>;

/// The same for differences between pairs.
template <class S, int D>
using PairSpan = std::span<const PairDifference<S, D>>;

/// The one type that the solvers' insides take. O(1).
template <DifferenceSet R>
[[nodiscard]] constexpr auto as_difference_span(const R& differences) {
  return DifferenceSpan<DifferenceScalar<R>, kDifferenceDimension<R>>{
      std::ranges::data(differences), std::ranges::size(differences)};
}

/// The same for differences between pairs. O(1).
template <PairDifferenceSet R>
[[nodiscard]] constexpr auto as_pair_span(const R& differences) {
  return PairSpan<DifferenceScalar<R>, kDifferenceDimension<R>>{std::ranges::data(differences),
                                                                std::ranges::size(differences)};
}

/// How many standard deviations a difference may exceed its baseline by and still be noise.
inline constexpr int kDifferenceSigmas = 5;

/// The first thing wrong with differences against `reference`, or nothing. `sigma`: of one arrival
/// [m]. O(n), no allocation.
/// Error::TooFewMeasurements below `at_least`; Error::TooManyMeasurements above `kMaxMeasurements`;
/// Error::NotFinite; Error::NonPositiveSigma below `kSmallestSigma`; Error::ImpossibleDifference,
/// |d| > |a − a₀| by more than five standard deviations of a difference, √2 σ.
template <class S, int D>
[[nodiscard]] std::optional<Error> check_differences(const Vec<S, D>& reference,
                                                     DifferenceSpan<S, D> differences, S sigma,
                                                     int at_least) {
  if (differences.size() < static_cast<std::size_t>(at_least)) return Error::TooFewMeasurements;
  if (differences.size() > static_cast<std::size_t>(kMaxMeasurements)) {
    return Error::TooManyMeasurements;
  }
  if (!all_finite(reference) || !std::isfinite(sigma)) return Error::NotFinite;
  if (!(sigma >= kSmallestSigma<S>)) return Error::NonPositiveSigma;
  const S slack = S(kDifferenceSigmas) * std::numbers::sqrt2_v<S> * sigma;
  for (const DifferenceTo<S, D>& d : differences) {
    if (!all_finite(d.anchor) || !std::isfinite(d.difference)) return Error::NotFinite;
    const Vec<S, D> baseline = d.anchor - reference;
    if (std::abs(d.difference) > norm(baseline) + slack) return Error::ImpossibleDifference;
  }
  return std::nullopt;
}

/// The same for differences of pairs, each with its own sigma.
template <class S, int D>
[[nodiscard]] std::optional<Error> check_pairs(PairSpan<S, D> pairs, int at_least) {
  if (pairs.size() < static_cast<std::size_t>(at_least)) return Error::TooFewMeasurements;
  if (pairs.size() > static_cast<std::size_t>(kMaxMeasurements)) return Error::TooManyMeasurements;
  for (const PairDifference<S, D>& d : pairs) {
    if (!all_finite(d.anchor_a) || !all_finite(d.anchor_b) || !std::isfinite(d.difference) ||
        !std::isfinite(d.sigma)) {
      return Error::NotFinite;
    }
    if (!(d.sigma >= kSmallestSigma<S>)) return Error::NonPositiveSigma;
    const Vec<S, D> baseline = d.anchor_b - d.anchor_a;
    if (std::abs(d.difference) > norm(baseline) + S(kDifferenceSigmas) * d.sigma) {
      return Error::ImpossibleDifference;
    }
  }
  return std::nullopt;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
