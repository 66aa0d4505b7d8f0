// SPDX-License-Identifier: MIT
#include "demo_ultrasonic.hpp"

#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "uwbpos/ranging/ultrasonic.hpp"
#include "uwbpos/sim/paper_table.hpp"
#include "uwbpos/sim/ultrasonic.hpp"
#include "uwbpos/solve/fsri.hpp"

#include "gnuplot.hpp"
#include "output.hpp"
#include "statistics.hpp"
#include "trajectory.hpp"
#include "ultrasonic.hpp"

namespace uwbpos::host {
namespace {

using Receivers = std::array<Vec2, 3>;

constexpr double kPaperSpeed = 340;  // of its simulation [m/s]
constexpr double kTick = 1e-6 / 3;   // [s]

std::string pair_of(double ours, double printed) {
  return fmt::format("{:6.1f} ({:5.1f})", ours, printed);
}

std::string position_of(const Vec2& position, const sim::PrintedPosition& printed) {
  return pair_of(100 * position.x(), printed.x) + ' ' + pair_of(100 * position.y(), printed.y) +
         ' ' + pair_of(100 * position.norm(), printed.length);
}

std::array<Vec2, 4> four_receivers() {
  const Receivers bar = sim::paper_receivers();
  return {bar[0], bar[1], bar[2], Vec2{-0.4, 0.4}};
}

struct Turn {
  std::string dots;
  std::vector<double> errors;
  int ambiguous = 0;
  int refused = 0;

