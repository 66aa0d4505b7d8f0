// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What the command line says.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "uwbpos/solve/robust_loss.hpp"

#include "trajectory.hpp"

namespace uwbpos::host {

/// Where the tags are as seen from the anchors' plane, to choose between mirror images in 3-D.
enum class Side { kUnknown, kAbove, kBelow };

/// The direction in which tags on that side lie.
[[nodiscard]] inline Vec3 upwards(Side side) { return {0, 0, side == Side::kAbove ? 1.0 : -1.0}; }

/// Standard deviation of a range of which nobody tells one [m].
inline constexpr double kRangeSigma = 0.1;

/// The options that subcommands share; an empty path means not given.
struct Settings {
  std::filesystem::path anchors, tags, ranges, twr, tdoa, subnets, truth, bias, power_bias;
  std::filesystem::path bias_network, attitude, imu;
  std::filesystem::path out = "out";
  std::optional<double> height;          ///< of the tags' antennas [m]
  std::optional<int> dim;                ///< 2 or 3
  std::vector<std::uint32_t> only_tags;  ///< empty: all
  std::optional<double> epoch_window;    ///< [s]
  /// Of a range, or of one arrival of a difference, whose file gives none [m]; differences whose
  /// sigma nobody gives have it found from the log.
  std::optional<double> sigma;
  double max_range = 500;  ///< [m]
  Side side = Side::kUnknown;
  Loss loss = Loss::Squares;             ///< of poses
  std::optional<double> velocity;        ///< time between the poses of a twist [s]
  std::optional<Vec<double, 2>> target;  ///< its bearing is wanted [m]
  std::optional<Vec3> prior;             ///< where the tags are, roughly [m]
  unsigned counter_bits = 0;             ///< 0: find out
  bool strict = false;
  bool filter = false;  ///< a filter over time, not each epoch on its own
};

}  // namespace uwbpos::host
