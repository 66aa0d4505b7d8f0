// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The part of the demo on range differences: a building of four subnets.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "uwbpos/core/types.hpp"

namespace uwbpos::host {

/// A tag's walk through the building, blink by blink. Errors are squared and pooled, and stand over
/// the Cramér-Rao bound at the true place, pooled alike: 1 is what no unbiased method can beat.
struct BuildingWalk {
  std::size_t blinks = 0;
  std::size_t located = 0;       ///< in the map
  double likelihood_ratio = 0;   ///< of `locate`, each subnet in its own frame
  double chan_ratio = 0;         ///< of Chan's two stages alone, on the same differences
  std::size_t compared = 0;      ///< solutions that both gave
  std::size_t chan_refused = 0;  ///< differences that Chan's stages alone did not solve
  double rms = 0;                ///< error of the track in the map [m]
  double nees = 0;               ///< squared error over the covariance claimed, mean; 3 wanted
  int borders = 0;               ///< blinks that other subnets solved than the one before
  double worst_step = 0;         ///< of the error at a border, in its standard deviations
  std::vector<Vec<double, 3>> track, truth, anchors;  ///< in the map [m]
};

/// Everything from the stamps on: clocks from sync frames, differences, positions, one map.
[[nodiscard]] BuildingWalk walk_through_building(std::uint64_t seed);

/// The walk in plan as SVG; nothing without gnuplot.
[[nodiscard]] std::optional<std::string> building_svg(const BuildingWalk& walk);

/// Prints the walk's figures and writes its picture.
void show_building(const std::filesystem::path& out);

}  // namespace uwbpos::host
