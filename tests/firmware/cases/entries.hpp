// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The cases of each unit.

#include <span>

#ifndef FIRMWARE_TARGET
#include <vector>

#include "uwbpos/sim/noise.hpp"
#endif

#include "bench.hpp"

namespace firmware {

std::span<const Entry> ranging_entries();
std::span<const Entry> position_entries();
std::span<const Entry> difference_entries();
std::span<const Entry> pose_entries();
std::span<const Entry> ultrasonic_entries();
std::span<const Entry> filter_entries();
std::span<const Entry> tracker_entries();

}  // namespace firmware

#ifndef FIRMWARE_TARGET
#include "inputs.hpp"
#endif
