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
  const DsTwrTerms<S> t{scalar_ticks<S>(x), scalar_ticks<S>(y), scalar_ticks<S>(d.reply_a),
                        scalar_ticks<S>(d.reply_b),
                        scalar_ticks<S>(d.round_a + d.round_b + d.reply_a + d.reply_b)};
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

}  // namespace detail
}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
