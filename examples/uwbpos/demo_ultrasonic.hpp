// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The ultrasonic part of the demo: the table and the simulation of Jiang et al. (003).

#include <filesystem>
#include <optional>
#include <string>

namespace uwbpos::host {

/// Table 1 from its counts, each number beside the printed one.
[[nodiscard]] std::string paper_table_text();

/// The paper's circle by the conventional method and by FSRI with three and four receivers, as
/// SVG; nothing without gnuplot.
[[nodiscard]] std::optional<std::string> paper_circle_svg();

/// Writes anchors.csv, ultrasonic.csv and truth.tum of two turns of the circle, four receivers.
void write_ultrasonic_simulation(const std::filesystem::path& directory);

/// Prints the first, writes the second, replays the third.
void show_ultrasound(const std::filesystem::path& out);

}  // namespace uwbpos::host
