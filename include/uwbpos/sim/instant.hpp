// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// True time, kept finer than any radio can see.
///
/// A tick is 15.65 ps. One double of seconds resolves 1.5 ps after three hours and 15 ps after a
/// day, so a simulated distance would change with the hour it is simulated at. Whole seconds and
/// a fraction below one resolve 1.1e-16 s = 0.0001 ps at any hour.

#include <cstdint>

namespace uwbpos::sim {

/// A point on the axis of true time, `seconds` + `fraction`. Resolution 1.1e-16 s.
struct Instant {
  std::int64_t seconds = 0;  ///< whole seconds
  double fraction = 0;       ///< 0 ≤ fraction < 1 [s]

  /// Same instant.
  friend constexpr bool operator==(const Instant&, const Instant&) = default;

  /// The instant `duration` seconds later (earlier when negative; |duration| < 2^62), exact to
  /// the resolution of the sum's fraction and of `duration` itself.
  friend constexpr Instant operator+(Instant instant, double duration) {
    const auto whole = static_cast<std::int64_t>(duration);
    const double sum = instant.fraction + (duration - static_cast<double>(whole));
    if (sum < 0) {
      const double raised = sum + 1;
      return raised < 1 ? Instant{instant.seconds + whole - 1, raised}
                        : Instant{instant.seconds + whole, 0.0};
    }
    if (sum >= 1) return {instant.seconds + whole + 1, sum - 1};
    return {instant.seconds + whole, sum};
  }

  /// Seconds from `earlier` to `later`; relative error 2e-16 of the result.
  friend constexpr double operator-(Instant later, Instant earlier) {
    return static_cast<double>(later.seconds - earlier.seconds) +
           (later.fraction - earlier.fraction);
  }
};

/// Seconds as one double: for a log's host time, which need not be finer than microseconds.
[[nodiscard]] constexpr double to_seconds(Instant instant) {
  return static_cast<double>(instant.seconds) + instant.fraction;
}

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
