// SPDX-License-Identifier: MIT
// Single-sided exchanges of two DWM1001 at surveyed distances (Hanyang University, Scientific Data
// 2025): raw 32-bit stamps, from which the responder's rate is tracked, causally.
//
// What the recordings are, as far as stamps tell. The radio ranged every 98.87 ms, but the host
// logged a row every 142.86 ms from a queue that overflowed every four seconds: between rows host
// time is 44 ms too long, nearer to the next wrap of the counter (166.1 ms) than to the truth. That
// 98.87 ms is the truth shows where frames were lost and the queue ran dry (rows 194.9 ms apart on
// both clocks), at the overflows (fifteen periods of phase at once), and between the distances,
// where the phase runs on for minutes: the rates agree with it to 3 %, with 166.1 ms they would be
// 40 % off.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/ranging/ss_twr.hpp>
#include <uwbpos/time/clock.hpp>

#include "../support/data.hpp"
#include "../support/statistics.hpp"

namespace tests::ranging_hanyang {

namespace {

using namespace uwbpos;

struct Row {
  double time;
  DeviceTime<32> poll_tx, poll_rx, resp_tx, resp_rx;
  double distance;
  double logged;

  [[nodiscard]] std::int64_t host() const { return std::llround(time * 1e6); }

  // Intervals survive in 32 bits; the exchange is set down anywhere in the 40-bit counter.
  [[nodiscard]] SsTwrStamps exchange() const {
    const DeviceTime<> start{0};
    return {start, start, start + (resp_tx - poll_rx), start + (resp_rx - poll_tx)};
  }
};

// Rows in order of time: the recordings at the several distances are not.
std::vector<Row> read(const std::filesystem::path& file) {
  std::ifstream in{file};
  std::string line;
  std::getline(in, line);
  std::map<std::string, std::size_t> columns;
  std::stringstream header{line};
  for (std::string name; std::getline(header, name, ',');) columns.emplace(name, columns.size());
  std::vector<Row> rows;
  while (std::getline(in, line)) {
    std::vector<std::string> cells;
    std::stringstream stream{line};
    for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
    const auto real = [&](const char* name) { return std::stod(cells.at(columns.at(name))); };
    const auto ticks = [&](const char* name) {
      return DeviceTime<32>{std::stoull(cells.at(columns.at(name)))};
    };
    rows.push_back({real("t_s"), ticks("poll_tx"), ticks("poll_rx"), ticks("resp_tx"),
                    ticks("resp_rx"), real("true_range_m"), real("logged_range_m")});
  }
  std::sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) { return a.time < b.time; });
  return rows;
}

struct Answer {
  Row row;
  double rate;
  double rate_sigma;
  double error;
  double correction;  // of the uncorrected range
};

struct Run {
  std::vector<Answer> answers;
  std::map<std::string, int> refused;
};

template <class S>
Run track(const std::vector<Row>& rows) {
  Run run;
  RateTracker<S, 32> tracker;
  TwrOptions<S> unknown;
  unknown.sigma_clock_offset = S(10e-6);
  for (const Row& row : rows) {
    const auto rate = tracker.update(row.poll_tx, row.poll_rx, row.host());
    if (!rate) {
      ++run.refused[std::string{describe(rate.error())}];
      continue;
    }
    TwrOptions<S> options;
    options.clock_offset = rate->value;
    options.sigma_clock_offset = std::sqrt(rate->variance);
    const auto range = ss_twr_range<S>(row.exchange(), options);
    if (!range) {
      ++run.refused[std::string{describe(range.error())}];
      continue;
    }
    const auto uncorrected = ss_twr_range<S>(row.exchange(), unknown);
    REQUIRE(uncorrected);
    run.answers.push_back(
        {row, static_cast<double>(rate->value), std::sqrt(static_cast<double>(rate->variance)),
         static_cast<double>(range->value) - row.distance,
         static_cast<double>(range->value) - static_cast<double>(uncorrected->value)});
  }
  return run;
}

std::vector<double> column(const std::vector<Answer>& answers, double (*value)(const Answer&)) {
  std::vector<double> values;
  for (const Answer& answer : answers) values.push_back(value(answer));
  return values;
}

