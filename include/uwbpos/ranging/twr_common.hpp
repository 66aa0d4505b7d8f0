// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What every method of two-way ranging shares: options, the meaning of their domains, and the
/// last steps from a time of flight in ticks to a range that is returned or refused.
///
/// Initiator A and responder B; T1 … T6 are the stamps of poll, response and final frames:
/// \f$ R_a = T_4 - T_1,\ D_a = T_5 - T_4 \f$ on A's clock,
/// \f$ D_b = T_3 - T_2,\ R_b = T_6 - T_3 \f$ on B's.

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/time/device_time.hpp"

namespace uwbpos {

/// Options of two-way ranging. Seconds, metres, fractions; domains in brackets.
template <class S>
struct TwrOptions {
  /// δ = eB − eA, the responder's rate against the initiator's: carrier offset or `RateTracker`.
  /// Single-sided ranging alone uses it. [|δ| ≤ max_clock_offset]
  S clock_offset{};
  /// Total (transmit + receive) antenna delay of A [s], and below of B. [|d| ≤ 1 ms]
  S antenna_delay_a{};
  S antenna_delay_b{};  ///< Of B.
  /// Standard deviation of the stamp of a reception [s]; departures are taken to be exact, as
  /// scheduled ones are. Where they are as noisy, give √2 of it. [0 < σ ≤ 1 ms]
  S sigma_timestamp = S(0.15e-9);
  /// Ranges beyond are refused [m]. [0 < r ≤ 10 000 km]
  S max_range = S(500);
  /// Two clocks' rates differ by no more than this. [0 < e ≤ 1 %]
  S max_clock_offset = S(80e-6);
  /// [m/s]. [1 ≤ c ≤ 3e8]
  S propagation_speed = kSpeedOfLightAir<S>;
  /// Standard deviation of the error of `clock_offset`; enters the single-sided variance. When no
  /// offset is known, this is the standard deviation of the offset itself. [0 ≤ σ ≤ 1 %]
  S sigma_clock_offset{};
};

namespace detail {

/// Options where none are given: in flash, not built for each call.
template <class S>
inline constexpr TwrOptions<S> kTwrDefaults{};

/// A scalar's bits. As integers, those of numbers that are not negative are in the numbers' order,
/// NaN and infinity above, negative ones above these: to compare bits takes half of what a
/// comparison of scalars takes, and without an FPU a tenth.
template <class S>
constexpr auto bits_of(S value) {
  return std::bit_cast<std::conditional_t<sizeof(S) == 4, std::uint32_t, std::uint64_t>>(value);
}

/// `least` ≤ `value` ≤ `most`, where 0 ≤ `least`; never for NaN.
template <class S>
constexpr bool lies_between(S value, S least, S most) {
  return bits_of(value) - bits_of(least) <= bits_of(most) - bits_of(least);
}

/// |`value`| ≤ `most`; never for NaN.
template <class S>
constexpr bool lies_within(S value, S most) {
  return bits_of(value) << 1 <= bits_of(most) << 1;
}

/// Every option that all methods use lies in its domain.
template <class S>
constexpr bool twr_options_valid(const TwrOptions<S>& o) {
  constexpr S least = std::numeric_limits<S>::denorm_min();
  return lies_within(o.antenna_delay_a, S(1e-3)) && lies_within(o.antenna_delay_b, S(1e-3)) &&
         lies_between(o.sigma_timestamp, least, S(1e-3)) &&
         lies_between(o.max_range, least, S(1e7)) &&
         lies_between(o.max_clock_offset, least, S(0.01)) &&
         lies_between(o.propagation_speed, S(1), S(3e8));
}

/// What becomes of options that are not valid.
template <class S>
[[gnu::cold, gnu::noinline]] constexpr Result<Measured<S>> twr_options_refused(
    const TwrOptions<S>& o) {
  for (const S value : {o.antenna_delay_a, o.antenna_delay_b, o.sigma_timestamp, o.max_range,
                        o.max_clock_offset, o.propagation_speed}) {
    if (!std::isfinite(value)) return std::unexpected(Error::NotFinite);
  }
  return std::unexpected(o.sigma_timestamp <= 0 ? Error::NonPositiveSigma : Error::InvalidOption);
}

/// Which error an interval is that is not positive: half the counter's range has no sign.
constexpr Error interval_error(std::int64_t interval) {
  return interval == -DeviceTime<>::kHalfWrap ? Error::IntervalTooLong : Error::NonPositiveInterval;
}

/// Noise on a difference of two received stamps, in ticks: six standard deviations and two ticks
/// of quantisation.
template <class S>
constexpr S twr_margin_ticks(const TwrOptions<S>& o) {
  constexpr S six_root_two = S(8.485281374238570);
  return o.sigma_timestamp * (six_root_two / kTickSeconds<S>)+2;
}

/// The range of a time of flight of `ticks`, antenna delays taken off; `variance` in [m²].
template <class S>
constexpr Measured<S> twr_range(S ticks, S variance, const TwrOptions<S>& o) {
  const S seconds = ticks * kTickSeconds<S> - (o.antenna_delay_a + o.antenna_delay_b) / 2;
  return {o.propagation_speed * seconds, variance};
}

/// `twr_range`, or why it is impossible.
template <class S>
constexpr Result<Measured<S>> twr_finish(const Measured<S>& range, const TwrOptions<S>& o) {
  const S below = range.value + 2 * kTickSeconds<S> * o.propagation_speed;
  if (below < 0 && below * below > 36 * range.variance) {
    return std::unexpected(Error::NegativeTimeOfFlight);
  }
  if (!(range.value <= o.max_range)) return std::unexpected(Error::RangeBeyondMaximum);
  return range;
}

}  // namespace detail
}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
