// SPDX-License-Identifier: MIT
#include "demo_posture.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include <fmt/format.h>

#include "uwbpos/pose/two_tag.hpp"
#include "uwbpos/sim/noise.hpp"
#include "uwbpos/solve/pose_from_ranges.hpp"

#include "failure.hpp"
#include "gnuplot.hpp"
#include "output.hpp"
#include "trajectory.hpp"

namespace uwbpos::host {
namespace {

constexpr double kDriveBaseline = 0.6;  // [m]
constexpr double kDriveStep = 0.2;      // [s]
constexpr double kDriveSpeed = 0.5;     // [m/s]
// An error of radius uniform in [0, 2] cm has 1.15 cm rms; at (4, 4) m three ranges of this sigma
// give as much, √1.5 times their own.
constexpr double kDriveSigma = 0.02 / (std::numbers::sqrt3 * 1.2247448714);

Vec2 drive_start() { return {4, 4}; }
Vec2 drive_goal() { return {8, 8}; }

Fix<double, 2> tag_at(const Vec2& centre, double heading, double side, double baseline) {
  return {centre + side * baseline / 2 * Vec2{-std::sin(heading), std::cos(heading)},
          Mat<double, 2>::Zero(), 0, 0};
}

std::vector<TagRange<double, 2>> measure_drive(const Pose2<double>& robot, sim::Random& random) {
  std::vector<TagRange<double, 2>> ranges;
  const Turn<double> turn = turn_of(robot.heading);
  for (const double side : {1.0, -1.0}) {
    for (const Vec2& station : {Vec2{0, 0}, Vec2{0, 8}, Vec2{8, 0}}) {
      const Vec2 arm{0, side * kDriveBaseline / 2};
      const auto exact = predict_tag_range<double, 2>(robot.position, turn, arm, station);
      ranges.push_back({arm, station, exact.range + random.normal(0, kDriveSigma), kDriveSigma});
    }
  }
  return ranges;
}

void print_errors(const char* name, double value, const HeadingErrors& errors, const char* paper) {
  fmt::print("  {:<22}{:>5.0f} cm{:>10.3f}°{:>10.3f}°   {}\n", name, 100 * value,
             errors.mean_absolute, errors.rms, paper);
}

}  // namespace

HeadingErrors paper_heading_errors(double radius, double baseline) {
  constexpr int draws = 10'000;
  constexpr double heading = std::numbers::pi / 4;
  sim::Random random{"paper 002"};
  HeadingErrors errors{0, 0};
  for (int i = 0; i < draws; ++i) {
    Fix<double, 2> tags[2] = {tag_at(drive_start(), heading, 1, baseline),
                              tag_at(drive_start(), heading, -1, baseline)};
    for (Fix<double, 2>& t : tags) {
      const double off = random.uniform(0, radius);
      const double angle = random.uniform(0, 2 * std::numbers::pi);
      t.position += off * Vec2{std::cos(angle), std::sin(angle)};
      t.covariance = Mat<double, 2>::Identity() * (radius * radius / 6);
    }
    const auto pose = two_tag_pose(tags[0], tags[1], baseline);
    if (!pose) throw Failure{fmt::format("demo: {}", describe(pose.error()))};
    const double error = radians_to_degrees(angle_difference(pose->heading, heading));
    errors.mean_absolute += std::abs(error) / draws;
    errors.rms += error * error / draws;
  }
  errors.rms = std::sqrt(errors.rms);
  return errors;
}

std::vector<DriveStep> paper_drive(std::uint64_t seed) {
  constexpr double arrived = 0.1;    // [m]
  constexpr double most_turn = 0.3;  // [rad] in one step
  constexpr int most_steps = 1000;
  sim::Random random{seed, "drive"};
  Pose2<double> robot{drive_start(), std::numbers::pi / 4, Mat<double, 3>::Zero()};
  std::vector<DriveStep> drive;
  for (int i = 0; i < most_steps; ++i) {
    const auto pose = pose_from_ranges(measure_drive(robot, random));
    if (!pose) throw Failure{fmt::format("demo: {}", describe(pose.error()))};
    const auto seen = bearing_to(*pose, drive_goal());
    if (!seen) break;
    drive.push_back({i * kDriveStep, robot, *pose, *seen});
    if (seen->distance < arrived) break;
    const double turn = std::clamp(seen->bearing, -most_turn, most_turn);
    const double way = std::min(kDriveSpeed * kDriveStep, seen->distance);
    robot.heading = wrap_angle(robot.heading + turn);
    robot.position += way * Vec2{std::cos(robot.heading), std::sin(robot.heading)};
  }
  return drive;
}

double off_line(const Vec2& position) {
  const Vec2 along = drive_goal() - drive_start();
  const Vec2 from = position - drive_start();
  return (along.x() * from.y() - along.y() * from.x()) / along.norm();
}

std::optional<std::string> drive_svg(const std::vector<DriveStep>& drive) {
  std::string script = picture_preamble(860) + "set lmargin 9\n";
  std::string way;
  std::string solved;
  std::string arrows;
  std::string off;
  for (std::size_t i = 0; i < drive.size(); ++i) {
    const DriveStep& step = drive[i];
    const Vec2& at = step.pose.position;
    way += fmt::format("{:.4f} {:.4f}\n", step.truth.position.x(), step.truth.position.y());
    solved += fmt::format("{:.4f} {:.4f}\n", at.x(), at.y());
    off += fmt::format("{:.1f} {:.3f} {:.3f} {:.3f}\n", step.t, 100 * off_line(step.truth.position),
                       100 * off_line(at),
                       radians_to_degrees(angle_difference(step.pose.heading, step.truth.heading)));
    if (i % 8 != 0) continue;
    arrows += fmt::format("{:.4f} {:.4f} {:.4f} {:.4f}\n", at.x(), at.y(),
                          0.5 * std::cos(step.pose.heading), 0.5 * std::sin(step.pose.heading));
  }
  script += data_block("way", way) + data_block("solved", solved) + data_block("arrows", arrows) +
            data_block("off", off) + data_block("stations", "0 0\n0 8\n8 0\n") +
            data_block("target", "8 8\n");
  script +=
      "set multiplot\n"
      "set size 1,0.66\nset origin 0,0.34\nset xlabel 'x [m]'\nset ylabel 'y [m]'\n"
      "set size ratio -1\nset xrange [-0.6:9]\nset yrange [-0.6:9]\n"
      "plot $arrows using 1:2:3:4 with vectors head filled lw 1.5 lc rgb '#d97706' title "
      "'heading', "
      "$way with lines lc rgb '#8a95a3' lw 1.5 title 'where the robot was', "
      "$solved with points pt 7 ps 0.25 lc rgb '#2563eb' title 'solved', "
      "$stations with points pt 9 ps 1.2 lc rgb '#1b2430' title 'base stations', "
      "$target with points pt 2 ps 1.2 lw 2 lc rgb '#b91c1c' title 'target'\n"
      "set size noratio\nset size 1,0.34\nset origin 0,0\nset xrange [*:*]\nset yrange [*:*]\n"
      "set xlabel 'time [s]'\nset ylabel 'off the line [cm]'\n"
      "set rmargin 8\nset y2tics\nset y2label 'error of heading [deg]'\n"
      "plot $off using 1:2 with lines lc rgb '#8a95a3' lw 1.5 title 'where the robot was', "
      "$off using 1:3 with points pt 7 ps 0.4 lc rgb '#2563eb' title 'solved', "
      "$off using 1:4 axes x1y2 with points pt 7 ps 0.4 lc rgb '#d97706' title 'heading'\n";
  return run_gnuplot(script);
}

void show_posture(const std::filesystem::path& out) {
  fmt::print(
      "\n6. A robot's heading from two tags across its front (002): base stations at (0, 0), (0, "
      "8)\n"
      "   and (8, 0) m, robot at (4, 4) m, heading 45°; each tag's position is off by up to the\n"
      "   error given. 10,000 draws.\n\n  {:<22}{:>8}{:>11}{:>11}   {}\n",
      "heading error", "", "MAE", "RMSE", "paper: MAE, RMSE");
  for (const double radius : {0.08, 0.06, 0.04, 0.02}) {
    print_errors("tags 60 cm apart, off", radius, paper_heading_errors(radius, kDriveBaseline),
                 radius < 0.03 ? "0.951°, 1.169°" : "");
  }
  for (const double baseline : {0.5, 0.6, 0.7, 0.8}) {
    print_errors("off 2 cm, tags apart", baseline, paper_heading_errors(0.02, baseline),
                 baseline > 0.55 && baseline < 0.65 ? "0.951°, 1.169°" : "");
  }

  const std::vector<DriveStep> drive = paper_drive(1);
  fmt::print(
      "\n   The drive to the target at (8, 8) m, steered by the bearing of each pose that the six\n"
      "   ranges of both tags give (ranges of {:.1f} mm noise: positions as uncertain as by 2 "
      "cm):\n\n"
      "  {:>8}{:>9}{:>9}{:>11}{:>15}{:>11}{:>11}\n",
      1000 * kDriveSigma, "time [s]", "x [m]", "y [m]", "heading", "heading error", "distance",
      "bearing");
  std::string csv =
      "t_s,x_m,y_m,heading_deg,true_x_m,true_y_m,true_heading_deg,distance_m,"
      "bearing_deg,ahead\n";
  double worst = 0;
  double squares = 0;
  double sum = 0;
  for (std::size_t i = 0; i < drive.size(); ++i) {
    const DriveStep& step = drive[i];
    const double error =
        radians_to_degrees(angle_difference(step.pose.heading, step.truth.heading));
    sum += std::abs(error);
    squares += error * error;
    worst = std::max(worst, std::abs(off_line(step.truth.position)));
    fmt::format_to(
        std::back_inserter(csv),
        "{:.1f},{:.4f},{:.4f},{:.3f},{:.4f},{:.4f},{:.3f},{:.4f},{:.3f},{}\n", step.t,
        step.pose.position.x(), step.pose.position.y(), radians_to_degrees(step.pose.heading),
        step.truth.position.x(), step.truth.position.y(), radians_to_degrees(step.truth.heading),
        step.target.distance, radians_to_degrees(step.target.bearing), step.target.ahead ? 1 : 0);
    if (i % 5 != 0 && i + 1 != drive.size()) continue;
    fmt::print("  {:>8.1f}{:>9.3f}{:>9.3f}{:>10.1f}°{:>14.2f}°{:>9.2f} m{:>10.1f}°  {}\n", step.t,
               step.pose.position.x(), step.pose.position.y(),
               radians_to_degrees(step.pose.heading), error, step.target.distance,
               radians_to_degrees(step.target.bearing), step.target.ahead ? "ahead" : "behind");
  }
  const auto count = static_cast<double>(drive.size());
  fmt::print(
      "\n   Heading over the drive: MAE {:.3f}°, RMSE {:.3f}°. Largest offset from the straight "
      "line:\n   {:.2f} cm (the paper's real robot, tags 24 cm apart: MAE 2.347°, RMSE 2.709°, "
      "offset 8.26 cm).\n",
      sum / count, std::sqrt(squares / count), 100 * worst);
  const std::filesystem::path folder = out / "posture";
  make_directory(folder);
  write_file(folder / "drive.csv", csv);
  if (const auto svg = drive_svg(drive)) {
    write_file(folder / "drive.svg", *svg);
    fmt::print("   The picture: {}\n", (folder / "drive.svg").string());
  } else {
    fmt::print("   No picture: gnuplot could not be run.\n");
  }
}

}  // namespace uwbpos::host
