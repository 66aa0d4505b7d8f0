// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Single-sided two-way ranging, with or without the responder's clock offset (paper 000).
///
///   (1) \f$ \hat\tau = ((R_a - D_b) + \delta D_b)/2 \f$, (000-4) for δ = 0;
///   (2) error \f$ \tau e_A + D_b (e_A - e_B + \delta)/2 \f$ to first order, (000-11) for δ = 0;
///   (3) \f$ \mathrm{var}\,\hat\tau = \sigma_t^2/2 + (D_b \sigma_\delta/2)^2 \f$: both receptions
///       are noisy, transmissions are scheduled.
///
/// (1) is exact up to the scale 1 + eA for δ = (eB − eA)/(1 + eB). A rate counted in A's time, as a
/// `RateTracker` counts it, is larger by δ²: 0.24 mm of range per millisecond of reply at 40 ppm.
/// For replies of many milliseconds give δ/(1 + δ).
///
/// \f$ R_a - D_b \f$ is an integer. A float δ is a 24-bit integer m·2^e, so \f$ \delta D_b \f$ —
/// 48 km of light path after 4 s at 80 ppm — is m·D_b, exact in 64 bits; only what is left after
/// the whole ticks have been joined becomes a float. Float and double agree to 0.1 mm for the same
/// δ; what δ itself loses when it becomes a float (2^-24 of it: 3 mm after 4 s at 80 ppm, 1 µm
/// after 1 ms) no code can restore.

#include "uwbpos/ranging/twr_common.hpp"

namespace uwbpos {

/// Stamps of one exchange: poll sent (A), poll received (B), response sent (B), response
/// received (A).
struct SsTwrStamps {
  DeviceTime<> poll_tx;  ///< Poll sent, by A.
  DeviceTime<> poll_rx;  ///< Poll received, by B.
  DeviceTime<> resp_tx;  ///< Response sent, by B.
  DeviceTime<> resp_rx;  ///< Response received, by A.
};

namespace detail {

/// x + δ·interval, in ticks; |δ| < 1/2, 0 < interval < 2^39.
template <class S>
S add_scaled_ticks(std::int64_t x, S delta, std::int64_t interval) {
  if constexpr (std::numeric_limits<S>::digits <= 24) {
    const std::uint32_t bits = bits_of(delta);
    const auto shift = 150 - static_cast<int>(bits >> 23 & 0xFFu);
    if (shift <= 62) {
      const auto size = static_cast<std::int64_t>((bits & 0x7FFFFFu) | 0x800000u);
      const std::int64_t product = (delta < 0 ? -size : size) * interval;
      const std::int64_t whole = product >> shift;
      const S rest = scalar_ticks<S>(product - whole * (std::int64_t{1} << shift));
      const S unit = std::bit_cast<S>(static_cast<std::uint32_t>(127 - shift) << 23);
      return scalar_ticks<S>(x + whole) + rest * unit;
    }
  }
  return scalar_ticks<S>(x) + delta * scalar_ticks<S>(interval);
}

}  // namespace detail

/// Range [m] by equation (1) and its variance [m²] by (3). Unbiased near zero: noise may make it
/// slightly negative, it is not clamped. O(1), never allocates.
///
/// Errors, in the order they are looked for:
/// - NotFinite, NonPositiveSigma, InvalidOption: an option is NaN or infinite, `sigma_timestamp` is
///   not positive, another option lies outside its domain.
/// - ClockOffsetOutOfBounds: |`clock_offset`| exceeds `max_clock_offset`.
/// - IntervalTooLong: an interval of exactly half the counter's range (8.6 s). Longer ones look
///   negative:
/// - NonPositiveInterval: a frame was answered or received no later than it was sent.
/// - ReplyExceedsRoundTrip: the reply is longer than the round trip by more than
///   `max_clock_offset` and six standard deviations explain.
/// - NegativeTimeOfFlight: the range is negative by more than six standard deviations and two
///   ticks. Without a known offset this is the fate of short ranges, unless `sigma_clock_offset`
///   tells how little is known.
/// - RangeBeyondMaximum.
template <class S>
[[nodiscard]] Result<Measured<S>> ss_twr_range(
    const SsTwrStamps& stamps, const TwrOptions<S>& options = detail::kTwrDefaults<S>) {
  if (!detail::twr_options_valid(options)) return detail::twr_options_refused(options);
  if (!std::isfinite(options.clock_offset) || !std::isfinite(options.sigma_clock_offset)) {
    return std::unexpected(Error::NotFinite);
  }
  if (!(options.sigma_clock_offset >= 0 && options.sigma_clock_offset <= S(0.01))) {
    return std::unexpected(Error::InvalidOption);
  }
  if (std::abs(options.clock_offset) > options.max_clock_offset) {
    return std::unexpected(Error::ClockOffsetOutOfBounds);
  }
  const std::int64_t round_a = stamps.resp_rx - stamps.poll_tx;
  const std::int64_t reply_b = stamps.resp_tx - stamps.poll_rx;
  if (round_a <= 0) return std::unexpected(detail::interval_error(round_a));
  if (reply_b <= 0) return std::unexpected(detail::interval_error(reply_b));

  const std::int64_t x = round_a - reply_b;
  const S reply = scalar_ticks<S>(reply_b);
  if (scalar_ticks<S>(x) <
      -(options.max_clock_offset * reply + detail::twr_margin_ticks(options))) {
    return std::unexpected(Error::ReplyExceedsRoundTrip);
  }
  const S ticks = detail::add_scaled_ticks(x, options.clock_offset, reply_b) / 2;
  const S speed = options.propagation_speed;
  const S sigma = speed * options.sigma_timestamp;
  const S drift = reply * (kTickSeconds<S> * speed) * options.sigma_clock_offset / 2;
  return detail::twr_finish(detail::twr_range(ticks, sigma * sigma / 2 + drift * drift, options),
                            options);
}

/// Error of the time of flight [s] to first order, equation (2), when the offset is not known:
/// (000-11). `time_of_flight` τ and `reply_b` [s]; `rate_a`, `rate_b` the clocks' frequency errors.
template <class S>
[[nodiscard]] constexpr S ss_twr_error(S time_of_flight, S reply_b, S rate_a, S rate_b) {
  return time_of_flight * rate_a + reply_b * (rate_a - rate_b) / 2;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
