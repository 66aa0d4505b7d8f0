// SPDX-License-Identifier: MIT
#include "simulate.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "uwbpos/ranging/ds_twr.hpp"
#include "uwbpos/ranging/uplink_subnet.hpp"
#include "uwbpos/sim/uplink.hpp"

#include "command_line.hpp"
#include "failure.hpp"
#include "formats.hpp"
#include "output.hpp"
#include "progress.hpp"

namespace uwbpos::host {
namespace {

sim::Radio radio_of(RadioModel model) {
  switch (model) {
    case RadioModel::kIdeal:
      return sim::ideal_radio();
    case RadioModel::kDw3000:
      return sim::dw3000_radio();
    case RadioModel::kDeliveryRobot:
      return sim::delivery_robot_radio();
    case RadioModel::kDw1000:
      break;
  }
  return sim::dw1000_radio();
}

// The value, or a Failure that names what was asked for.
template <class T>
T expect(Result<T> result, std::string_view what) {
  if (!result) throw Failure{fmt::format("simulate: {}: {}", what, describe(result.error()))};
  if constexpr (!std::is_void_v<T>) return *std::move(result);
}

sim::Path path_of(const SimulateSettings& s) {
  const double wall = std::min({1.0, s.hall[0] / 4, s.hall[1] / 4});
  const Vec3 low{wall, wall, s.tag_height};
  const Vec3 high{s.hall[0] - wall, s.hall[1] - wall, s.tag_height};
  if (s.path == PathShape::kCircle) {
    return sim::Circle{.centre = {s.hall[0] / 2, s.hall[1] / 2, s.tag_height},
                       .radius = std::min(s.hall[0], s.hall[1]) / 2 - wall,
                       .speed = s.speed};
  }
  if (s.path == PathShape::kStops) {
    constexpr int places = 30;
    constexpr double dwell = 2;  // [s]
    sim::Random random{s.seed, "stops"};
    sim::Stops stops = expect(sim::random_stops(low, high, places, random), "--path");
    stops.dwell = dwell;
    return stops;
  }
  constexpr double lane_width = 2;  // [m]
  const int lanes = std::clamp(static_cast<int>((high.y() - low.y()) / lane_width) + 1, 2, 60);
  sim::Route route = expect(sim::lawn_mower(low, high, lanes), "--path");
  route.speed = s.speed;
  return route;
}

// TUM's rotation about +z of a body that looks along `forward`.
std::pair<double, double> half_turn(const Vec<double, 2>& forward) {
  const double half = std::atan2(forward.y(), forward.x()) / 2;
  return {std::sin(half), std::cos(half)};
}

template <class... Arguments>
void append(std::string& text, fmt::format_string<Arguments...> format, Arguments&&... arguments) {
  fmt::format_to(std::back_inserter(text), format, std::forward<Arguments>(arguments)...);
}

// A row of twr.csv; the cells of frames that did not arrive stay empty.
void append_exchange(std::string& text, double t, const sim::Shot& shot) {
  const sim::Exchange& e = shot.exchange;
  const DsTwrStamps& s = e.stamps;
  const auto cell = [](int needed, int frames, DeviceTime<> stamp) {
    return frames >= needed ? fmt::format("{}", stamp.ticks()) : std::string{};
  };
  append(text, "{:.6f},{},{},{},{},{},{},{},{},{:.3f},{:.5f}\n", t, shot.tag_id, shot.anchor_id,
         cell(0, e.frames, s.poll_tx), cell(1, e.frames, s.poll_rx), cell(1, e.frames, s.resp_tx),
         cell(2, e.frames, s.resp_rx), cell(3, e.frames, s.final_tx), cell(3, e.frames, s.final_rx),
         e.measured_clock_offset * 1e6, sim::ds_distance(e));
}

void append_truth(std::string& text, double t, const sim::BodyState& body) {
  const auto [sine, cosine] = half_turn(body.forward);
  append(text, "{:.6f} {:.5f} {:.5f} {:.5f} 0 0 {:.7f} {:.7f}\n", t, body.position.x(),
         body.position.y(), body.position.z(), sine, cosine);
}

// Where anchors hang and tags are mounted.
void write_place(const sim::Scenario& scenario, const std::filesystem::path& directory) {
  std::string anchors = "anchor_id,x_m,y_m,z_m\n";
  for (const auto& anchor : scenario.anchors) {
    append(anchors, "{},{:.4f},{:.4f},{:.4f}\n", anchor.id, anchor.position.x(),
           anchor.position.y(), anchor.position.z());
  }
  std::string tags = "tag_id,x_m,y_m,z_m\n";
  for (int i = 0; i < scenario.tag_count; ++i) {
    const sim::Tag& tag = scenario.tags[static_cast<std::size_t>(i)];
    append(tags, "{},{:.4f},{:.4f},{:.4f}\n", tag.id, tag.lever.x(), tag.lever.y(), tag.lever.z());
  }
  write_file(directory / "anchors.csv", anchors);
  write_file(directory / "tags.csv", tags);
}

using Uplink = UplinkSubnet<double, 3, sim::kMaxSubnetAnchors>;

struct LoggedDifference {
  Id anchor_a;
  Id anchor_b;
  double difference;
  double sigma;
};

// The differences of one blink that are logged.
std::vector<LoggedDifference> differences_of(const Uplink& uplink,
                                             const std::vector<BlinkArrival>& arrivals,
                                             std::int64_t host, LogKind kind, sim::Random& random) {
  std::vector<LoggedDifference> logged;
  if (kind == LogKind::kShared) {
    const auto blink = uplink.differences(arrivals, host);
    if (!blink) return logged;
    for (const DifferenceTo<double, 3>& d : blink->differences()) {
      const auto anchor = std::ranges::find_if(
          uplink.anchors(), [&](const auto& entry) { return entry.position == d.anchor; });
      logged.push_back(
          {blink->reference_id, anchor->id, d.difference, std::numbers::sqrt2 * blink->sigma});
    }
    return logged;
  }
  const int count = static_cast<int>(arrivals.size());
  if (count < 2) return logged;
  const int a = random.integer(0, count - 1);
  const int b = (a + random.integer(1, count - 1)) % count;
  const BlinkArrival& from = arrivals[static_cast<std::size_t>(a)];
  const BlinkArrival& to = arrivals[static_cast<std::size_t>(b)];
  const auto time_a = uplink.arrival(from, host);
  const auto time_b = uplink.arrival(to, host);
  if (!time_a || !time_b) return logged;
  if (const auto d = tdoa_uplink_difference(*time_a, *time_b)) {
    logged.push_back({from.anchor_id, to.anchor_id, d->value, std::sqrt(d->variance)});
  }
  return logged;
}

}  // namespace

sim::Scenario make_scenario(const SimulateSettings& s) {
  if (s.hall.size() != 3 || !(s.hall[0] > 0) || !(s.hall[1] > 0) || !std::isfinite(s.hall[2])) {
    throw Failure{"simulate: --hall: expected WIDTH,DEPTH,HEIGHT in metres, the first two above 0"};
  }
  sim::Scenario scenario;
  const double second = s.other_height < 0 ? s.hall[2] : s.other_height;
  scenario.anchors =
      expect(sim::hang_anchors({s.hall[0], s.hall[1], s.hall[2], second}, s.anchors, s.placement),
             "--anchor-count and --placement");
  scenario.path = path_of(s);
  scenario.radio = radio_of(s.radio);
  scenario.radio.loss = s.loss;
  scenario.blockage = {
      .probability = s.blocked, .mean_duration = 2, .minimum_excess = 0.1, .mean_excess = 0.3};
  scenario.tag_count = s.tags;
  if (s.tags > 1) {
    constexpr double arm = 0.3;  // [m]
    for (int i = 0; i < s.tags; ++i) {
      const double angle = 2 * std::numbers::pi * (i + 0.25) / s.tags;
      scenario.tags[static_cast<std::size_t>(i)] = {
          static_cast<std::uint32_t>(i), {arm * std::cos(angle), arm * std::sin(angle), 0}};
    }
  }
  scenario.epoch_rate = s.rate;
  // All exchanges of an epoch side by side in its first half, to keep its readings together.
  scenario.slot = std::min(2e-3, 0.5 / (s.rate * s.tags * s.anchors));
  scenario.seed = s.seed;
  return scenario;
}

SimulatedLogs write_simulation(const sim::Scenario& scenario,
                               const std::filesystem::path& directory) {
  auto run = sim::Simulation::start(scenario);
  if (!run) {
    throw Failure{fmt::format("simulate: {}; do --rate, the tags and the anchors fit together?",
                              describe(run.error()))};
  }
  std::string twr =
      "t_s,tag_id,anchor_id,poll_tx,poll_rx,resp_tx,resp_rx,final_tx,final_rx,clock_offset_ppm,"
      "true_range_m\n";
  std::string ranges = "t_s,tag_id,anchor_id,range_m,sigma_m\n";
  std::string truth = "# t_s x_m y_m z_m qx qy qz qw\n";
  SimulatedLogs logs;
  Progress progress{"simulating"};
  const auto epochs = static_cast<std::size_t>(sim::epoch_count(scenario));
  while (const auto shot = run->next()) {
    const double t = sim::to_seconds(shot->exchange.time);
    logs.seconds = t - sim::to_seconds(scenario.start);
    ++logs.exchanges;
    progress(static_cast<std::size_t>(shot->epoch), epochs);
    append_exchange(twr, t, *shot);
    append_truth(truth, t, shot->body);
    const auto stamps = sim::ds_stamps(shot->exchange);
    const auto range = stamps
                           ? ds_twr_range<double>(*stamps)
                           : Result<Measured<double>>{std::unexpected(Error::TooFewMeasurements)};
    if (!range) continue;
    ++logs.complete;
    append(ranges, "{:.6f},{},{},{:.4f},{:.4f}\n", t, shot->tag_id, shot->anchor_id, range->value,
           std::sqrt(range->variance));
  }
  make_directory(directory);
  write_place(scenario, directory);
  write_file(directory / "twr.csv", twr);
  write_file(directory / "ranges.csv", ranges);
  write_file(directory / "truth.tum", truth);
  return logs;
}

SimulatedLogs write_tdoa_simulation(const SimulateSettings& settings) {
  const sim::Scenario scenario = make_scenario(settings);
  if (scenario.anchors.size() > sim::kMaxSubnetAnchors) {
    throw Failure{fmt::format("simulate: --anchor-count: expected up to {} anchors with --tdoa",
                              sim::kMaxSubnetAnchors)};
  }
  constexpr Id control = 1;
  sim::UplinkScenario uplink_scenario{.site = {.path = scenario.path}};
  sim::Site& site = uplink_scenario.site;
  expect(sim::add(site, expect(sim::make_subnet(scenario.anchors, control), "--anchor-count")),
         "--anchor-count");
  site.tags = scenario.tags;
  site.tag_count = scenario.tag_count;
  site.radio = scenario.radio;
  site.blockage = scenario.blockage;
  site.seed = scenario.seed;
  uplink_scenario.blink_rate = settings.rate;
  auto run = expect(sim::UplinkSimulation::start(uplink_scenario), "--rate");
  Uplink uplink = expect(Uplink::make(site.subnets[0].anchors, control), "--anchor-count");

  std::string tdoa = "t_s,tag_id,anchor_id_a,anchor_id_b,difference_m,sigma_m\n";
  std::string truth = "# t_s x_m y_m z_m qx qy qz qw\n";
  SimulatedLogs logs;
  sim::Random random{settings.seed, "pairs and outliers"};
  while (const auto event = run.next()) {
    const auto& anchors = site.subnets[0].anchors;
    if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) {
      for (int i = 0; i < anchors.size(); ++i) {
        const sim::Reception& at = frame->receptions[static_cast<std::size_t>(i)];
        // What cannot be used is for the tracker to refuse.
        if (at.received) (void)uplink.sync(anchors[i].id, frame->tx, at.rx, frame->host);
      }
      continue;
    }
    const auto& blink = std::get<sim::Blink>(*event);
    const double t = sim::to_seconds(blink.time);
    logs.seconds = t - sim::to_seconds(site.start);
    ++logs.exchanges;
    append_truth(truth, t, blink.body);
    std::vector<BlinkArrival> arrivals;
    for (int i = 0; i < anchors.size(); ++i) {
      const sim::Reception& at = blink.receptions[0][static_cast<std::size_t>(i)];
      if (at.received) arrivals.push_back({anchors[i].id, at.rx});
    }
    for (const LoggedDifference& d :
         differences_of(uplink, arrivals, blink.host, settings.kind, random)) {
      const bool outlier = random.chance(settings.outliers);
      const double off = random.uniform(0.5, 4) * (random.chance(0.5) ? 1 : -1);
      ++logs.complete;
      append(tdoa, "{:.6f},{},{},{},{:.4f},{:.4f}\n", t, blink.tag_id, d.anchor_a, d.anchor_b,
             d.difference + (outlier ? off : 0), d.sigma);
    }
  }
  make_directory(settings.out);
  write_place(scenario, settings.out);
  write_file(settings.out / "tdoa.csv", tdoa);
  write_file(settings.out / "truth.tum", truth);
  return logs;
}

