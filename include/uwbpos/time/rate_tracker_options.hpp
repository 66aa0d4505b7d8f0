// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The options of `RateTracker`.

#include <cstdint>

namespace uwbpos {

/// How a `RateTracker` weighs what it sees.
template <class S>
struct RateTrackerOptions {
  /// Standard deviation of one stamp [s].
  S sigma_timestamp = S(0.15e-9);
  /// |δ| beyond this is refused: two crystals of ±20 ppm, and as much again.
  S max_clock_offset = S(80e-6);
  /// How the rate wanders: standard deviation after one second [1/√s]; grows with √time.
  S wander = S(5e-9);
  /// A change of δ beyond six standard deviations plus this is no wander but a jump.
  S max_rate_step = S(0.3e-6);
  /// A gap longer than this [µs] starts afresh. At most a thousand hours.
  std::int64_t max_gap = 300'000'000;
  /// A pair that the host saw this much before the last one [µs] is late or repeated, not a sign
  /// that the host's clock was set back.
  std::int64_t reorder_window = 1'000'000;
  /// How far the host's interval is off as a rule [µs]: when two wrap counts of A lie within it,
  /// one interval of host time does not tell them apart.
  std::int64_t host_jitter = 50'000;
  /// How late at most the host sees an event [µs], the length of the queue it reads: what any of
  /// its intervals, however long, may be off. At most ten seconds. Where `host_jitter` leaves a
  /// doubt, the rate settles within a few times this.
  std::int64_t host_lag = 2'000'000;
};

/// Every option is in its domain: σ and bound in (0, 1), wander and step in [0, 1),
/// 0 < `max_gap` ≤ 1000 h, 0 ≤ `reorder_window`, 0 ≤ `host_jitter` ≤ `max_gap`,
/// 0 ≤ `host_lag` ≤ 10 s. False for NaN.
template <class S>
[[nodiscard]] constexpr bool is_valid(const RateTrackerOptions<S>& o) {
  return o.sigma_timestamp > 0 && o.sigma_timestamp < 1 && o.max_clock_offset > 0 &&
         o.max_clock_offset < 1 && o.wander >= 0 && o.wander < 1 && o.max_rate_step >= 0 &&
         o.max_rate_step < 1 && o.max_gap > 0 && o.max_gap <= 3'600'000'000'000 &&
         o.reorder_window >= 0 && o.host_jitter >= 0 && o.host_jitter <= o.max_gap &&
         o.host_lag >= 0 && o.host_lag <= 10'000'000;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
