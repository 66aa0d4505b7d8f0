// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Double-sided two-way ranging: asymmetric (Neirynck, Luk, McLaughlin, WPNC 2016), the one to use,
/// and symmetric, the "improved TWR" of paper 000. With x = Ra − Db, y = Rb − Da and the sum of all
/// intervals s = Ra + Rb + Da + Db:
///
///   (1) asymmetric \f$ \hat\tau = \frac{R_a R_b - D_a D_b}{s} = \frac{x R_b + y D_b}{s} \f$.
///       Noiseless and unrounded, exactly \f$ \tau \cdot 2(1+e_A)(1+e_B)/(2+e_A+e_B) \f$ whatever
///       the replies: the error \f$ \tau(e_A+e_B)/2 \f$ is the scale of the two clocks, which no
///       exchange between them can reveal: 0.6 mm at 30 m with both at +20 ppm, nothing with
///       opposite ones.
///   (2) symmetric (000-9) \f$ \hat\tau = (x + y)/4 \f$, error
///       \f$ \tau(e_A+e_B)/2 + (D_a-D_b)(e_B-e_A)/4 \f$.
///       The paper prints (000-14) with the opposite sign; substituting its own (000-13) gives
///       this.
///   (3) \f$ \mathrm{var}\,\hat\tau = \sigma_t^2 (3 + h^2)/8 \f$ for (1), with the three
///       receptions noisy and \f$ h = (R_b + D_a - R_a - D_b)/s \f$: 3σt²/8 at equal replies,
///       σt²/2 at the most unequal; 3σt²/8 for (2) at any.
///   (4) \f$ \delta = (y - x)/(R_a + D_a) \f$, ≈ eB − eA, for nothing.
///
/// Products are never formed in floating point: −2^25 ≤ x, y < 2^25 and intervals < 2^38 ticks
/// (4.3 s) keep each in 64 bits, and their sum is checked. Only then is anything rounded: the
/// numerator by 2 units of 2^-24 at most, the sum by 1.5, and 6 times on the way to metres. Float
/// stays within 6e-7 of the exact quotient, 0.12 mm at 200 m, at any reply time.

#include "uwbpos/ranging/ds_twr_terms.hpp"

