// SPDX-License-Identifier: MIT
#include "demo.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "uwbpos/geometry/height.hpp"
#include "uwbpos/ranging/ds_twr.hpp"
#include "uwbpos/ranging/ss_twr.hpp"
#include "uwbpos/sim/scenario.hpp"
#include "uwbpos/solve/locate.hpp"

#include "command_line.hpp"
#include "commands.hpp"
#include "demo_posture.hpp"
#include "demo_tdoa.hpp"
#include "demo_ultrasonic.hpp"
#include "failure.hpp"
#include "simulate.hpp"

namespace uwbpos::host {
namespace {

constexpr double kTagHeight = 1;  // [m]
constexpr int kPlaces = 30;
constexpr std::size_t kMethods = 3;

// The hall of paper (000) with a robot that stands at random places.
sim::Scenario paper_hall(std::uint64_t seed) {
  sim::Random random{seed, "places"};
  return {
      .anchors = *sim::hang_anchors({30, 20, 3}, 3, sim::Placement::Axes),
      .path = *sim::random_stops({0.5, 0.5, kTagHeight}, {29.5, 19.5, kTagHeight}, kPlaces, random),
      .radio = sim::delivery_robot_radio(),
      .epoch_rate = 1,
      .seed = seed};
}

using Ranges = std::vector<RangeTo<double, 2>>;

void add_range(Ranges& ranges, const sim::Shot& shot, const Result<Measured<double>>& slant) {
  if (!slant) return;
  const auto level = horizontal_range(*slant, shot.anchor.z(), shot.tag.z());
  if (!level) return;
  ranges.push_back({shot.anchor.head<2>(), level->value, std::sqrt(level->variance)});
}

MethodErrors errors_of(const std::vector<double>& errors) {
  MethodErrors result;
  result.solved = errors.size();
  for (const double error : errors) {
    result.mean += error;
    result.rmse += error * error;
    result.max = std::max(result.max, error);
  }
  result.mean /= static_cast<double>(errors.size());
  result.rmse = std::sqrt(result.rmse / static_cast<double>(errors.size()));
  return result;
}

std::optional<std::filesystem::path> find_recordings() {
  std::error_code ignored;
  const char* named = std::getenv("UWBPOS_DATA");
  std::filesystem::path folder = named != nullptr && *named != '\0'
                                     ? std::filesystem::path{named}
                                     : std::filesystem::path{"../shared/data"};
  if (std::filesystem::is_directory(folder / "lias" / "mid", ignored)) return folder;
  return std::nullopt;
}

void print_row(std::string_view method, const MethodErrors& few, const MethodErrors& many,
               std::string_view paper) {
  fmt::print("  {:<34}{:>7.1f} cm{:>10.1f} cm{:>10.1f} cm{:>14}\n", method, 100 * few.mean,
             100 * few.max, 100 * many.mean, paper);
}

void show_methods() {
  fmt::print(
      "1. Two-way ranging in a simulated hall, 30 m × 20 m, three base stations on the axes.\n"
      "   Two radios whose clocks differ by up to 40 ppm measure a distance by timing messages;\n"
      "   how they combine the times decides how much of the clocks' error remains.\n\n");
  constexpr int many_runs = 100;
  const HallComparison few = compare_methods(1, 1);
  const HallComparison many = compare_methods(many_runs, 1);
  fmt::print("  {:<34}{:>10}{:>13}{:>13}{:>14}\n", "position error",
             fmt::format("{} places", few.places), "largest", fmt::format("{} places", many.places),
             "paper (mean)");
  print_row("single-sided (two messages)", few.single_sided, many.single_sided, "16.3 cm");
  print_row("symmetric, the paper's improved", few.symmetric, many.symmetric, "5.1 cm");
  print_row("asymmetric (what uwbpos uses)", few.asymmetric, many.asymmetric, "-");
  fmt::print(
      "\n   Means over one exchange with each station; replies of 150 to 400 µs. The paper gives\n"
      "   neither its crystals nor its replies: compare the order of the methods, not the "
      "digits.\n");
}

std::filesystem::path show_simulated_drive(const std::filesystem::path& out) {
  fmt::print(
      "\n2. A simulated robot with three tags drives through a hall of eight anchors; its raw\n"
      "   timestamps are written to a log, and the log is replayed.\n\n");
  SimulateSettings simulated;
  simulated.out = out / "hall";
  simulated.hall = {30, 20, 3};
  simulated.tags = 3;
  simulated.speed = 2;
  simulated.blocked = 0.02;
  write_simulation(make_scenario(simulated), simulated.out);
  Settings settings;
  settings.anchors = simulated.out / "anchors.csv";
  settings.tags = simulated.out / "tags.csv";
  settings.twr = simulated.out / "twr.csv";
  settings.truth = simulated.out / "truth.tum";
  settings.height = simulated.tag_height;
  settings.out = simulated.out;
  run_replay(settings);
  return settings.out / "report.html";
}

std::filesystem::path show_recording(const std::filesystem::path& data,
                                     const std::filesystem::path& out) {
  fmt::print(
      "\n3. A real recording: a trolley with three tags among eight anchors, against motion\n"
      "   capture (Jiang et al., ICRA 2023). First as measured.\n\n");
  const std::filesystem::path lias = data / "lias";
  Settings settings;
  settings.anchors = lias / "anchors.csv";
  settings.tags = lias / "tags.csv";
  settings.ranges = lias / "mid" / "ranges.csv";
  settings.truth = lias / "mid" / "truth.tum";
  settings.height = 0.96;
  settings.out = out / "lias_raw";
  run_replay(settings);

  fmt::print(
      "\n   Then each link's bias is measured where the trolley stood in 15 known poses.\n\n");
  Settings still = settings;
  still.ranges = lias / "static" / "ranges.csv";
  still.truth = lias / "static" / "truth.tum";
  still.out = out / "lias_calibrated";
  run_calibrate(still);

  fmt::print("\n   The same drive again, with these biases taken off.\n\n");
  settings.bias = still.out / "bias.csv";
  settings.out = still.out;
  run_replay(settings);
  return settings.out / "report.html";
}

}  // namespace

HallComparison compare_methods(int runs, std::uint64_t seed) {
  std::array<std::vector<double>, kMethods> errors;
  for (int i = 0; i < runs; ++i) {
    auto run = sim::Simulation::start(paper_hall(seed + static_cast<std::uint64_t>(i)));
    if (!run) throw Failure{fmt::format("demo: {}", describe(run.error()))};
    std::array<Ranges, kMethods> ranges;
    while (const auto shot = run->next()) {
      const DsTwrStamps& s = shot->exchange.stamps;
      TwrOptions<double> unknown_clocks;
      unknown_clocks.sigma_clock_offset = 15e-6;  // of the difference of two within ±20 ppm
      add_range(ranges[0], *shot,
                ss_twr_range<double>({s.poll_tx, s.poll_rx, s.resp_tx, s.resp_rx}, unknown_clocks));
      add_range(ranges[1], *shot, ds_twr_range_symmetric<double>(s));
      add_range(ranges[2], *shot, ds_twr_range<double>(s));
      if (shot->anchor_id != 3) continue;
      for (std::size_t method = 0; method < kMethods; ++method) {
        if (const auto fix = locate(ranges[method])) {
          errors[method].push_back((fix->position - shot->tag.head<2>()).norm());
        }
        ranges[method].clear();
      }
    }
  }
  return {static_cast<std::size_t>(runs * kPlaces), errors_of(errors[0]), errors_of(errors[1]),
          errors_of(errors[2])};
}

int run_demo(const std::filesystem::path& out) {
  show_methods();
  std::filesystem::path report = show_simulated_drive(out);
  if (const auto data = find_recordings()) {
    report = show_recording(*data, out);
  } else {
    fmt::print(
        "\n3. SKIPPED: the real recordings are not here; put them at ../shared/data or name their\n"
        "   folder in UWBPOS_DATA to see them calibrated and replayed.\n");
  }
  show_ultrasound(out);
  show_building(out);
  show_posture(out);
  fmt::print("\nNow open the report: {}\n", report.string());
  return kSuccess;
}

}  // namespace uwbpos::host