  void add(const Vec2& position, const Vec2& truth) {
    dots += fmt::format("{:.3f} {:.3f}\n", 100 * position.x(), 100 * position.y());
    errors.push_back((position - truth).norm());
  }
};

struct Circle {
  Turn conventional, three, four;
};

// One turn of the paper's circle, the same lags for all.
Circle turn_once() {
  Circle circle;
  sim::Random random{"figure 7"};
  const std::array<Vec2, 4> receivers = four_receivers();
  const Receivers bar = sim::paper_receivers();
  for (int k = 0; k < sim::kPaperShots; ++k) {
    const Vec2 emitter = sim::paper_emitter(k);
    const auto shot = sim::paper_shot<2, 4>(random, receivers, emitter);
    const std::array<double, 3> lengths{shot.lengths[0], shot.lengths[1], shot.lengths[2]};
    // As the paper has it: two receivers, and a guess of the lag taken off.
    const double guess = sim::kPaperWave * (2 + random.integer(0, 1));
    const auto plain =
        locate_conventional(std::array{bar[0], bar[2]}, std::array{lengths[0], lengths[2]}, guess);
    if (plain) circle.conventional.add(plain->position, emitter);
    const auto add = [&](Turn& turn, const auto& solved) {
      if (!solved) {
        ++turn.refused;
        return;
      }
      turn.ambiguous += solved->ambiguous ? 1 : 0;
      turn.add(solved->position, emitter);
    };
    add(circle.three, fsri(bar, lengths, {.wavelength = sim::kPaperWave}));
    add(circle.four, fsri(receivers, shot.lengths, {.wavelength = sim::kPaperWave}));
  }
  return circle;
}

std::string turn_row(std::string_view name, const Turn& turn, bool judged) {
  std::string row =
      fmt::format("  {:<34}{:>8.2f} cm{:>8.2f} cm", name, 100 * quantile(turn.errors, 0.5),
                  100 * quantile(turn.errors, 0.95));
  if (judged) row += fmt::format("{:>9}{:>11}", turn.refused, turn.ambiguous);
  return row + '\n';
}

}  // namespace

std::string paper_table_text() {
  const Receivers receivers = sim::table_receivers<double>();
  const double wavelength = *ultrasonic_wavelength(24.0);
  std::string text =
      "   in cm, with what the paper prints in brackets\n"
      "  counts          method                     x              y         distance     lag    "
      "         waves moved\n";
  for (const sim::PrintedRow& row : sim::kPaperTable) {
    std::array<double, 3> lengths;
    for (std::size_t i = 0; i < 3; ++i)
      lengths[i] = ultrasonic_length<double>(row.counts[i])->value;
    const auto plain = locate_conventional(std::array{receivers[0], receivers[2]},
                                           std::array{lengths[0], lengths[2]});
    const auto difference = locate_time_difference(receivers, lengths);
    const auto shot = fsri(receivers, lengths, {.wavelength = wavelength});
    text += fmt::format("  {:04X} {:04X} {:04X}  {:<16}", row.counts[0], row.counts[1],
                        row.counts[2], "surveyed");
    text += fmt::format("       ({:5.1f})        ({:5.1f})        ({:5.1f})\n", row.truth.x,
                        row.truth.y, row.truth.length);
    const auto line = [&](std::string_view method, const auto& solved,
                          const sim::PrintedPosition& printed) {
      text += fmt::format(
          "  {:<14}  {:<16}{}", "", method,
          solved ? position_of(solved->position, printed) : std::string{describe(solved.error())});
    };
    line("conventional", plain, row.conventional);
    text += '\n';
    line("time difference", difference, row.time_difference);
    text += '\n';
    line("FSRI", shot, row.fsri);
    if (shot) {
      text += fmt::format("  {:.4f} ({:.4f})  {:d} {:d} {:d}", 100 * shot->lag, row.lag,
                          shot->repair[0], shot->repair[1], shot->repair[2]);
    }
    text += '\n';
  }
  return text;
}

std::optional<std::string> paper_circle_svg() {
  const Circle circle = turn_once();
  std::string script = picture_preamble(640) +
                       "set size ratio -1\nset xlabel 'x [cm]'\nset ylabel 'y [cm]'\n"
                       "set xrange [-50:130]\nset yrange [-8:130]\n";
  std::string truth;
  for (int k = 0; k <= sim::kPaperShots; ++k) {
    const Vec2 at = 100 * sim::paper_emitter(k);
    truth += fmt::format("{:.3f} {:.3f}\n", at.x(), at.y());
  }
  std::string receivers;
  for (const Vec2& at : four_receivers()) {
    receivers += fmt::format("{:.1f} {:.1f}\n", 100 * at.x(), 100 * at.y());
  }
  script += data_block("truth", truth) + data_block("receivers", receivers) +
            data_block("conventional", circle.conventional.dots) +
            data_block("three", circle.three.dots) + data_block("four", circle.four.dots);
  script +=
      "plot $truth with lines lc rgb '#8a95a3' lw 1.5 title 'true circle', "
      "$conventional with points pt 2 ps 0.6 lc rgb '#d97706' title 'conventional', "
      "$three with points pt 6 ps 0.7 lc rgb '#2563eb' title 'FSRI, three receivers', "
      "$four with points pt 7 ps 0.4 lc rgb '#059669' title 'with a fourth', "
      "$receivers with points pt 9 ps 1 lc rgb '#1b2430' title 'receivers'\n";
  return run_gnuplot(script);
}

void write_ultrasonic_simulation(const std::filesystem::path& directory) {
  make_directory(directory);
  const std::array<Vec2, 4> receivers = four_receivers();
  std::string anchors = "anchor_id,x_m,y_m,z_m\n";
  for (std::size_t i = 0; i < receivers.size(); ++i) {
    anchors += fmt::format("{},{},{},0\n", i + 1, receivers[i].x(), receivers[i].y());
  }
  std::string log = "t_s,receiver_id,count,temperature_c\n";
  std::string truth;
  sim::Random random{"ultrasonic log"};
  const double temperature = *temperature_from_speed_of_sound(kPaperSpeed);
  for (int k = 0; k < 2 * sim::kPaperShots; ++k) {
    const Vec2 emitter = sim::paper_emitter(k);
    const auto shot = sim::paper_shot<2, 4>(random, receivers, emitter);
    const double t = 0.1 * k;
    for (std::size_t i = 0; i < receivers.size(); ++i) {
      log += fmt::format("{:.1f},{},{},{:.3f}\n", t, i + 1,
                         std::lround(shot.lengths[i] / kPaperSpeed / kTick), temperature);
    }
    truth += fmt::format("{:.1f} {:.6f} {:.6f} 0 0 0 0 1\n", t, emitter.x(), emitter.y());
  }
  write_file(directory / "anchors.csv", anchors);
  write_file(directory / "ultrasonic.csv", log);
  write_file(directory / "truth.tum", truth);
}

void show_ultrasound(const std::filesystem::path& out) {
  fmt::print(
      "\n4. Ultrasound: three receivers on a bar, whose thresholds trip some waves too late "
      "(Jiang\n"
      "   et al., 2009). Its table 1, recomputed from the hexadecimal counts:\n\n{}",
      paper_table_text());
  const Circle circle = turn_once();
  fmt::print(
      "\n   Its simulation: 45 shots around a circle, lags of one to three waves, different for\n"
      "   each receiver.\n\n  {:<34}{:>11}{:>11}{:>9}{:>11}\n{}{}{}",
      "position error", "median", "95 %", "refused", "ambiguous",
      turn_row("conventional", circle.conventional, false),
      turn_row("FSRI, the paper's three receivers", circle.three, true),
      turn_row("FSRI, a fourth at (-40, 40) cm", circle.four, true));
  const std::filesystem::path folder = out / "ultrasound";
  write_ultrasonic_simulation(folder);
  if (const auto svg = paper_circle_svg()) {
    write_file(folder / "circle.svg", *svg);
    fmt::print("   The picture, like the paper's figure 7: {}\n\n",
               (folder / "circle.svg").string());
  } else {
    fmt::print("   No picture: gnuplot could not be run.\n\n");
  }
  UltrasonicSettings settings;
  settings.common.anchors = folder / "anchors.csv";
  settings.common.truth = folder / "truth.tum";
  settings.common.out = folder;
  settings.shots = folder / "ultrasonic.csv";
  run_ultrasonic(settings);
}

}  // namespace uwbpos::host
