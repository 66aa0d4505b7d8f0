// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The posture part of the demo: the tables and the drive of the paper on a mobile robot's posture
/// from two UWB tags (002). Base stations at (0, 0), (0, 8) and (8, 0) m.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "uwbpos/pose/target.hpp"

namespace uwbpos::host {

/// Errors of headings [deg].
struct HeadingErrors {
  double mean_absolute;
  double rms;
};

/// Robot at (4, 4) m, heading 45°, each tag's position off by a radius uniform in [0, `radius`] m
/// in any direction: 10,000 draws, the same directions for every radius and baseline.
[[nodiscard]] HeadingErrors paper_heading_errors(double radius, double baseline);

/// One step of the drive.
struct DriveStep {
  double t;               ///< [s]
  Pose2<double> truth;    ///< where the robot is
  Pose2<double> pose;     ///< as solved from the ranges of both tags
  Target<double> target;  ///< as seen from `pose`
};

/// From (4, 4) m, heading 45°, to the target at (8, 8) m: five times a second the pose is solved
/// from the tags' six ranges and the robot turns towards the target's bearing. The ranges' noise
/// makes each tag's position as uncertain as 2 cm do above.
[[nodiscard]] std::vector<DriveStep> paper_drive(std::uint64_t seed);

/// How far a position lies off the straight line of the drive [m], positive to the left.
[[nodiscard]] double off_line(const Vec<double, 2>& position);

/// The drive as SVG; nothing without gnuplot.
[[nodiscard]] std::optional<std::string> drive_svg(const std::vector<DriveStep>& drive);

/// Prints tables and drive; writes drive.svg and drive.csv.
void show_posture(const std::filesystem::path& out);

}  // namespace uwbpos::host
