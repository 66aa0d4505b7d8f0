// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a `ClockSync` can be told.

#include <cstdint>

namespace uwbpos {

/// The longest gap without sync frames that any options allow [µs]: below half a wrap.
inline constexpr std::int64_t kLongestSyncGap = 8'000'000;

/// How a `ClockSync` weighs what it sees. Domains in brackets.
template <class S>
struct ClockSyncOptions {
  /// Standard deviation of a reception's stamp [s]; departures are exact. [0 < σ ≤ 1 ms]
  S sigma_timestamp = S(0.15e-9);
  /// Random walk of δ, of both clocks together [1/√s]: compensated oscillators 0.1e-9, crystals
  /// in a draught 5e-9. Too large costs smoothing; too small, by five and more, good frames.
  /// [0 ≤ q ≤ 1e-6]
  S wander = S(1e-9);
  /// |δ| beyond this is refused. [0 < e ≤ 200e-6]
  S max_clock_offset = S(80e-6);
  /// A frame that departs by more than this [s] is a jump and no detour of the radio's.
  /// [0 < d ≤ 1]
  S max_excess = S(1e-6);
  /// So many frames in a row that depart by less are no detour either; until then the tracker
  /// coasts on what it knew. [2 … 1000]
  int max_outliers = 10;
  /// Without a frame that was used [µs]; afterwards all begins anew. [0 < g ≤ 8 s]
  std::int64_t max_gap = 5'000'000;
  /// Between the last frame that was used and a stamp to be converted [µs]. [0 < g ≤ 8 s]
  std::int64_t max_age = 1'000'000;
  /// A frame that the host saw this much before the last one [µs] is late, not a sign that the
  /// host's clock was set back. [0 ≤ w]
  std::int64_t reorder_window = 1'000'000;
};

/// Every option lies in its domain; NaN lies in none.
template <class S>
[[nodiscard]] constexpr bool is_valid(const ClockSyncOptions<S>& o) {
  return o.sigma_timestamp > 0 && o.sigma_timestamp <= S(1e-3) && o.wander >= 0 &&
         o.wander <= S(1e-6) && o.max_clock_offset > 0 && o.max_clock_offset <= S(200e-6) &&
         o.max_excess > 0 && o.max_excess <= 1 && o.max_outliers >= 2 && o.max_outliers <= 1000 &&
         o.max_gap > 0 && o.max_gap <= kLongestSyncGap && o.max_age > 0 &&
         o.max_age <= kLongestSyncGap && o.reorder_window >= 0;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
