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

#include <cmath>
#include <cstdint>
#include <limits>

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

/// Every option that all methods use lies in its domain. Written so that NaN fails every line.
template <class S>
constexpr bool twr_options_valid(const TwrOptions<S>& o) {
  return std::abs(o.antenna_delay_a) <= S(1e-3) && std::abs(o.antenna_delay_b) <= S(1e-3) &&
         o.sigma_timestamp > 0 && o.sigma_timestamp <= S(1e-3) && o.max_range > 0 &&
         o.max_range <= S(1e7) && o.max_clock_offset > 0 && o.max_clock_offset <= S(0.01) &&
         o.propagation_speed >= 1 && o.propagation_speed <= S(3e8);
}

/// Which error options are that are not valid.
template <class S>
constexpr Error twr_options_error(const TwrOptions<S>& o) {
  for (const S value : {o.antenna_delay_a, o.antenna_delay_b, o.sigma_timestamp, o.max_range,
                        o.max_clock_offset, o.propagation_speed}) {
    if (!std::isfinite(value)) return Error::NotFinite;
  }
  return o.sigma_timestamp <= 0 ? Error::NonPositiveSigma : Error::InvalidOption;
}

/// A count of ticks as a scalar. A 32-bit processor without double has no instruction for this;
/// in halves it takes five, to within 1.5e-7 of the count plus 256 ticks where that is negative.
template <class S>
constexpr S scalar_ticks(std::int64_t ticks) {
  if constexpr (std::numeric_limits<S>::digits <= 24) {
    const auto high = static_cast<std::int32_t>(ticks >> 32);
    const auto low = static_cast<std::uint32_t>(ticks);
    return static_cast<S>(high) * S(4294967296.0) + static_cast<S>(low);
  } else {
    return static_cast<S>(ticks);
  }
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

/// The range of a time of flight of `ticks` with variance `variance` [s²], antenna delays taken
/// off, or why it is impossible.
template <class S>
constexpr Result<Measured<S>> twr_finish(S ticks, S variance, const TwrOptions<S>& o) {
  const S metres_per_tick = o.propagation_speed * kTickSeconds<S>;
  const S range =
      ticks * metres_per_tick - o.propagation_speed * ((o.antenna_delay_a + o.antenna_delay_b) / 2);
  const S range_variance = o.propagation_speed * o.propagation_speed * variance;
  const S below = range + 2 * metres_per_tick;
  if (below < 0 && below * below > 36 * range_variance) {
    return std::unexpected(Error::NegativeTimeOfFlight);
  }
  if (!(range <= o.max_range)) return std::unexpected(Error::RangeBeyondMaximum);
  return Measured<S>{range, range_variance};
}

}  // namespace detail
}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
