// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A recording as the settings name its files: what is known of the place, and its readings.

#include <optional>
#include <string>
#include <vector>

#include "exchanges.hpp"
#include "formats.hpp"
#include "replay.hpp"
#include "settings.hpp"

namespace uwbpos::host {

struct Recording {
  Site site;
  std::filesystem::path log;  ///< of ranges or of raw stamps
  std::vector<Reading> readings;
  std::vector<Difference> differences;   ///< where `--tdoa` was given, beside readings if filtered
  std::vector<InertialReading> samples;  ///< of `--imu`
  LogCounts counts;
  std::optional<Ranging> ranging;  ///< how raw stamps became readings
  double seconds = 0;              ///< from the first reading to the last
};

/// `35 ranges` or `1 difference`.
[[nodiscard]] std::string reading_count(const Recording& recording);

/// Reads all files that the settings name. Throws `Failure` if one cannot be used.
[[nodiscard]] Recording read_recording(const Settings& settings, Problems& problems);

/// What a reader of the results should know, one sentence each: rows skipped, unknown anchors,
/// refused exchanges and readings, links without a bias …
[[nodiscard]] std::vector<std::string> remarks(const Recording& recording, const Replay& replay,
                                               const Problems& problems);

/// `4 exchanges`, `1 exchange`.
[[nodiscard]] std::string count_of(std::size_t count, std::string_view singular);

}  // namespace uwbpos::host
