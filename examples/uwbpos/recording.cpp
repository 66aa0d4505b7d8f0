// SPDX-License-Identifier: MIT
#include "recording.hpp"

#include <algorithm>
#include <iterator>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "clock_resets.hpp"
#include "failure.hpp"
#include "pose_remarks.hpp"

namespace uwbpos::host {
namespace {

// `3 (12 readings), 7 (1 reading)`, the most frequent few.
std::string listed(const std::map<Id, std::size_t>& counts) {
  constexpr std::size_t most = 6;
  std::vector<std::pair<Id, std::size_t>> entries{counts.begin(), counts.end()};
  std::ranges::stable_sort(entries,
                           [](const auto& a, const auto& b) { return a.second > b.second; });
  std::vector<std::string> words;
  for (const auto& [id, count] : entries) {
    if (words.size() == most) {
      words.push_back(fmt::format("and {} more", entries.size() - most));
      break;
    }
    words.push_back(fmt::format("{} ({})", id, count_of(count, "reading")));
  }
  return fmt::format("{}", fmt::join(words, ", "));
}

std::size_t readings_in(const std::map<Id, std::size_t>& counts) {
  std::size_t sum = 0;
  for (const auto& [id, count] : counts) sum += count;
  return sum;
}

// Moves all rows from a time on.
template <class T>
auto mover_of(std::vector<T>& rows) {
  return [&rows](double since, double later) {
    for (T& row : rows) row.t += row.t >= since ? later : 0;
  };
}

}  // namespace

std::string count_of(std::size_t count, std::string_view singular) {
  return fmt::format("{} {}{}", count, singular, count == 1 ? "" : "s");
}

std::string reading_count(const Recording& recording) {
  std::string text;
  if (!recording.readings.empty() || recording.differences.empty()) {
    text = count_of(recording.readings.size(), "range");
  }
  if (!recording.differences.empty()) {
    if (!text.empty()) text += " and ";
    text += count_of(recording.differences.size(), "difference");
  }
  if (!recording.samples.empty()) {
    text += " and " + count_of(recording.samples.size(), "inertial sample");
  }
  return text;
}

Recording read_recording(const Settings& settings, Problems& problems) {
  Recording recording;
  Site& site = recording.site;
  if (!settings.anchors.empty()) {
    site.anchors = read_anchors(settings.anchors, problems);
    if (site.anchors.empty()) {
      throw Failure{fmt::format("{}: holds no anchor", settings.anchors.string())};
    }
  }
  if (!settings.subnets.empty()) {
    site.subnets = read_subnets(settings.subnets, settings.anchors, site.anchors, problems);
  }
  if (!settings.tags.empty()) {
    site.tags = read_tags(settings.tags, problems);
    if (site.tags.empty()) throw Failure{fmt::format("{}: holds no tag", settings.tags.string())};
  }
  if (!settings.bias_network.empty()) {
    site.network = std::make_shared<const LinkNetwork>(settings.bias_network);
  }
  if (!settings.attitude.empty()) site.attitude = read_trajectory(settings.attitude, problems);
  if (!settings.bias.empty()) site.bias = read_bias(settings.bias, problems);
  if (!settings.truth.empty()) site.truth = read_trajectory(settings.truth, problems);
  PowerBiasTable power_table;
  std::optional<RangeBias<double>> power_bias;
  if (!settings.power_bias.empty()) {
    power_table = read_power_bias(settings.power_bias, problems);
    power_bias = *RangeBias<double>::make(power_table);
  }

  std::vector<ClockReset> of_ranges;
  std::vector<ClockReset> of_differences;
  std::vector<ClockReset> of_samples;
  const auto add_counts = [&](const LogCounts& counts, std::vector<ClockReset>& resets) {
    recording.counts.rows += counts.rows;
    recording.counts.no_reading += counts.no_reading;
    recording.counts.out_of_order += counts.out_of_order;
    resets = counts.clock_resets;
  };
  if (!settings.ranges.empty()) {
    Log<Reading> log = read_ranges(settings.ranges, problems);
    recording.log = log.file;
    add_counts(log.counts, of_ranges);
    recording.readings = std::move(log.rows);
    for (Reading& reading : recording.readings) {
      if (power_bias && reading.power) reading.range -= power_bias->at(*reading.power).value_or(0);
    }
  } else if (!settings.twr.empty()) {
    const Log<Exchange> log = read_twr(settings.twr, problems);
    recording.log = log.file;
    add_counts(log.counts, of_ranges);
    recording.ranging = ranges_from_exchanges(log.rows, settings, power_bias);
    recording.readings = recording.ranging->readings;
  }
  if (!settings.tdoa.empty()) {
    Log<Difference> log = read_tdoa(settings.tdoa, problems);
    if (recording.log.empty()) recording.log = log.file;
    add_counts(log.counts, of_differences);
    recording.differences = std::move(log.rows);
  }
  if (recording.counts.rows == 0) {
    throw Failure{fmt::format("{}: has a header row and nothing below it", recording.log.string())};
  }
  if (!settings.imu.empty()) {
    Log<InertialReading> log = read_imu(settings.imu, problems);
    if (log.rows.empty()) {
      throw Failure{fmt::format("{}: holds no sample of an inertial unit", log.file.string())};
    }
    add_counts(log.counts, of_samples);
    recording.samples = std::move(log.rows);
  }
  align_clock_resets({{of_ranges, mover_of(recording.readings)},
                      {of_differences, mover_of(recording.differences)},
                      {of_samples, mover_of(recording.samples)}});
  for (const auto& of_log : {of_ranges, of_differences, of_samples}) {
    std::ranges::copy(of_log, std::back_inserter(recording.counts.clock_resets));
  }
  double first = std::numeric_limits<double>::infinity();
  double last = -first;
  const auto spans = [&](const auto& rows) {
    if (rows.empty()) return;
    first = std::min(first, rows.front().t);
    last = std::max(last, rows.back().t);
  };
  spans(recording.readings);
  spans(recording.differences);
  if (last > first) recording.seconds = last - first;
  return recording;
}

std::vector<std::string> remarks(const Recording& recording, const Replay& replay,
                                 const Problems& problems) {
  std::vector<std::string> said;
  for (const auto& [file, count] : problems.counts()) {
    said.push_back(fmt::format("{}: {} skipped as malformed.", file, count_of(count, "row")));
  }
  if (recording.counts.no_reading > 0) {
    said.push_back(fmt::format("{} without a reading (an empty cell).",
                               count_of(recording.counts.no_reading, "row")));
  }
  if (recording.counts.out_of_order > 0) {
    said.push_back(fmt::format("{} more than {} s out of order in the file; sorted by time.",
                               count_of(recording.counts.out_of_order, "row"), kReorderWindow));
  }
  for (const ClockReset& reset : recording.counts.clock_resets) {
    said.push_back(fmt::format(
        "The clock of a log was {}: times from there on are taken to go on at {:.6g} s, "
        "in track.tum too; how long it was silent nobody knows.",
        words_of(reset), reset.t));
  }
  if (recording.ranging) {
    for (const auto& [reason, count] : recording.ranging->refused) {
      said.push_back(
          fmt::format("{} refused: {}.", count_of(count, "exchange"), reason_words(reason)));
    }
  }
  if (!replay.unknown_anchors.empty()) {
    said.push_back(fmt::format("{} from anchors that the anchors file does not have: {}.",
                               count_of(readings_in(replay.unknown_anchors), "reading"),
                               listed(replay.unknown_anchors)));
  }
  if (!replay.unknown_tags.empty()) {
    said.push_back(fmt::format("Tags that the tags file does not have, solved but not scored: {}.",
                               listed(replay.unknown_tags)));
  }
  for (const auto& [reason, count] : replay.refused_readings) {
    said.push_back(fmt::format("{} left out of {} epochs: {}.", count_of(count, "reading"),
                               count == 1 ? "its" : "their", reason_words(reason)));
  }
  if (replay.found_sigma) {
    said.push_back(fmt::format("No sigma was given: {:.3f} m for a difference, found from the log.",
                               *replay.found_sigma));
  }
  if (replay.excluded > 0) {
    const auto worst = std::ranges::max_element(replay.excluded_of_anchor, {},
                                                [](const auto& e) { return e.second; });
    said.push_back(fmt::format(
        "{} excluded as {}: contradicted by the others of the epoch. Anchor {} took part in {} of "
        "them, more than any other.",
        count_of(replay.excluded, "difference"), replay.excluded == 1 ? "an outlier" : "outliers",
        worst->first, worst->second));
  }
  if (replay.filtering) {
    const Filtering& f = *replay.filtering;
    for (const auto& [reason, count] : f.refused) {
      said.push_back(fmt::format("{} refused by the filter: {}.", count_of(count, "measurement"),
                                 reason_words(reason)));
    }
    constexpr double seldom = 1.5;  // [s]
    if (f.period > seldom) {
      said.push_back(fmt::format(
          "An epoch each {:.2g} s is too seldom for a filter to foretell what comes; without "
          "--filter each is solved by itself.",
          f.period));
    }
    if (f.reopened > 0) {
      said.push_back(fmt::format(
          "The filter was locked out by its own gate and began anew where measurements agreed, {}.",
          count_of(f.reopened, "time")));
    }
    if (f.apart_in_space) {
      said.push_back(fmt::format(
          "{} in space are followed one by one, as points: without an inertial unit the attitude "
          "that would join them is not known. With --height, on a floor, or --imu they are one "
          "body.",
          count_of(replay.of_tag.size(), "tag")));
    } else if (f.apart) {
      said.push_back(fmt::format(
          "{} are followed one by one, as points: no tags file tells where they sit on one body.",
          count_of(replay.of_tag.size(), "tag")));
    }
    if (!f.unused_unit.empty()) {
      said.push_back(fmt::format("The inertial unit was not used: {}.", f.unused_unit));
    }
    if (replay.body && replay.dim == 3) {
      const std::size_t without = replay.body->track.size() - f.inertial_epochs;
      if (2 * without > replay.body->track.size()) {
        said.push_back(fmt::format(
            "The inertial unit contradicts the radio: {} of {} poses come from a filter that "
            "leaves it out. Are its axes those of the body (x forward, y left, z up), its units "
            "rad/s and m/s², its clock the radio's?",
            without, replay.body->track.size()));
      }
      std::size_t guesses = 0;
      for (const SolvedPose& p : replay.body->track) guesses += p.heading_known ? 0 : 1;
      if (guesses > 0) {
        said.push_back(fmt::format(
            "{} without a known heading, which one tag shows only once the body has changed its "
            "velocity; not scored in heading.",
            count_of(guesses, "pose")));
      }
    }
  }
  for (const SubnetFrame& frame : recording.site.subnets.frames) {
    if (frame.fit_rms == 0) continue;
    said.push_back(fmt::format("Subnet {} fits its surveyed anchors to {:.3f} m rms.", frame.id,
                               frame.fit_rms));
  }
  if (replay.fused > 0) {
    said.push_back(fmt::format("{} heard by several subnets, whose positions were fused.",
                               count_of(replay.fused, "epoch")));
  }
  if (replay.inconsistent > 0) {
    said.push_back(
        fmt::format("{} solved although what was left still contradicts itself beyond noise.",
                    count_of(replay.inconsistent, "epoch")));
  }
  if (replay.duplicates > 0) {
    said.push_back(fmt::format("{} dropped: the same link and time as one before.",
                               count_of(replay.duplicates, "reading")));
  }
  const std::size_t without_bias =
      replay.without_bias + (replay.body ? replay.body->without_bias : 0);
  if (without_bias > 0) {
    said.push_back(
        fmt::format("{} of links that the bias file or network does not have, taken as unbiased.",
                    count_of(without_bias, "reading")));
  }
  std::ranges::move(pose_remarks(recording.site, replay), std::back_inserter(said));
  if (replay.chosen_by_prior > 0) {
    said.push_back(fmt::format("{} settled between two mirror images by the tag's last position.",
                               count_of(replay.chosen_by_prior, "epoch")));
  }
  if (replay.outside_truth > 0) {
    said.push_back(fmt::format("{} outside the time span of the truth, not scored.",
                               count_of(replay.outside_truth, "position")));
  }
  if (replay.in_truth_gaps > 0) {
    said.push_back(
        fmt::format("{} scored against truth interpolated over a pause of more than a second.",
                    count_of(replay.in_truth_gaps, "position")));
  }
  return said;
}

}  // namespace uwbpos::host
