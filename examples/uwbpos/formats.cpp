// SPDX-License-Identifier: MIT
#include "formats.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <span>
#include <stdexcept>

#include <fmt/format.h>

#include "clock_resets.hpp"
#include "failure.hpp"

namespace uwbpos::host {
namespace {

Points read_points(const std::filesystem::path& file, std::string_view id_column,
                   Problems& problems) {
  Points points;
  const auto columns = {Column{id_column, true}, Column{"x_m", true}, Column{"y_m", true},
                        Column{"z_m", true}};
  read_csv(file, columns, problems, [&](const Row& row) {
    const Id id = row.id(0);
    const Vec3 position{row.number(1), row.number(2), row.number(3)};
    if (!points.emplace(id, position).second) {
      throw std::runtime_error{
          fmt::format("{} {} was given before; expected each once", id_column, id)};
    }
  });
  return points;
}

std::optional<double> power_of(const Row& row, std::size_t first_path, std::size_t total) {
  const auto power = row.optional_number(first_path);
  return power ? power : row.optional_number(total);
}

// What a row speaks of.
std::array<Id, 3> link_of(const Reading& r) { return {r.tag, r.anchor, 0}; }
std::array<Id, 3> link_of(const Exchange& e) { return {e.tag, e.anchor, 0}; }
std::array<Id, 3> link_of(const Difference& d) { return {d.tag, d.anchor_a, d.anchor_b}; }
std::array<Id, 3> link_of(const Arrival& a) { return {a.receiver, 0, 0}; }
std::array<Id, 3> link_of(const InertialReading&) { return {0, 0, 0}; }

// Of what a row says about it, a number that hardly comes twice.
double value_of(const Reading& r) { return r.range; }
double value_of(const Exchange& e) { return static_cast<double>(e.poll_tx); }
double value_of(const Difference& d) { return d.difference; }
double value_of(const Arrival& a) { return a.count; }
double value_of(const InertialReading& i) { return i.accelerometer[0]; }

template <class T>
void mend_clock(Log<T>& log) {
  std::vector<Stamp> stamps;
  stamps.reserve(log.rows.size());
  for (const T& row : log.rows) stamps.push_back({row.t, link_of(row), value_of(row)});
  const auto steps = find_clock_steps(stamps);
  // Times that overflow stay as they are.
  std::vector<double> moved(log.rows.size());
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const std::size_t end = k + 1 < steps.size() ? steps[k + 1].row : moved.size();
    for (std::size_t i = steps[k].row; i < end; ++i) moved[i] = steps[k].forth;
  }
  for (std::size_t i = 0; i < moved.size(); ++i) {
    if (!std::isfinite(stamps[i].t + moved[i])) return;
  }
  for (std::size_t i = 0; i < moved.size(); ++i) log.rows[i].t += moved[i];
  double before = 0;
  std::vector<ClockReset>& resets = log.counts.clock_resets;
  for (const ClockStep& step : steps) {
    const ClockReset reset{log.rows[step.row].t, step.forth - before};
    before = step.forth;
    // Tags that stand one after the other tell of the same one each.
    constexpr double near = 1;  // [s]
    const auto same = [&](const ClockReset& other) {
      return std::abs(other.t - reset.t) < near && std::abs(other.back - reset.back) < near;
    };
    if (step.is_reset && std::ranges::none_of(resets, same)) resets.push_back(reset);
  }
  std::ranges::sort(resets, {}, &ClockReset::t);
}

// Sorts rows by time; counts those outside the reordering window.
template <class T>
void put_in_order(Log<T>& log) {
  mend_clock(log);
  double newest = -std::numeric_limits<double>::infinity();
  for (const T& row : log.rows) {
    if (row.t < newest - kReorderWindow) ++log.counts.out_of_order;
    newest = std::max(newest, row.t);
  }
  std::ranges::stable_sort(log.rows, [](const T& a, const T& b) { return a.t < b.t; });
}

}  // namespace

std::string words_of(const ClockReset& reset) {
  return fmt::format("set {} by {:.5g} s", reset.back < 0 ? "forward" : "back",
                     std::abs(reset.back));
}

std::optional<double> BiasTable::find(Id tag, Id anchor) const {
  if (const auto link = of_link.find({tag, anchor}); link != of_link.end()) return link->second;
  if (const auto any = of_anchor.find(anchor); any != of_anchor.end()) return any->second;
  return std::nullopt;
}

Points read_anchors(const std::filesystem::path& file, Problems& problems) {
  return read_points(file, "anchor_id", problems);
}

Points read_tags(const std::filesystem::path& file, Problems& problems) {
  return read_points(file, "tag_id", problems);
}

