// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// How long a counter ran, when it may have wrapped meanwhile and a host timed it roughly.

#include <algorithm>
#include <cstdint>
#include <optional>

#include "uwbpos/time/device_time.hpp"

namespace uwbpos {

/// Host time in ticks, 63 897.6 a microsecond; a thousand hours are 2.3e17.
[[nodiscard]] constexpr std::int64_t microseconds_to_ticks(std::int64_t microseconds) {
  return microseconds * 63'897 + microseconds * 3 / 5;
}

/// Ticks that a counter may have run: residue + kW. `nearest` to what the host says, and the
/// second nearest, `other`, with `other_mismatch` its distance from that; both positive.
struct UnwrappedInterval {
  std::int64_t nearest;               ///< [ticks]
  std::optional<std::int64_t> other;  ///< [ticks], unless it were not positive.
  std::int64_t other_mismatch;        ///< [ticks], 0 without `other`.
};

/// The positive intervals that leave a counter at `later` when it was at `earlier`, next to
/// `host_interval` [ticks], which is positive and below 2^61. O(1), never allocates, cannot fail.
template <unsigned Bits>
[[nodiscard]] constexpr UnwrappedInterval unwrap_interval(DeviceTime<Bits> later,
                                                          DeviceTime<Bits> earlier,
                                                          std::int64_t host_interval) {
  static_assert(Bits <= 60, "intervals of several wraps are counted in 64 bits");
  constexpr std::int64_t wrap = DeviceTime<Bits>::kWrap;
  const std::int64_t residue = (later - earlier) & (wrap - 1);
  const std::int64_t wraps = std::max<std::int64_t>(host_interval - residue + wrap / 2, 0) / wrap;
  std::int64_t nearest = residue + wraps * wrap;
  if (nearest == 0) nearest = wrap;
  const std::int64_t other = host_interval < nearest ? nearest - wrap : nearest + wrap;
  if (other <= 0) return {nearest, std::nullopt, 0};
  return {nearest, other, std::max(other - host_interval, host_interval - other)};
}

/// As that, the one nearest to `expected` [ticks], a real number (or NaN: any) that counts as far
/// as it lies within `slack` of `host_interval`.
template <class S, unsigned Bits>
[[nodiscard]] constexpr std::int64_t unwrap_explained(DeviceTime<Bits> later,
                                                      DeviceTime<Bits> earlier, S expected,
                                                      std::int64_t host_interval,
                                                      std::int64_t slack) {
  const S low = scalar_ticks<S>(std::max<std::int64_t>(host_interval - slack, 1));
  const S within =
      expected > low ? std::min(expected, scalar_ticks<S>(host_interval + slack)) : low;
  return unwrap_interval(later, earlier, integer_ticks(within)).nearest;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