double own_error(const Answer& a) { return a.error; }
double logged_error(const Answer& a) { return a.row.logged - a.row.distance; }
double raw_error(const Answer& a) { return a.error - a.correction; }

// Answers at one surveyed distance. A distance is measured again elsewhere with another decimal.
std::map<double, std::vector<Answer>> by_distance(const std::vector<Answer>& answers) {
  std::map<double, std::vector<Answer>> groups;
  for (const Answer& answer : answers) groups[answer.row.distance].push_back(answer);
  return groups;
}

double mean_spread(const std::vector<Answer>& answers, double (*error)(const Answer&)) {
  std::vector<double> spreads;
  for (const auto& [distance, group] : by_distance(answers)) {
    spreads.push_back(test::robust_deviation(column(group, error)));
  }
  return test::mean(spreads);
}

struct Recording {
  std::string file;
  double raw_mean;         // of the uncorrected ranges, known of the recording
  double logged_mean;      // of the module's own
  double required_median;  // the module's, as the requirement puts it
  double pooled_spread;    // regression guard, see below
};

// Pooled over all distances the spread is NOT better than the module's 0.087 and 0.090 m, but 0.121
// and 0.096 m. What is pooled there is not noise: with the clocks' part gone, errors grow from
// -0.1 m at 2 m to +0.3 m at 50 m as power falls, and the two passes of a recording lie 0.1 m
// apart. The module's correction, 0.8 of this one, happens to bring the passes closer together. The
// wrong wrap (166.1 ms), 0.6 of it, would bring the pooled spread to 0.087 and 0.076 m, and the
// medians to 0.25 and 0.29 m. The last number only keeps the pooled spread from growing unnoticed.
const Recording kRecordings[] = {{"static_los.csv", 0.334, 0.199, 0.20, 0.125},
                                 {"static_nlos.csv", 0.340, 0.261, 0.26, 0.105}};

TEST_CASE_TEMPLATE("Recorded exchanges: median, and spread at a distance, beat the module's own", S,
                   float, double) {
  const auto folder =
      test::data_or_skip("hanyang", "single-sided ranges with the tracked rate, on recordings");
  if (!folder) return;
  for (const Recording& recording : kRecordings) {
    CAPTURE(recording.file);
    const std::vector<Row> rows = read(*folder / recording.file);
    REQUIRE(rows.size() > 2000);
    const Run run = track<S>(rows);

    // The first row, two or three silences over five minutes, and two or three overflows of the
    // queue per distance, told as jumps.
    int refused = 0;
    for (const auto& [reason, count] : run.refused) refused += count;
    CHECK(static_cast<std::size_t>(refused) + run.answers.size() == rows.size());
    CHECK(run.answers.size() > 0.97 * static_cast<double>(rows.size()));
    CHECK(run.refused.at(std::string{describe(Error::NotYetTracked)}) == 1);
    CHECK(run.refused.at(std::string{describe(Error::ClockJump)}) <= 60);

    const auto own = column(run.answers, own_error);
    const auto logged = column(run.answers, logged_error);
    const auto raw = column(run.answers, raw_error);
    CHECK(test::mean(raw) == doctest::Approx(recording.raw_mean).epsilon(0.01));
    CHECK(test::mean(logged) == doctest::Approx(recording.logged_mean).epsilon(0.01));
    CHECK(std::abs(test::median(own)) <= test::median(logged));
    CHECK(std::abs(test::median(own)) <= recording.required_median);
    CHECK(test::mean(own) <= test::mean(logged));
    CHECK(mean_spread(run.answers, own_error) <= mean_spread(run.answers, logged_error));
    CHECK(test::robust_deviation(own) < recording.pooled_spread);
    const auto far =
        std::count_if(own.begin(), own.end(), [](double e) { return std::abs(e) > 0.6; });
    CHECK(far < 0.01 * static_cast<double>(rows.size()));

    std::ostringstream reasons;
    for (const auto& [reason, count] : run.refused)
      reasons << "; refused " << count << ": " << reason;
    MESSAGE(recording.file << ": " << run.answers.size() << " of " << rows.size()
                           << " answered, median " << test::median(own) << " m (module "
                           << test::median(logged) << "), spread at one distance "
                           << mean_spread(run.answers, own_error) << " m (module "
                           << mean_spread(run.answers, logged_error) << "), over all distances "
                           << test::robust_deviation(own) << " m (module "
                           << test::robust_deviation(logged) << "), beyond 0.6 m: " << far
                           << reasons.str());
  }
}

