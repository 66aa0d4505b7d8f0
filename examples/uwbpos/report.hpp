// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// report.html: one page that needs no network, no script and no other file.

#include <string>
#include <string_view>
#include <vector>

#include "recording.hpp"
#include "replay.hpp"

namespace uwbpos::host {

/// The whole page. `said` are the remarks about the input.
[[nodiscard]] std::string report_html(const Settings& settings, const Recording& recording,
                                      const Replay& replay, const std::vector<std::string>& said);

/// Text with the characters escaped that HTML reserves; what stands between backticks is code.
[[nodiscard]] std::string escaped(std::string_view text);

}  // namespace uwbpos::host
