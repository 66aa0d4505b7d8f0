// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Double-sided two-way ranging: asymmetric (Neirynck, Luk, McLaughlin, WPNC 2016), the one to use,
/// and symmetric, the "improved TWR" of paper 000. With x = Ra − Db and y = Rb − Da:
///
///   (1) asymmetric \f$ \hat\tau = \frac{R_a R_b - D_a D_b}{R_a + R_b + D_a + D_b}
///       = \frac{x R_b + y D_b}{R_a + R_b + D_a + D_b} \f$. Noiseless and unrounded, exactly
///       \f$ \tau \cdot 2(1+e_A)(1+e_B)/(2+e_A+e_B) \f$ whatever the replies: the error
///       \f$ \tau(e_A+e_B)/2 \f$ is the scale of the two clocks, which no exchange between them can
///       reveal: 0.6 mm at 30 m with both at +20 ppm, nothing with opposite ones.
///   (2) symmetric (000-9) \f$ \hat\tau = (x + y)/4 \f$, error
///       \f$ \tau(e_A+e_B)/2 + (D_a-D_b)(e_B-e_A)/4 \f$.
///       The paper prints (000-14) with the opposite sign; substituting its own (000-13) gives
///       this.
///   (3) \f$ \mathrm{var}\,\hat\tau = \sigma_t^2 (1 + f^2 + (1-f)^2)/4 \f$ for (1), with the three
///       receptions noisy and \f$ f = (D_a+R_b)/(R_a+R_b+D_a+D_b) \f$: 3σt²/8 at equal replies,
///       σt²/2 at the most unequal; 3σt²/8 for (2) at any.
///   (4) \f$ \delta = (y - x)/(R_a + D_a) \f$, ≈ eB − eA, for nothing.
///
/// Products are never formed in floating point: x, y < 2^25 and intervals < 2^38 ticks (4.3 s) keep
/// each in 63 bits, and their sum is checked. Only then are numerator and denominator rounded:
/// float stays within 5e-7 of double, 0.1 mm at 200 m, at any reply time.

#include "uwbpos/ranging/twr_common.hpp"