namespace uwbpos {

namespace detail {

/// (1) and (3) from what was exact: Ra·Rb − Da·Db, the sum of all intervals, Rb + Da − Ra − Db.
template <class S>
constexpr Measured<S> ds_twr_measured(S numerator, S sum, S skew, const TwrOptions<S>& o) {
  const S inverse = 1 / sum;
  const S h = skew * inverse;
  const S sigma = o.propagation_speed * o.sigma_timestamp;
  return twr_range(numerator * inverse, sigma * sigma * (3 + h * h) / 8, o);
}

/// `ds_twr_range` for intervals of any length.
template <class S>
[[gnu::noinline, gnu::cold]] Result<Measured<S>> ds_twr_range_long(const DsTwrStamps& stamps,
                                                                   const TwrOptions<S>& options) {
  const auto d = ds_twr_intervals(stamps);
  if (!d) return std::unexpected(d.error());
  const auto t = ds_twr_terms(*d, options);
  if (!t) return std::unexpected(t.error());
  const std::int64_t first = (d->round_a - d->reply_b) * d->round_b;
  const std::int64_t second = (d->round_b - d->reply_a) * d->reply_b;
  constexpr std::int64_t limit = std::int64_t{1} << 62;
  std::int64_t numerator = 0;
  if (__builtin_add_overflow(first, second, &numerator) || numerator >= limit ||
      numerator <= -limit) {
    return std::unexpected(Error::IntervalTooLong);
  }
  const std::int64_t skew = d->round_b + d->reply_a - d->round_a - d->reply_b;
  return twr_finish(
      ds_twr_measured(scalar_ticks<S>(numerator), t->sum, scalar_ticks<S>(skew), options), options);
}

/// The same, to the same bits and in a third of the time, for most exchanges: short ones whose time
/// of flight is not negative and which are not to be refused. False for all others. Replies that
/// exceed their round trips, and round trips of zero, need no look: x < 0 ≤ x·Rb + y·Db make
/// y − x ≥ −x(Rb + Db)/Db and s/2 < Rb + Db, and then y − x ≤ e·s/2 + m makes −x ≤ e·Db + m; so
/// does y < 0 with Ra and Da; and Ra·Rb ≥ Da·Db > 0.
template <class S>
[[gnu::always_inline]] inline bool ds_twr_range_short(const DsTwrStamps& stamps,
                                                      const TwrOptions<S>& options,
                                                      Measured<S>& range) {
  DsTwrShort d;
  if (!ds_twr_short(stamps, d)) return false;
  const std::int64_t numerator = std::int64_t{d.x} * d.round_b + std::int64_t{d.y} * d.reply_b;
  const auto sum = static_cast<S>(d.sum);
  const S bound = options.max_clock_offset * sum / 2 + twr_margin_ticks(options);
  if (numerator < 0 || std::abs(static_cast<S>(d.y - d.x)) > bound) return false;
  range = ds_twr_measured(scalar_ticks<S>(numerator), sum,
                          static_cast<S>(d.y - d.x + 2 * (d.reply_a - d.reply_b)), options);
  return lies_between(range.value, S(0), options.max_range);
}

/// Range by (2), its variance by (3), of whole x + y.
template <class S>
constexpr Result<Measured<S>> ds_twr_finish_symmetric(S x_and_y, const TwrOptions<S>& options) {
  const S sigma = options.propagation_speed * options.sigma_timestamp;
  return twr_finish(twr_range(x_and_y / 4, 3 * sigma * sigma / 8, options), options);
}

/// `ds_twr_range_symmetric` for intervals of any length.
template <class S>
[[gnu::noinline, gnu::cold]] Result<Measured<S>> ds_twr_range_symmetric_long(
    const DsTwrStamps& stamps, const TwrOptions<S>& options) {
  const auto d = ds_twr_intervals(stamps);
  if (!d) return std::unexpected(d.error());
  const auto t = ds_twr_terms(*d, options);
  if (!t) return std::unexpected(t.error());
  // An integer, of 26 bits: x and y may have opposite ones of 25.
  const std::int64_t x_and_y = (d->round_a - d->reply_b) + (d->round_b - d->reply_a);
  return ds_twr_finish_symmetric(static_cast<S>(static_cast<std::int32_t>(x_and_y)), options);
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
[[nodiscard]] Result<Measured<S>> ds_twr_range(
    const DsTwrStamps& stamps, const TwrOptions<S>& options = detail::kTwrDefaults<S>) {
  if (!detail::twr_options_valid(options)) return detail::twr_options_refused(options);
  Measured<S> range;
  if (detail::ds_twr_range_short(stamps, options, range)) return range;
  return detail::ds_twr_range_long(stamps, options);
}

/// Range [m] by equation (2), the paper's improved TWR, and its variance [m²]: for replies of equal
/// length. Everything else, every Error too, as for `ds_twr_range`.
template <class S>
[[nodiscard]] Result<Measured<S>> ds_twr_range_symmetric(
    const DsTwrStamps& stamps, const TwrOptions<S>& options = detail::kTwrDefaults<S>) {
  if (!detail::twr_options_valid(options)) return detail::twr_options_refused(options);
  detail::DsTwrShort d;
  if (detail::ds_twr_short(stamps, d) && d.x > -d.reply_b && d.y > -d.reply_a) {
    const S bound = options.max_clock_offset;
    const S margin = detail::twr_margin_ticks(options);
    const auto x = static_cast<S>(d.x);
    const auto y = static_cast<S>(d.y);
    if (std::abs(static_cast<S>(d.y - d.x)) <= bound * static_cast<S>(d.sum) / 2 + margin &&
        x >= -(bound * static_cast<S>(d.reply_b) + margin) &&
        y >= -(bound * static_cast<S>(d.reply_a) + margin)) {
      return detail::ds_twr_finish_symmetric(static_cast<S>(d.x + d.y), options);
    }
  }
  return detail::ds_twr_range_symmetric_long(stamps, options);
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
  return scalar_ticks<S>(b - a) / scalar_ticks<S>(a);
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