BiasTable read_bias(const std::filesystem::path& file, Problems& problems) {
  BiasTable table;
  const auto columns = {Column{"anchor_id", true}, Column{"bias_m", true}, Column{"tag_id"}};
  read_csv(file, columns, problems, [&](const Row& row) {
    if (row.empty(1)) return;
    const Id anchor = row.id(0);
    const double bias = row.number(1);
    const bool fresh = row.empty(2)
                           ? table.of_anchor.emplace(anchor, bias).second
                           : table.of_link.emplace(std::pair{row.id(2), anchor}, bias).second;
    if (!fresh) throw std::runtime_error{"this link was given before; expected each once"};
  });
  return table;
}

PowerBiasTable read_power_bias(const std::filesystem::path& file, Problems& problems) {
  PowerBiasTable table;
  read_csv(file, {Column{"power_dbm", true}, Column{"bias_m", true}}, problems,
           [&](const Row& row) { table.push_back({row.number(0), row.number(1)}); });
  std::ranges::stable_sort(table,
                           [](const auto& a, const auto& b) { return a.power_dbm < b.power_dbm; });
  if (!RangeBias<double>::make(table)) {
    throw Failure{
        fmt::format("{}: expected one row or more, and each power_dbm once", file.string())};
  }
  return table;
}

Trajectory read_trajectory(const std::filesystem::path& file, Problems& problems) {
  constexpr std::size_t cells = 8;
  std::vector<StampedPose> poses;
  read_lines(file, [&](std::string_view line, std::size_t number) {
    std::array<double, cells> values{};
    std::size_t count = 0;
    std::size_t place = 0;
    const auto is_space = [](char c) { return c == ' ' || c == '\t'; };
    if (line.size() > kLongestLine) {
      problems.malformed(file, number, 1, "the line exceeds 64 KiB");
      return;
    }
    while (true) {
      while (place < line.size() && is_space(line[place])) ++place;
      if (place == line.size() || (count == 0 && line[place] == '#')) break;
      const std::size_t start = place;
      while (place < line.size() && !is_space(line[place])) ++place;
      const auto value = parse_number(line.substr(start, place - start));
      if (!value) {
        problems.malformed(file, number, start + 1,
                           "expected a finite number; a row is t_s x_m y_m z_m qx qy qz qw, "
                           "separated by spaces");
        return;
      }
      if (count < cells) values[count] = *value;
      ++count;
    }
    if (count == 0) return;
    if (count != cells) {
      problems.malformed(
          file, number, 0,
          fmt::format("expected 8 numbers, t_s x_m y_m z_m qx qy qz qw, found {}", count));
      return;
    }
    const double norm =
        std::hypot(std::hypot(values[4], values[5]), std::hypot(values[6], values[7]));
    constexpr double tolerance = 0.01;  // files print quaternions to two digits or more
    if (!(std::abs(norm - 1) < tolerance)) {
      problems.malformed(
          file, number, 0,
          fmt::format("expected a quaternion of length 1, found length {:.6g}", norm));
      return;
    }
    poses.push_back({values[0],
                     {values[1], values[2], values[3]},
                     {values[4] / norm, values[5] / norm, values[6] / norm, values[7] / norm}});
  });
  if (poses.empty()) {
    throw Failure{fmt::format("{}: holds no pose; expected rows of t_s x_m y_m z_m qx qy qz qw",
                              file.string())};
  }
  return Trajectory{std::move(poses)};
}

Log<Reading> read_ranges(const std::filesystem::path& file, Problems& problems) {
  enum : std::size_t { kTime, kAnchor, kRange, kTag, kSigma, kRssi, kFirstPath };
  Log<Reading> log{file, {}, {}};
  const auto columns = {Column{"t_s", true},   Column{"anchor_id", true}, Column{"range_m", true},
                        Column{"tag_id"},      Column{"sigma_m"},         Column{"rssi_dbm"},
                        Column{"fp_power_dbm"}};
  log.counts.rows = read_csv(file, columns, problems, [&](const Row& row) {
    Reading reading{row.number(kTime),
                    row.id_or(kTag, 0),
                    row.id(kAnchor),
                    0,
                    row.optional_positive(kSigma),
                    power_of(row, kFirstPath, kRssi),
                    row.line()};
    if (row.empty(kRange)) {
      ++log.counts.no_reading;
      return;
    }
    reading.range = row.number(kRange);
    log.rows.push_back(reading);
  });
  put_in_order(log);
  return log;
}