int run_simulate(const SimulateSettings& settings) {
  if (settings.kind != LogKind::kTwoWay) {
    const SimulatedLogs logs = write_tdoa_simulation(settings);
    const std::string out = settings.out.string();
    fmt::print(
        "{} blinks over {:.1f} s, {} differences, in {}: anchors.csv, tags.csv, tdoa.csv,\n"
        "truth.tum. Replay them with:\n"
        "  uwbpos replay --anchors {}/anchors.csv --tags {}/tags.csv --tdoa {}/tdoa.csv \\\n"
        "    --truth {}/truth.tum --height {:g} --out {}/replay\n",
        logs.exchanges, logs.seconds, logs.complete, out, out, out, out, out, settings.tag_height,
        out);
    return kSuccess;
  }
  const SimulatedLogs logs = write_simulation(make_scenario(settings), settings.out);
  const std::string out = settings.out.string();
  fmt::print(
      "{} exchanges over {:.1f} s, {} of them complete, in {}: anchors.csv, tags.csv, twr.csv,\n"
      "ranges.csv, truth.tum. Replay them with:\n"
      "  uwbpos replay --anchors {}/anchors.csv --tags {}/tags.csv --twr {}/twr.csv \\\n"
      "    --truth {}/truth.tum --height {:g} --out {}/replay\n",
      logs.exchanges, logs.seconds, logs.complete, out, out, out, out, out, settings.tag_height,
      out);
  return kSuccess;
}

}  // namespace uwbpos::host
