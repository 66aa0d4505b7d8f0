// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// One shot of ultrasound by the two methods that FSRI is measured against (003): circles or
/// spheres around the receivers, the lag taken for a constant (conventional), and hyperbolas or
/// hyperboloids, the lag found beside the position but not held against anything (time difference).
/// Also the checks that all three share.

#include <algorithm>
#include <array>

#include "uwbpos/solve/fsri_options.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/receiver_array.hpp"

namespace uwbpos {

/// The options with nothing left open. O(1), no allocation.
/// Errors: Error::NotFinite; Error::InvalidOption, a wavelength or prior sigma that is not
/// positive, a negative longest lag, a largest repair not in 0 … 8; Error::NonPositiveSigma.
template <class S, int D>
[[nodiscard]] Result<FsriOptions<S, D>> resolve_fsri_options(FsriOptions<S, D> options) {
  if (!options.max_lag) options.max_lag = S(5) * options.wavelength;
  if (!options.sigma) options.sigma = options.wavelength / S(100);
  if (!std::isfinite(options.wavelength) || !std::isfinite(*options.max_lag) ||
      !std::isfinite(*options.sigma) || !std::isfinite(options.prior_sigma)) {
    return std::unexpected(Error::NotFinite);
  }
  if (const auto error = check_options<S, D>({options.side, options.prior})) {
    return std::unexpected(*error);
  }
  constexpr int kMostRepair = 8;
  if (!(options.wavelength > S(0)) || !(*options.max_lag >= S(0)) ||
      !(options.prior_sigma >= kSmallestSigma<S>) || options.max_repair < 0 ||
      options.max_repair > kMostRepair) {
    return std::unexpected(Error::InvalidOption);
  }
  if (!(*options.sigma >= kSmallestSigma<S>)) return std::unexpected(Error::NonPositiveSigma);
  return options;
}

/// The first thing wrong with receivers and lengths, or nothing. O(n), no allocation.
/// Errors: Error::TooFewMeasurements below `at_least`, or unequal numbers of both;
/// Error::TooManyMeasurements above `kMaxFsriReceivers`; Error::NotFinite; Error::NegativeRange, a
/// length that is not above zero.
template <class S, int D>
[[nodiscard]] std::optional<Error> check_shot(std::span<const Vec<S, D>> receivers,
                                              std::span<const S> lengths, int at_least) {
  if (lengths.size() < static_cast<std::size_t>(at_least) || receivers.size() != lengths.size()) {
    return Error::TooFewMeasurements;
  }
  if (lengths.size() > kMaxFsriReceivers) return Error::TooManyMeasurements;
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    if (!all_finite(receivers[i]) || !std::isfinite(lengths[i])) return Error::NotFinite;
  }
  for (const S length : lengths) {
    if (!(length > S(0))) return Error::NegativeRange;
  }
  return std::nullopt;
}

/// Lengths as the solvers' insides take them. O(1).
template <class S, std::ranges::contiguous_range L>
[[nodiscard]] constexpr std::span<const S> as_length_span(const L& lengths) {
  return {std::ranges::data(lengths), std::ranges::size(lengths)};
}

/// A shot as ranges, and which of two mirror images is meant.
template <class S, int D>
struct ShotRanges {
  std::array<RangeTo<S, D>, kMaxFsriReceivers> ranges;  ///< the first `count`
  std::size_t count;                                    ///< how many
  LocateOptions<S, D> side;                             ///< of a flat array

  /// The ranges that there are.
  [[nodiscard]] RangeSpan<S, D> span() const { return {ranges.data(), count}; }
};

/// Checks a shot and takes `lag` off its lengths. O(n²), no allocation.
/// Errors: those of `resolve_fsri_options`, `check_shot`, `ReceiverArray::make`.
template <class S, int D>
[[nodiscard]] Result<ShotRanges<S, D>> shot_ranges(std::span<const Vec<S, D>> receivers,
                                                   std::span<const S> lengths, S lag,
                                                   const FsriOptions<S, D>& given, int at_least) {
  const Result<FsriOptions<S, D>> options = resolve_fsri_options(given);
  if (!options) return std::unexpected(options.error());
  if (const auto error = check_shot<S, D>(receivers, lengths, at_least)) {
    return std::unexpected(*error);
  }
  ShotRanges<S, D> shot{{}, lengths.size(), {options->side, options->prior}};
  const auto array = ReceiverArray<S, D>::make(receivers, shot.side);
  if (!array) return std::unexpected(array.error());
  if (array->flat) shot.side.side = array->normal;
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    shot.ranges[i] = {receivers[i], lengths[i] - lag, *options->sigma};
  }
  return shot;
}

/// Position [m] by the conventional method: n ≥ D `lengths` [m] to `receivers` [m], equally many,
/// each taken to be `lag` [m] too long. The error is about that of the lag, times the dilution. Of
/// `options` side, prior and sigma are heard. No allocation.
/// Errors: those of `resolve_fsri_options`, `check_shot`, `ReceiverArray::make` and `locate`;
/// Error::NotFinite, the lag; Error::NegativeRange, a length shorter than it.
template <ReceiverSet R, std::ranges::contiguous_range L>
[[nodiscard]] auto locate_conventional(const R& receivers, const L& lengths,
                                       std::type_identity_t<ReceiverScalar<R>> lag = 0,
                                       const std::type_identity_t<FsriOptionsOf<R>>& options = {})
    -> Result<Fix<ReceiverScalar<R>, kReceiverDimension<R>>> {
  using S = ReceiverScalar<R>;
  constexpr int D = kReceiverDimension<R>;
  if (!std::isfinite(lag)) return std::unexpected(Error::NotFinite);
  const auto shot =
      shot_ranges<S, D>(as_receiver_span(receivers), as_length_span<S>(lengths), lag, options, D);
  if (!shot) return std::unexpected(shot.error());
  for (const RangeTo<S, D>& r : shot->span()) {
    if (r.range < S(0)) return std::unexpected(Error::NegativeRange);
  }
  return locate(shot->span(), shot->side);
}

/// Position and lag [m] by time differences: n ≥ D + 1 lengths as they are, the lag free, of either
/// sign and any size. Arguments as those of `locate_conventional`. No allocation.
/// Errors: those of `resolve_fsri_options`, `check_shot`, `ReceiverArray::make`,
/// `locate_with_bias`.
template <ReceiverSet R, std::ranges::contiguous_range L>
[[nodiscard]] auto locate_time_difference(
    const R& receivers, const L& lengths,
    const std::type_identity_t<FsriOptionsOf<R>>& options = {})
    -> Result<BiasedFix<ReceiverScalar<R>, kReceiverDimension<R>>> {
  using S = ReceiverScalar<R>;
  constexpr int D = kReceiverDimension<R>;
  const auto shot = shot_ranges<S, D>(as_receiver_span(receivers), as_length_span<S>(lengths), S(0),
                                      options, D + 1);
  if (!shot) return std::unexpected(shot.error());
  return locate_with_bias(shot->span(), shot->side);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
