// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Positions from a log of ultrasonic arrivals, shot by shot.

#include <string>
#include <utility>
#include <vector>

#include "formats.hpp"
#include "replay.hpp"
#include "settings.hpp"

namespace uwbpos::host {

/// What `uwbpos ultrasonic` is asked for.
struct UltrasonicSettings {
  Settings common;              ///< anchors, truth, output, dimension, side, prior, sigma
  std::filesystem::path shots;  ///< ultrasonic.csv
  double temperature = 24;      ///< where the log gives none [°C]
  double tick = 1e-6 / 3;       ///< [s]
  double circuit_delay = 0;     ///< [s]
  double frequency = 40000;     ///< [Hz]
  double max_lag = 5;           ///< in waves
  int max_repair = 2;           ///< waves
  bool follow = false;          ///< the last position is the next shot's prior
  double prior_sigma = 0.06;    ///< [m]
};

/// What was found beside the position of a solved shot.
struct ShotDetail {
  double t;                 ///< [s]
  double lag;               ///< [m]
  std::vector<int> repair;  ///< waves added, by ascending receiver id
  bool ambiguous;
  double residual;  ///< [m]
};

/// Everything found.
struct UltrasonicReplay {
  Replay replay;
  std::vector<ShotDetail> shots;  ///< solved ones, by time
  double wave = 0;                ///< longest of the log [m]

  /// How often each repair was made, most frequent first.
  [[nodiscard]] std::vector<std::pair<std::string, std::size_t>> repairs() const;
  [[nodiscard]] std::size_t ambiguous() const;
  [[nodiscard]] std::size_t repaired() const;
};

/// Solves every shot. Arrivals must ascend in time.
[[nodiscard]] UltrasonicReplay replay_ultrasonic(const UltrasonicSettings& settings,
                                                 const Site& site,
                                                 const std::vector<Arrival>& arrivals);

/// The content of summary.json, the table for the terminal, and the report.
[[nodiscard]] std::string ultrasonic_summary(const UltrasonicReplay& found,
                                             const Problems& problems);
[[nodiscard]] std::string ultrasonic_table(const UltrasonicReplay& found);
[[nodiscard]] std::string ultrasonic_report(const UltrasonicSettings& settings, const Site& site,
                                            const UltrasonicReplay& found);

int run_ultrasonic(const UltrasonicSettings& settings);

}  // namespace uwbpos::host
