// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// An instant on the control anchor's clock, finer than a tick, with the variance of its error.
/// Whole ticks are an integer, so that the difference of two instants,
///   (1) \f$ (n_2 - n_1) + (f_2 - f_1) \f$ ticks,
/// loses nothing in float: 0.04 mm of light path over 500 m.

#include <cstdint>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/time/device_time.hpp"

namespace uwbpos {

/// When something happened, by the control anchor's clock.
template <class S>
struct ControlTime {
  DeviceTime<> ticks;  ///< whole ticks
  S fraction{};        ///< to be added [ticks], a few at most
  S variance{};        ///< of the error of both [s²]
};

/// Equation (1), in ticks: exact in the whole ones as long as the instants lie less than half a
/// wrap (8.6 s) apart. O(1), never allocates, cannot fail.
template <class S>
[[nodiscard]] constexpr S ticks_between(const ControlTime<S>& earlier,
                                        const ControlTime<S>& later) {
  return scalar_ticks<S>(later.ticks - earlier.ticks) + (later.fraction - earlier.fraction);
}

/// Equation (1), in seconds.
template <class S>
[[nodiscard]] constexpr S seconds_between(const ControlTime<S>& earlier,
                                          const ControlTime<S>& later) {
  return ticks_between(earlier, later) * kTickSeconds<S>;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
