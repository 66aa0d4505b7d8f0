// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Plots as SVG, drawn by gnuplot run as a subprocess, coloured by the page they stand in.

#include <optional>
#include <string>
#include <string_view>

namespace uwbpos::host {

/// Runs gnuplot on a script that plots to standard output; nothing if gnuplot is missing or fails.
[[nodiscard]] std::optional<std::string> run_gnuplot(const std::string& script);

/// How scripts begin whose picture stands in a file of its own, 640 wide.
[[nodiscard]] std::string picture_preamble(int height);

/// Data under the name `$name`, one point a line.
[[nodiscard]] std::string data_block(std::string_view name, std::string_view lines);

/// Names of the page's colours (CSS variables) and the colours that stand for them in scripts.
enum class Ink : int { kText = 1, kMuted, kGrid, kTruth, kAnchor, kMark, kWorst, kSeries0 = 16 };

/// How many colours there are from kSeries0 on.
inline constexpr int kSeriesColours = 6;

/// `rgb "#0000NN"`, to be used in a script wherever it takes a colour.
[[nodiscard]] std::string ink(Ink colour);
[[nodiscard]] std::string series_ink(std::size_t series);

/// The picture alone, fit to be put into a page: no prolog, colours as CSS variables, fonts from
/// the page, and ids that no other plot of the page has.
[[nodiscard]] std::string page_svg(std::string_view svg, std::string_view prefix,
                                   std::string_view description);

}  // namespace uwbpos::host
