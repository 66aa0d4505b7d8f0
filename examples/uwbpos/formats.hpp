// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The files of a recording: what their rows mean, and reading them.

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "uwbpos/ranging/range_bias.hpp"

#include "csv.hpp"
#include "trajectory.hpp"

namespace uwbpos::host {

using Id = std::uint32_t;

/// Anchor or tag ids and positions [m]: anchors in the map, tags in the body's frame.
using Points = std::map<Id, Vec3>;

/// One range between a tag and an anchor.
struct Reading {
  double t;  ///< [s]
  Id tag;
  Id anchor;
  double range;                 ///< [m]
  std::optional<double> sigma;  ///< [m]
  std::optional<double> power;  ///< first path, else total [dBm]
  std::size_t line = 0;
};

/// How much farther a tag is from anchor b than from anchor a.
struct Difference {
  double t;  ///< [s]
  Id tag;
  Id anchor_a;
  Id anchor_b;
  double difference;            ///< distance to b minus distance to a [m]
  std::optional<double> sigma;  ///< [m]
  std::size_t line = 0;
};

/// One exchange of messages, as raw counter readings. Sent by the tag: poll and final.
struct Exchange {
  double t;  ///< [s]
  Id tag;
  Id anchor;
  std::uint64_t poll_tx, poll_rx, resp_tx, resp_rx;
  std::optional<std::pair<std::uint64_t, std::uint64_t>> final;  ///< final_tx, final_rx
  std::optional<double> clock_offset;                            ///< δ = eB − eA, a fraction
  std::optional<double> power;                                   ///< first path [dBm]
  std::optional<double> true_range;                              ///< [m]
  std::optional<double> logged_range;                            ///< the module's own [m]
  std::size_t line = 0;
};

/// A sample of an inertial unit, in the body's axes: x forward, y left, z up.
struct InertialReading {
  double t;            ///< [s]
  Vec3 gyro;           ///< turn rate [rad/s]
  Vec3 accelerometer;  ///< specific force, (0, 0, +g) at rest [m/s²]
};

/// When the sound of one shot reached one receiver.
struct Arrival {
  double t;  ///< of the shot [s]
  Id receiver;
  std::uint32_t count;                ///< ticks since the shot
  std::optional<double> temperature;  ///< of the air [°C]
  std::size_t line = 0;
};

/// Estimate minus truth [m] of each link; an entry without a tag serves every tag.
struct BiasTable {
  std::map<std::pair<Id, Id>, double> of_link;  ///< (tag, anchor)
  std::map<Id, double> of_anchor;

  [[nodiscard]] bool empty() const { return of_link.empty() && of_anchor.empty(); }
  [[nodiscard]] std::optional<double> find(Id tag, Id anchor) const;
};

/// Ascending by power.
using PowerBiasTable = std::vector<RangeBiasPoint<double>>;

/// Where the clock that stamped a log was set.
struct ClockReset {
  double t;     ///< of the first row after it, as mended [s]
  double back;  ///< by how much; below zero: forward [s]
};

/// `set back by 12 s`, or forward.
[[nodiscard]] std::string words_of(const ClockReset& reset);

/// What reading a log counted, besides malformed rows (`Problems`).
struct LogCounts {
  std::size_t rows = 0;          ///< rows seen
  std::size_t no_reading = 0;    ///< rows whose reading is an empty cell
  std::size_t out_of_order = 0;  ///< rows later in the file than the reordering window allows
  std::vector<ClockReset> clock_resets;
};

/// How far below an earlier row's time a row's may be before that is worth a remark [s].
inline constexpr double kReorderWindow = 1;

template <class T>
struct Log {
  std::filesystem::path file;
  std::vector<T> rows;  ///< by ascending time; rows of one time in the order of the file
  LogCounts counts;
};

[[nodiscard]] Points read_anchors(const std::filesystem::path& file, Problems& problems);
[[nodiscard]] Points read_tags(const std::filesystem::path& file, Problems& problems);
[[nodiscard]] BiasTable read_bias(const std::filesystem::path& file, Problems& problems);
[[nodiscard]] PowerBiasTable read_power_bias(const std::filesystem::path& file, Problems& problems);
[[nodiscard]] Trajectory read_trajectory(const std::filesystem::path& file, Problems& problems);

/// Rows come back by time, however they stood in the file. Where the log's clock was set back, so
/// that the same links speak again of times gone by, rows after it go on one usual step after the
/// last before it.
[[nodiscard]] Log<Reading> read_ranges(const std::filesystem::path& file, Problems& problems);
[[nodiscard]] Log<Exchange> read_twr(const std::filesystem::path& file, Problems& problems);
[[nodiscard]] Log<Arrival> read_ultrasonic(const std::filesystem::path& file, Problems& problems);
[[nodiscard]] Log<Difference> read_tdoa(const std::filesystem::path& file, Problems& problems);
[[nodiscard]] Log<InertialReading> read_imu(const std::filesystem::path& file, Problems& problems);

}  // namespace uwbpos::host
