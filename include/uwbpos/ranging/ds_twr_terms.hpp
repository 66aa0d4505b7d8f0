// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The stamps of double-sided ranging, the intervals between them, and what of those is impossible.
/// Equations: ds_twr.hpp.

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

/// A number of ticks that is not negative as a scalar; to 2^32 rounded once, like one of 32 bits.
template <class S>
constexpr S scalar_interval(std::int64_t ticks) {
  if constexpr (std::numeric_limits<S>::digits <= 24) {
    return static_cast<S>(static_cast<std::uint32_t>(ticks >> 32)) * S(4294967296.0) +
           static_cast<S>(static_cast<std::uint32_t>(ticks));
  } else {
    return static_cast<S>(ticks);
  }
}

/// x, y and the replies and the sum of all intervals, in ticks.
template <class S>
struct DsTwrTerms {
  S x, y, reply_a, reply_b, sum;
};

/// What both methods refuse alike; afterwards −2^25 ≤ x, y < 2^25.
template <class S>
Result<DsTwrTerms<S>> ds_twr_terms(const DsTwrIntervals& d, const TwrOptions<S>& options) {
  constexpr std::int64_t limit = std::int64_t{1} << 25;
  const std::int64_t x = d.round_a - d.reply_b;
  const std::int64_t y = d.round_b - d.reply_a;
  const auto small = [=](std::int64_t v) { return v >= -limit && v < limit; };
  const DsTwrTerms<S> t{scalar_ticks<S>(x), scalar_ticks<S>(y), scalar_interval<S>(d.reply_a),
                        scalar_interval<S>(d.reply_b),
                        scalar_interval<S>(d.round_a + d.round_b + d.reply_a + d.reply_b)};
  const S margin = twr_margin_ticks(options);
  const S bound = options.max_clock_offset;
  if (std::abs(scalar_ticks<S>(y - x)) > bound * t.sum / 2 + margin) {
    return std::unexpected(Error::ClockOffsetOutOfBounds);
  }
  if (t.x < -(bound * t.reply_b + margin) || t.y < -(bound * t.reply_a + margin)) {
    return std::unexpected(Error::ReplyExceedsRoundTrip);
  }
  if (!small(x) || !small(y)) return std::unexpected(Error::IntervalTooLong);
  return t;
}

/// What most exchanges need, in 32 bits.
struct DsTwrShort {
  std::int32_t x, y, reply_a, round_b, reply_b;
  std::uint32_t sum;
};

/// The terms of an exchange whose intervals have at most 2^30 ticks (16.8 ms) and whose replies are
/// positive, −2^25 ≤ x, y < 2^25. False for all others. Round trips may still be zero.
[[gnu::always_inline]] inline bool ds_twr_short(const DsTwrStamps& t, DsTwrShort& d) {
  std::uint32_t high = 0;
  const auto interval = [&high](DeviceTime<> later, DeviceTime<> earlier) {
    const std::uint64_t ticks = later.ticks() - earlier.ticks();
    high |= static_cast<std::uint32_t>(ticks >> 32);
    return static_cast<std::uint32_t>(ticks);
  };
  const std::uint32_t round_a = interval(t.resp_rx, t.poll_tx);
  const std::uint32_t reply_a = interval(t.final_tx, t.resp_rx);
  const std::uint32_t round_b = interval(t.final_rx, t.resp_tx);
  const std::uint32_t reply_b = interval(t.resp_tx, t.poll_rx);
  d = {static_cast<std::int32_t>(round_a - reply_b), static_cast<std::int32_t>(round_b - reply_a),
       static_cast<std::int32_t>(reply_a),           static_cast<std::int32_t>(round_b),
       static_cast<std::int32_t>(reply_b),           round_a + reply_a + round_b + reply_b};
  // Zero less one has all bits.
  constexpr std::uint32_t limit = 1u << 25;
  const std::uint32_t low = round_a | (reply_a - 1) | round_b | (reply_b - 1);
  const std::uint32_t differences = (round_a - reply_b + limit) | (round_b - reply_a + limit);
  return (high << (64 - DeviceTime<>::kBits) | low >> 30 | differences >> 26) == 0;
}

}  // namespace detail
}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
