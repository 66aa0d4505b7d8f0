// SPDX-License-Identifier: MIT
#include "ultrasonic.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "uwbpos/ranging/ultrasonic.hpp"
#include "uwbpos/solve/fsri.hpp"

#include "epochs.hpp"

namespace uwbpos::host {
namespace {

// Solves shots one after the other.
template <int D>
class ShotSolver {
 public:
  ShotSolver(const UltrasonicSettings& settings, const Site& site, UltrasonicReplay& found)
      : settings_{settings}, site_{site}, found_{found} {
    if (settings.common.prior) prior_ = settings.common.prior->head<D>();
  }

  // `wave`: at the temperature of this shot [m].
  void solve(const Epoch& epoch, double wave) {
    std::vector<Vec<double, D>> receivers;
    std::vector<double> lengths;
    for (const Reading& reading : epoch.readings) {
      receivers.push_back(site_.anchors.at(reading.anchor).template head<D>());
      lengths.push_back(reading.range);
    }
    FsriOptions<double, D> options;
    options.wavelength = wave;
    options.max_lag = settings_.max_lag * wave;
    options.max_repair = settings_.max_repair;
    options.sigma = settings_.common.sigma;
    options.prior = prior_;
    options.prior_sigma = settings_.prior_sigma;
    if (settings_.common.side != Side::kUnknown) {
      options.side[D - 1] = upwards(settings_.common.side).z();
    }
    Replay& replay = found_.replay;
    Outcome& outcome = replay.of_tag[epoch.tag];
    ++outcome.epochs;
    const auto start = std::chrono::steady_clock::now();
    const auto shot = fsri(receivers, lengths, options);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    replay.solve_seconds += taken.count();
    ++replay.solve_calls;
    if (!shot) {
      ++outcome.rejected[std::string{reason_name(shot.error())}];
      return;
    }
    ++outcome.solved;
    if (settings_.follow) prior_ = shot->position;
    Vec3 position{0, 0, settings_.common.height.value_or(0)};
    position.template head<D>() = shot->position;
    replay.track.push_back({epoch.t, epoch.tag, position, shot->chi_squared,
                            shot->degrees_of_freedom, static_cast<int>(lengths.size()), false,
                            std::nullopt});
    found_.shots.push_back(
        {epoch.t,
         shot->lag,
         {shot->repair.begin(), shot->repair.begin() + static_cast<std::ptrdiff_t>(lengths.size())},
         shot->ambiguous,
         shot->residual});
  }

 private:
  const UltrasonicSettings& settings_;
  const Site& site_;
  UltrasonicReplay& found_;
  std::optional<Vec<double, D>> prior_;
};

}  // namespace

std::vector<std::pair<std::string, std::size_t>> UltrasonicReplay::repairs() const {
  std::map<std::vector<int>, std::size_t> counts;
  for (const ShotDetail& shot : shots) ++counts[shot.repair];
  std::vector<std::pair<std::string, std::size_t>> named;
  for (const auto& [repair, count] : counts) {
    const bool none = std::ranges::all_of(repair, [](int waves) { return waves == 0; });
    named.emplace_back(none ? "none" : fmt::format("({})", fmt::join(repair, ", ")), count);
  }
  std::map<std::string, std::size_t> merged;  // shots of fewer receivers have a `none` of their own
  for (const auto& [name, count] : named) merged[name] += count;
  named.assign(merged.begin(), merged.end());
  std::ranges::stable_sort(named, [](const auto& a, const auto& b) { return a.second > b.second; });
  return named;
}

std::size_t UltrasonicReplay::ambiguous() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(shots, [](const ShotDetail& shot) { return shot.ambiguous; }));
}

std::size_t UltrasonicReplay::repaired() const {
  return static_cast<std::size_t>(std::ranges::count_if(shots, [](const ShotDetail& shot) {
    return std::ranges::any_of(shot.repair, [](int waves) { return waves != 0; });
  }));
}

UltrasonicReplay replay_ultrasonic(const UltrasonicSettings& settings, const Site& site,
                                   const std::vector<Arrival>& arrivals) {
  UltrasonicReplay found;
  Replay& replay = found.replay;
  // Here a side or a prior tells no dimension: a bar has them in the plane.
  Settings of_dim = settings.common;
  of_dim.side = Side::kUnknown;
  of_dim.prior.reset();
  replay.dim = choose_dim(of_dim, site.anchors);
  std::vector<Reading> readings;
  std::map<double, double> wave_at;
  double temperature = settings.temperature;
  for (const Arrival& arrival : arrivals) {
    if (!site.anchors.contains(arrival.receiver)) {
      ++replay.unknown_anchors[arrival.receiver];
      continue;
    }
    const double here = arrival.temperature.value_or(temperature);
    const auto length =
        ultrasonic_length<double>(arrival.count, {.temperature = here,
                                                  .tick = settings.tick,
                                                  .circuit_delay = settings.circuit_delay,
                                                  .max_length = settings.common.max_range});
    if (!length) {
      ++replay.refused_readings[std::string{reason_name(length.error())}];
      continue;
    }
    temperature = here;
    wave_at[arrival.t] = *ultrasonic_wavelength(here, settings.frequency);
    readings.push_back(
        {arrival.t, 0, arrival.receiver, length->value, std::nullopt, std::nullopt, arrival.line});
  }
  replay.rule = epoch_rule(readings, settings.common.epoch_window);
  Epochs grouped = group_epochs(readings, replay.rule);
  replay.duplicates = grouped.duplicates;
  const auto solve_all = [&](auto solver) {
    for (Epoch& epoch : grouped.epochs) {
      std::ranges::sort(epoch.readings, {}, &Reading::anchor);
      const double wave = std::prev(wave_at.upper_bound(epoch.t))->second;
      found.wave = std::max(found.wave, wave);
      solver.solve(epoch, wave);
    }
  };
  if (replay.dim == 2) {
    solve_all(ShotSolver<2>{settings, site, found});
  } else {
    solve_all(ShotSolver<3>{settings, site, found});
  }
  score(site, replay);
  return found;
}

}  // namespace uwbpos::host