TEST_CASE("Recorded exchanges: the tracked rate is the one that minutes of silence show") {
  const auto folder = test::data_or_skip("hanyang", "the tracked rate against silences");
  if (!folder) return;
  for (const Recording& recording : kRecordings) {
    CAPTURE(recording.file);
    const auto rows = read(*folder / recording.file);
    const Run run = track<double>(rows);
    int silences = 0;
    for (std::size_t i = 1; i < rows.size(); ++i) {
      const double gap = rows[i].time - rows[i - 1].time;
      if (gap < 40 || gap > 200) continue;
      // Phase over a silence by host time alone: the queue's 1.3 s are 3 % of 40 s.
      const auto phase = DeviceTime<32>{rows[i].poll_rx.ticks() - rows[i - 1].poll_rx.ticks()} -
                         DeviceTime<32>{rows[i].poll_tx.ticks() - rows[i - 1].poll_tx.ticks()};
      const double rate = static_cast<double>(phase) * kTickSeconds<double> / gap;
      // The rate tracked in the five seconds after it; crystals drift by 0.1 ppm in minutes.
      std::vector<double> tracked;
      for (const Answer& answer : run.answers) {
        const double after = answer.row.time - rows[i].time;
        if (after > 0 && after < 5) tracked.push_back(answer.rate);
      }
      REQUIRE(tracked.size() > 10);
      CHECK(std::abs(test::median(tracked) - rate) < 0.05e-6 + 0.05 * std::abs(rate));
      ++silences;
    }
    CHECK(silences >= 20);
  }
}

TEST_CASE("Recorded exchanges: the uncorrected error follows (000-11) with the tracked rate") {
  const auto folder = test::data_or_skip("hanyang", "(000-11) on recordings");
  if (!folder) return;
  // Per distance: the correction by the tracked rate, and the module's own, which measures the
  // carrier's offset in each exchange and knows nothing of the one before.
  std::vector<double> own;
  std::vector<double> module;
  for (const Recording& recording : kRecordings) {
    const Run run = track<double>(read(*folder / recording.file));
    for (const Answer& a : run.answers) {
      // (000-11) itself, with eA = 0: a reply of 1.128 ms, δ from the tracker.
      const double reply =
          static_cast<double>(a.row.resp_tx - a.row.poll_rx) * kTickSeconds<double>;
      const double predicted = ss_twr_error(0.0, reply, 0.0, a.rate) * kSpeedOfLightAir<double>;
      CHECK(std::abs(predicted + a.correction) < 1e-6);
    }
    for (const auto& [distance, group] : by_distance(run.answers)) {
      if (group.front().rate_sigma > 0.05e-6) continue;  // before the first silence
      own.push_back(test::median(column(group, [](const Answer& a) { return a.correction; })));
      module.push_back(test::median(
          column(group, [](const Answer& a) { return logged_error(a) - raw_error(a); })));
    }
  }
  REQUIRE(own.size() > 45);
  double covariance = 0;
  const double own_mean = test::mean(own);
  const double module_mean = test::mean(module);
  for (std::size_t i = 0; i < own.size(); ++i) {
    covariance +=
        (own[i] - own_mean) * (module[i] - module_mean) / static_cast<double>(own.size() - 1);
  }
  const double correlation =
      covariance / (test::standard_deviation(own) * test::standard_deviation(module));
  const double slope = covariance / test::variance(own);
  MESSAGE("module's correction against (000-11): slope " << slope << ", correlation " << correlation
                                                         << ", offset "
                                                         << module_mean - slope * own_mean << " m");
  // They agree in sign and shape; the module's is 0.8 of it (of the rate over whole periods: with
  // the wrap that host time suggests it would be 1.35).
  CHECK(correlation > 0.97);
  CHECK(slope > 0.7);
  CHECK(slope < 1.1);
}

}  // namespace

}  // namespace tests::ranging_hanyang
