// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What a replay found: as summary.json, as track.tum and as a table for the terminal.

#include <filesystem>
#include <optional>
#include <string>

#include "recording.hpp"
#include "replay.hpp"

namespace uwbpos::host {

/// The content of summary.json. `scored_ranges` where the log tells the true ranges; `replay`
/// where there was something to solve.
[[nodiscard]] std::string summary_json(const Settings& settings, const Recording& recording,
                                       const Replay* replay, const Problems& problems);

/// Positions as a TUM trajectory, of one tag or of all.
[[nodiscard]] std::string track_tum(const Replay& replay, std::optional<Id> tag);

/// The tables that `replay` prints.
[[nodiscard]] std::string summary_table(const Settings& settings, const Recording& recording,
                                        const Replay& replay);
[[nodiscard]] std::string range_table(const Recording& recording);

}  // namespace uwbpos::host
