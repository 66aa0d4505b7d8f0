// SPDX-License-Identifier: MIT
#include "epochs.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

#include "uwbpos/core/constants.hpp"

#include "statistics.hpp"

namespace uwbpos::host {
namespace {

constexpr double kFallbackWindow = 0.1;

// Epochs and the place of each one's first reading in the log.
using Placed = std::vector<std::pair<std::size_t, Epoch>>;

void close(Placed& closed, Epoch& open, std::size_t first) {
  if (open.readings.empty()) return;
  const double start = open.readings.front().t;
  double sum = 0;
  for (const Reading& reading : open.readings) sum += reading.t - start;
  open.t = start + sum / static_cast<double>(open.readings.size());
  closed.emplace_back(first, Epoch{open.tag, open.t, std::exchange(open.readings, {})});
}

}  // namespace

EpochRule epoch_rule(const std::vector<Reading>& readings, std::optional<double> window) {
  if (window) return {*window, std::numeric_limits<double>::infinity()};
  std::map<std::pair<Id, Id>, double> last;
  std::map<Id, double> last_of_tag;
  std::vector<double> gaps;
  std::size_t with_neighbour = 0;
  std::size_t counted = 0;
  for (const Reading& reading : readings) {
    const auto [link, fresh] = last.try_emplace({reading.tag, reading.anchor}, reading.t);
    if (!fresh && reading.t == link->second) continue;  // a row that is there twice counts once
    if (!fresh && reading.t > link->second) gaps.push_back(reading.t - link->second);
    link->second = reading.t;
    ++counted;
    const auto [tag, first_of_tag] = last_of_tag.try_emplace(reading.tag, reading.t);
    if (!first_of_tag && reading.t == tag->second) ++with_neighbour;
    tag->second = reading.t;
  }
  if (2 * with_neighbour >= counted) return {0, 0};
  if (gaps.empty()) return {kFallbackWindow, kFallbackWindow};
  const double period = quantile(std::move(gaps), 0.75);
  return {0.75 * period, 0.5 * period};
}

Epochs group_epochs(const std::vector<Reading>& readings, const EpochRule& rule) {
  struct Open {
    Epoch epoch;
    std::size_t first = 0;
    std::map<Id, double> seen;  // anchor, when it last reported
  };
  Epochs result;
  Placed closed;
  std::map<Id, Open> open_of_tag;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const Reading& reading = readings[i];
    Open& open = open_of_tag[reading.tag];
    if (!open.epoch.readings.empty()) {
      const auto seen = open.seen.find(reading.anchor);
      const bool repeats = seen != open.seen.end();
      if (repeats && reading.t == seen->second) {
        ++result.duplicates;
        continue;
      }
      if (reading.t - open.epoch.readings.front().t > rule.window + kTimeRounding ||
          (repeats && reading.t - seen->second >= rule.repeat_gap) ||
          open.epoch.readings.size() == static_cast<std::size_t>(kMaxMeasurements)) {
        close(closed, open.epoch, open.first);
        open.seen.clear();
      }
    }
    if (open.epoch.readings.empty()) {
      open.epoch.tag = reading.tag;
      open.first = i;
    }
    open.epoch.readings.push_back(reading);
    open.seen[reading.anchor] = reading.t;
  }
  for (auto& [tag, open] : open_of_tag) close(closed, open.epoch, open.first);

  std::ranges::sort(closed, [](const auto& a, const auto& b) { return a.first < b.first; });
  result.epochs.reserve(closed.size());
  for (auto& [first, epoch] : closed) result.epochs.push_back(std::move(epoch));
  return result;
}

}  // namespace uwbpos::host
