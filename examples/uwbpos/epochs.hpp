// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Which readings belong to one instant.

#include <optional>
#include <vector>

#include "formats.hpp"

namespace uwbpos::host {

/// Of times since 1970 printed in decimal [s].
inline constexpr double kTimeRounding = 1e-6;

/// The readings of one tag that are solved together.
struct Epoch {
  Id tag;
  double t;  ///< mean time of the readings [s]
  std::vector<Reading> readings;
};

/// How readings are grouped. With a window from the command line, an epoch lasts that long from
/// its first reading. Without one: if most readings of a tag share their time with the one before,
/// the log stamps whole rounds, and an epoch is one time. Otherwise the period of a link is taken
/// to be the 75 % quantile of the times between successive readings of the same tag and anchor; an
/// epoch lasts at most 3/4 of it, and ends early when an anchor reports again after half of it or
/// more.
struct EpochRule {
  double window;      ///< [s]
  double repeat_gap;  ///< an anchor that reports again after this long ends the epoch [s]
};

/// Readings must ascend in time.
[[nodiscard]] EpochRule epoch_rule(const std::vector<Reading>& readings,
                                   std::optional<double> window);

struct Epochs {
  std::vector<Epoch> epochs;   ///< by the time of their first readings
  std::size_t duplicates = 0;  ///< readings of one link and time beyond the first, dropped
};

/// Groups each tag's readings, which must ascend in time. No epoch has more than
/// kMaxMeasurements readings.
[[nodiscard]] Epochs group_epochs(const std::vector<Reading>& readings, const EpochRule& rule);

}  // namespace uwbpos::host