Log<Exchange> read_twr(const std::filesystem::path& file, Problems& problems) {
  enum : std::size_t {
    kTime,
    kAnchor,
    kPollTx,
    kPollRx,
    kRespTx,
    kRespRx,
    kTag,
    kFinalTx,
    kFinalRx,
    kOffset,
    kFirstPath,
    kTrue,
    kLogged,
    kRssi
  };
  Log<Exchange> log{file, {}, {}};
  const auto columns = {
      Column{"t_s", true},        Column{"anchor_id", true}, Column{"poll_tx", true},
      Column{"poll_rx", true},    Column{"resp_tx", true},   Column{"resp_rx", true},
      Column{"tag_id"},           Column{"final_tx"},        Column{"final_rx"},
      Column{"clock_offset_ppm"}, Column{"fp_power_dbm"},    Column{"true_range_m"},
      Column{"logged_range_m"},   Column{"rssi_dbm"}};
  log.counts.rows = read_csv(file, columns, problems, [&](const Row& row) {
    Exchange e{};
    e.t = row.number(kTime);
    e.tag = row.id_or(kTag, 0);
    e.anchor = row.id(kAnchor);
    e.line = row.line();
    for (std::size_t column = kPollTx; column <= kRespRx; ++column) {
      if (row.empty(column)) {
        ++log.counts.no_reading;
        return;
      }
    }
    e.poll_tx = row.ticks(kPollTx);
    e.poll_rx = row.ticks(kPollRx);
    e.resp_tx = row.ticks(kRespTx);
    e.resp_rx = row.ticks(kRespRx);
    if (!row.empty(kFinalTx) && !row.empty(kFinalRx)) {
      e.final = {row.ticks(kFinalTx), row.ticks(kFinalRx)};
    }
    if (const auto ppm = row.optional_number(kOffset)) e.clock_offset = *ppm * 1e-6;
    e.power = power_of(row, kFirstPath, kRssi);
    e.true_range = row.optional_number(kTrue);
    e.logged_range = row.optional_number(kLogged);
    log.rows.push_back(e);
  });
  put_in_order(log);
  return log;
}

Log<Arrival> read_ultrasonic(const std::filesystem::path& file, Problems& problems) {
  enum : std::size_t { kTime, kReceiver, kCount, kTemperature };
  Log<Arrival> log{file, {}, {}};
  const auto columns = {Column{"t_s", true}, Column{"receiver_id", true}, Column{"count", true},
                        Column{"temperature_c"}};
  log.counts.rows = read_csv(file, columns, problems, [&](const Row& row) {
    Arrival arrival{row.number(kTime), row.id(kReceiver), 0, row.optional_number(kTemperature),
                    row.line()};
    if (row.empty(kCount)) {
      ++log.counts.no_reading;
      return;
    }
    arrival.count = row.id(kCount);
    log.rows.push_back(arrival);
  });
  put_in_order(log);
  return log;
}

Log<Difference> read_tdoa(const std::filesystem::path& file, Problems& problems) {
  enum : std::size_t { kTime, kAnchorA, kAnchorB, kDifference, kTag, kSigma };
  Log<Difference> log{file, {}, {}};
  const auto columns = {Column{"t_s", true},
                        Column{"anchor_id_a", true},
                        Column{"anchor_id_b", true},
                        Column{"difference_m", true},
                        Column{"tag_id"},
                        Column{"sigma_m"}};
  log.counts.rows = read_csv(file, columns, problems, [&](const Row& row) {
    Difference difference{row.number(kTime),
                          row.id_or(kTag, 0),
                          row.id(kAnchorA),
                          row.id(kAnchorB),
                          0,
                          row.optional_positive(kSigma),
                          row.line()};
    if (difference.anchor_a == difference.anchor_b) {
      throw std::runtime_error{"expected two anchors, found the same one twice"};
    }
    if (row.empty(kDifference)) {
      ++log.counts.no_reading;
      return;
    }
    difference.difference = row.number(kDifference);
    log.rows.push_back(difference);
  });
  put_in_order(log);
  return log;
}

Log<InertialReading> read_imu(const std::filesystem::path& file, Problems& problems) {
  Log<InertialReading> log{file, {}, {}};
  const auto columns = {Column{"t_s", true},          Column{"gyro_x_radps", true},
                        Column{"gyro_y_radps", true}, Column{"gyro_z_radps", true},
                        Column{"acc_x_mps2", true},   Column{"acc_y_mps2", true},
                        Column{"acc_z_mps2", true}};
  constexpr std::size_t cells = 7;
  log.counts.rows = read_csv(file, columns, problems, [&](const Row& row) {
    const double t = row.number(0);
    for (std::size_t column = 1; column < cells; ++column) {
      if (row.empty(column)) {
        ++log.counts.no_reading;
        return;
      }
    }
    log.rows.push_back({t,
                        {row.number(1), row.number(2), row.number(3)},
                        {row.number(4), row.number(5), row.number(6)}});
  });
  put_in_order(log);
  return log;
}

}  // namespace uwbpos::host