namespace uwbpos {

/// Stamps of one exchange: poll sent (A), received (B); response sent (B), received (A); final
/// sent (A), received (B).
struct DsTwrStamps {
  DeviceTime<> poll_tx;   ///< Poll sent, by A.
  DeviceTime<> poll_rx;   ///< Poll received, by B.
  DeviceTime<> resp_tx;   ///< Response sent, by B.
  DeviceTime<> resp_rx;   ///< Response received, by A.
  DeviceTime<> final_tx;  ///< Final sent, by A.
  DeviceTime<> final_rx;  ///< Final received, by B.
};

namespace detail {

struct DsTwrIntervals {
  std::int64_t round_a, reply_a, round_b, reply_b;
};

/// Positive intervals below 2^38 ticks.
inline Result<DsTwrIntervals> ds_twr_intervals(const DsTwrStamps& t) {
  const DsTwrIntervals d{t.resp_rx - t.poll_tx, t.final_tx - t.resp_rx, t.final_rx - t.resp_tx,
                         t.resp_tx - t.poll_rx};
  constexpr std::int64_t limit = std::int64_t{1} << 38;
  for (const std::int64_t interval : {d.round_a, d.reply_a, d.round_b, d.reply_b}) {
    if (interval <= 0) return std::unexpected(interval_error(interval));
    if (interval >= limit) return std::unexpected(Error::IntervalTooLong);
  }
  return d;
}

/// x, y and the replies and the sum of all intervals, in ticks.
template <class S>
struct DsTwrTerms {
  S x, y, reply_a, reply_b, sum;
};

/// What both methods refuse alike; afterwards |x|, |y| < 2^25.
template <class S>
Result<DsTwrTerms<S>> ds_twr_terms(const DsTwrIntervals& d, const TwrOptions<S>& options) {
  constexpr std::int64_t limit = std::int64_t{1} << 25;
  const std::int64_t x = d.round_a - d.reply_b;
  const std::int64_t y = d.round_b - d.reply_a;
  const auto small = [=](std::int64_t v) {
    return static_cast<std::uint64_t>(v + limit - 1) < static_cast<std::uint64_t>(2 * limit - 1);
  };
  const bool exact = small(x) && small(y);
  // A 32-bit conversion is one instruction.
  const auto scalar = [=](std::int64_t v) {
    return exact ? static_cast<S>(static_cast<std::int32_t>(v)) : static_cast<S>(v);
  };
  const DsTwrTerms<S> t{scalar(x), scalar(y), scalar_ticks<S>(d.reply_a),
                        scalar_ticks<S>(d.reply_b),
                        scalar_ticks<S>(d.round_a + d.round_b + d.reply_a + d.reply_b)};
  const S margin = twr_margin_ticks(options);
  const S bound = options.max_clock_offset;
  if (std::abs(t.y - t.x) > bound * t.sum / 2 + margin) {
    return std::unexpected(Error::ClockOffsetOutOfBounds);
  }
  if (t.x < -(bound * t.reply_b + margin) || t.y < -(bound * t.reply_a + margin)) {
    return std::unexpected(Error::ReplyExceedsRoundTrip);
  }
  if (!exact) return std::unexpected(Error::IntervalTooLong);
  return t;
}

}  // namespace detail

/// Range [m] by equation (1) and its variance [m²] by (3), from one exchange whose replies may be
/// of any length. Unbiased near zero: noise may make it slightly negative, it is not clamped.
/// `clock_offset` and `sigma_clock_offset` are not looked at. O(1), never allocates.
///
/// Errors, in the order they are looked for:
/// - NotFinite, NonPositiveSigma, InvalidOption: an option is NaN or infinite, `sigma_timestamp` is
///   not positive, another lies outside its domain.
/// - NonPositiveInterval: a frame was answered or received no later than it was sent, or so much
///   later (8.6 s) that it looks so.
/// - IntervalTooLong: an interval of 2^38 ticks (4.3 s) or more, or round trip and reply differ by
///   2^25 ticks: beyond exact arithmetic.
/// - ClockOffsetOutOfBounds: equation (4) beyond `max_clock_offset` and six standard deviations.
/// - ReplyExceedsRoundTrip: a reply is longer than its round trip by more than that explains.
/// - NegativeTimeOfFlight: the range is negative by more than six standard deviations and two
///   ticks.
/// - RangeBeyondMaximum.
template <class S>
[[nodiscard]] Result<Measured<S>> ds_twr_range(const DsTwrStamps& stamps,
                                               const TwrOptions<S>& options = {}) {
  if (!detail::twr_options_valid(options)) {
    return std::unexpected(detail::twr_options_error(options));
  }
  const auto d = detail::ds_twr_intervals(stamps);
  if (!d) return std::unexpected(d.error());
  const auto t = detail::ds_twr_terms(*d, options);
  if (!t) return std::unexpected(t.error());
  const std::int64_t first = (d->round_a - d->reply_b) * d->round_b;
  const std::int64_t second = (d->round_b - d->reply_a) * d->reply_b;
  std::int64_t numerator = 0;
  if (__builtin_add_overflow(first, second, &numerator)) {
    return std::unexpected(Error::IntervalTooLong);
  }
  // Da + Rb = 2·Da + y.
  const S f = (2 * t->reply_a + t->y) / t->sum;
  const S variance =
      options.sigma_timestamp * options.sigma_timestamp * (1 + f * f + (1 - f) * (1 - f)) / 4;
  return detail::twr_finish(detail::scalar_ticks<S>(numerator) / t->sum, variance, options);
}

/// Range [m] by equation (2), the paper's improved TWR, and its variance [m²]: for replies of equal
/// length. Everything else, every Error too, as for `ds_twr_range`.
template <class S>
[[nodiscard]] Result<Measured<S>> ds_twr_range_symmetric(const DsTwrStamps& stamps,
                                                         const TwrOptions<S>& options = {}) {
  if (!detail::twr_options_valid(options)) {
    return std::unexpected(detail::twr_options_error(options));
  }
  const auto d = detail::ds_twr_intervals(stamps);
  if (!d) return std::unexpected(d.error());
  const auto t = detail::ds_twr_terms(*d, options);
  if (!t) return std::unexpected(t.error());
  // An integer, of 26 bits: x and y may have opposite ones of 25.
  const auto sum = static_cast<std::int32_t>((d->round_a - d->reply_b) + (d->round_b - d->reply_a));
  const S variance = 3 * options.sigma_timestamp * options.sigma_timestamp / 8;
  return detail::twr_finish(static_cast<S>(sum) / 4, variance, options);
}

/// The responder's rate against the initiator's, δ ≈ eB − eA, by equation (4); its standard
/// deviation is √2·σt/(Ra + Da). Exact to the stamps; motion of 1 m/s adds 0.003 ppm.
/// Call as `ds_twr_clock_offset<float>(stamps)`.
/// Errors: NonPositiveInterval, IntervalTooLong, as for `ds_twr_range`.
template <class S>
[[nodiscard]] Result<S> ds_twr_clock_offset(const DsTwrStamps& stamps) {
  const auto d = detail::ds_twr_intervals(stamps);
  if (!d) return std::unexpected(d.error());
  const std::int64_t a = d->round_a + d->reply_a;
  const std::int64_t b = d->round_b + d->reply_b;
  return static_cast<S>(b - a) / static_cast<S>(a);
}

/// Error of the asymmetric time of flight [s] to first order, equation (1).
template <class S>
[[nodiscard]] constexpr S ds_twr_error(S time_of_flight, S rate_a, S rate_b) {
  return time_of_flight * (rate_a + rate_b) / 2;
}

/// Error of the symmetric time of flight [s] to first order, equation (2), the corrected (000-14).
/// `reply_a`, `reply_b` [s]; `rate_a`, `rate_b` the clocks' frequency errors.
template <class S>
[[nodiscard]] constexpr S ds_twr_error_symmetric(S time_of_flight, S reply_a, S reply_b, S rate_a,
                                                 S rate_b) {
  return time_of_flight * (rate_a + rate_b) / 2 + (reply_a - reply_b) * (rate_b - rate_a) / 4;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
