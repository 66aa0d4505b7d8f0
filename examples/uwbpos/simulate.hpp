// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A simulated run as logs in the formats that `replay` reads, and their truth.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "uwbpos/sim/scenario.hpp"

#include "settings.hpp"

namespace uwbpos::host {

enum class RadioModel { kIdeal, kDw1000, kDw3000, kDeliveryRobot };
enum class PathShape { kLawn, kCircle, kStops };

/// What is logged: two-way exchanges, or differences of one blink at all anchors against a control
/// anchor, or of each blink between two anchors that chance chooses.
enum class LogKind { kTwoWay, kShared, kPairs };

/// What `simulate` is asked for.
struct SimulateSettings {
  std::filesystem::path out = "out";
  std::uint64_t seed = 1;
  std::vector<double> hall{10, 8, 3};  ///< width, depth, height of the anchors [m]
  int anchors = 8;
  sim::Placement placement = sim::Placement::Perimeter;
  double other_height = -1;  ///< of every second anchor; below zero: as the others [m]
  PathShape path = PathShape::kLawn;
  double speed = 1;       ///< [m/s]
  double tag_height = 1;  ///< [m]
  int tags = 1;           ///< 1, or 2 … 8 around the body, 0.3 m from its centre
  RadioModel radio = RadioModel::kDw1000;
  double rate = 10;    ///< epochs in a second
  double blocked = 0;  ///< share of the time that a link is blocked
  double loss = 0;     ///< probability that a frame is lost
  LogKind kind = LogKind::kTwoWay;
  double outliers = 0;  ///< share of differences that are off by 0.5 … 4 m
};

/// The scenario. Throws `Failure` for a hall, a number or a path that cannot be.
[[nodiscard]] sim::Scenario make_scenario(const SimulateSettings& settings);

struct SimulatedLogs {
  std::size_t exchanges = 0;
  std::size_t complete = 0;
  double seconds = 0;
};

/// Runs the scenario and writes anchors.csv, tags.csv, twr.csv, ranges.csv and truth.tum.
SimulatedLogs write_simulation(const sim::Scenario& scenario,
                               const std::filesystem::path& directory);

/// Runs the scenario as an uplink of blinks and sync frames, ten a second, and writes anchors.csv,
/// tags.csv, tdoa.csv and truth.tum. `exchanges` counts blinks, `complete` differences.
SimulatedLogs write_tdoa_simulation(const SimulateSettings& settings);

int run_simulate(const SimulateSettings& settings);

}  // namespace uwbpos::host
