// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The affine model of a device's clock. A clock of relative frequency error e and offset o shows,
/// at true time t,
///   (1) \f$ C(t) = o + (1 + e)\,t \f$.
/// Crystals: |e| ≤ 20 ppm, so two devices differ by up to 40 ppm. The tracker of one clock's rate
/// against another's is in time/rate_tracker.hpp, which this header brings along.

#include "uwbpos/time/rate_tracker.hpp"

namespace uwbpos {

/// Equation (1): `offset` [s] shown at true time zero, `rate` = e, the relative frequency error
/// (20 ppm = 20e-6).
template <class S>
struct Clock {
  S offset{};  ///< [s] shown at true time zero.
  S rate{};    ///< e, the relative frequency error.
};

/// What the clock shows [s] at true time `t` [s], equation (1).
template <class S>
[[nodiscard]] constexpr S clock_reading(const Clock<S>& clock, S t) {
  return clock.offset + (t + clock.rate * t);
}

/// The true time [s] at which the clock shows `reading` [s]; the inverse of (1).
template <class S>
[[nodiscard]] constexpr S true_time(const Clock<S>& clock, S reading) {
  return (reading - clock.offset) / (1 + clock.rate);
}

/// The rate of clock `b` counted in clock `a`'s time, what a `RateTracker` estimates:
/// (eB − eA)/(1 + eA) ≈ eB − eA.
template <class S>
[[nodiscard]] constexpr S relative_rate(const Clock<S>& b, const Clock<S>& a) {
  return (b.rate - a.rate) / (1 + a.rate);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
