// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Physical constants and the limits shared by several layers.

namespace uwbpos {

/// Speed of light in vacuum [m/s], exact by definition.
template <class S>
inline constexpr S kSpeedOfLightVacuum = S(299792458.0);

/// Speed of light in air [m/s], the value that UWB vendors use; the library's default.
template <class S>
inline constexpr S kSpeedOfLightAir = S(299702547.0);

/// One tick of a DW1000/DW3000 timestamp [s]: 1/(128 · 499.2 MHz) = 15.65 ps.
template <class S>
inline constexpr S kTickSeconds = S(1.0 / (128.0 * 499.2e6));

/// Most measurements that one snapshot solve takes; bounds its time.
inline constexpr int kMaxMeasurements = 64;

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
