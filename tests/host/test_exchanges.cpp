// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>
#include <exchanges.hpp>

#include <uwbpos/core/constants.hpp>

namespace tests::host_exchanges {

namespace {

using namespace uwbpos;
using namespace uwbpos::host;

constexpr double kRange = 12;            // [m]
constexpr double kReply = 1e-3;          // [s]
constexpr double kResponderRate = 5e-6;  // faster than the tag's clock

std::uint64_t ticks(double seconds) {
  return static_cast<std::uint64_t>(std::llround(seconds / kTickSeconds<double>));
}

std::uint64_t wrapped(std::uint64_t ticks, unsigned bits) {
  return ticks & ((std::uint64_t{1} << bits) - 1);
}

// Noiseless exchanges every 50 ms over 12 m; the tag's clock is true, the anchor's runs fast, both
// counters show `bits` bits and start near their end.
std::vector<Exchange> exchanges(unsigned bits, int count, bool three_messages = false) {
  const double flight = kRange / kSpeedOfLightAir<double>;
  const std::uint64_t tag_start = (std::uint64_t{1} << bits) - 1000;
  const std::uint64_t anchor_start = (std::uint64_t{1} << bits) - 90'000'000;
  const auto tag = [&](double t) { return wrapped(tag_start + ticks(t), bits); };
  const auto anchor = [&](double t) {
    return wrapped(anchor_start + ticks(t * (1 + kResponderRate)), bits);
  };
  std::vector<Exchange> log;
  for (int i = 0; i < count; ++i) {
    const double sent = 0.05 * i;
    const double answered = sent + flight + kReply;
    const double ended = answered + flight + 2 * kReply;
    Exchange e{};
    e.t = 1.7e9 + sent;
    e.anchor = 3;
    e.poll_tx = tag(sent);
    e.poll_rx = anchor(sent + flight);
    e.resp_tx = anchor(answered);
    e.resp_rx = tag(answered + flight);
    if (three_messages) e.final = {tag(ended), anchor(ended + flight)};
    e.true_range = kRange;
    log.push_back(e);
  }
  return log;
}

// Stamps are rounded to 4.7 mm of path; four of them and the rate's rounding stay below this.
constexpr double kRounding = 0.02;

TEST_CASE(
    "Two messages: the responder's rate is tracked, through wraps of every width of counter") {
  for (const unsigned bits : {30u, 32u, 36u, 40u}) {
    CAPTURE(bits);
    Settings settings;
    settings.counter_bits = bits;
    const Ranging result = ranges_from_exchanges(exchanges(bits, 40), settings, {});
    CHECK(result.refused == Counts{{"clock_not_yet_tracked", 1}});
    CHECK(result.single_sided_tracked == 39);
    REQUIRE(result.scored.size() == 39);
    for (const ScoredRange& range : result.scored) {
      CHECK(std::abs(range.range - kRange) < kRounding);
      // (000-11): the reply times half the rate of the responder.
      const double predicted = -kReply * kResponderRate / 2 * kSpeedOfLightAir<double>;
      CHECK(std::abs(*range.uncorrected - kRange - predicted) < kRounding);
    }
  }
}

TEST_CASE("Three messages need no clock, and a logged offset needs no tracking") {
  const Ranging three = ranges_from_exchanges(exchanges(32, 5, true), {}, {});
  CHECK(three.counter_bits == 32);
  CHECK(three.double_sided == 5);
  CHECK(three.refused.empty());
  for (const Reading& reading : three.readings) CHECK(std::abs(reading.range - kRange) < kRounding);

  auto log = exchanges(40, 5);
  for (Exchange& e : log) e.clock_offset = kResponderRate;
  const Ranging two = ranges_from_exchanges(log, {}, {});
  CHECK(two.counter_bits == 40);
  CHECK(two.single_sided_logged == 5);
  for (const Reading& reading : two.readings) CHECK(std::abs(reading.range - kRange) < kRounding);
}

TEST_CASE("Impossible exchanges are refused and counted by reason") {
  auto log = exchanges(40, 4);
  for (Exchange& e : log) e.clock_offset = kResponderRate;
  std::swap(log[0].poll_rx, log[0].resp_tx);                    // answered before asked
  log[1].resp_rx = wrapped(log[1].resp_rx + ticks(10e-6), 40);  // 1.5 km
  log[2].clock_offset = 1e-3;
  const Ranging result = ranges_from_exchanges(log, {}, {});
  CHECK(result.readings.size() == 1);
  CHECK(total(result.refused) == 3);
  CHECK(result.refused.contains("non_positive_interval"));
  CHECK(result.refused.contains("range_beyond_maximum"));
  CHECK(result.refused.contains("clock_offset_out_of_bounds"));
}

TEST_CASE("The bias at the received power is taken off") {
  auto log = exchanges(40, 1, true);
  log[0].power = -85;
  const PowerBiasTable points = {{-90, 1.0}, {-80, 2.0}};
  const auto table = RangeBias<double>::make(points);
  REQUIRE(table);
  const Ranging result = ranges_from_exchanges(log, {}, *table);
  REQUIRE(result.readings.size() == 1);
  CHECK(std::abs(result.readings[0].range - (kRange - 1.5)) < kRounding);
}

TEST_CASE("Scores of ranges: robust spread at one distance is free of what differs between them") {
  std::vector<ScoredRange> ranges;
  for (int place = 0; place < 2; ++place) {
    for (int i = -3; i <= 3; ++i) {
      const double truth = 10 + place;
      ranges.push_back({0, 0, 1, truth, truth + place + 0.01 * i, {}, truth + 1});
    }
  }
  const RangeScore score = score_ranges(ranges);
  CHECK(score.ours.count == 14);
  CHECK(score.ours.mean == doctest::Approx(0.5));
  CHECK(score.ours.outlier_share == doctest::Approx(0.5));
  CHECK(*score.spread_at_one_distance == doctest::Approx(1.4826 * 0.02));
  CHECK_FALSE(score.logged);
  CHECK(score.uncorrected->median == doctest::Approx(1));
}

}  // namespace

}  // namespace tests::host_exchanges
