// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/sim/noise.hpp>
#include <uwbpos/time/clock.hpp>

#include "../support/statistics.hpp"

namespace tests::time_rate_tracker {

namespace {

using namespace uwbpos;

constexpr long double kTicksPerSecond = 128 * 499.2e6L;

// Two clocks that stamp the same events, and a host that times them. Long double throughout.
struct Pair {
  long double rate_a = 12e-6L;
  long double rate_b = -9e-6L;
  long double offset_a = 3.7e11L;
  long double offset_b = 9.1e11L;
  double sigma = 0.15e-9;
  long double time = 0;
  // Of the host: its own rate, and how late at most it reads.
  long double host_rate = 50e-6L;
  double host_latency = 4e-3;

  [[nodiscard]] double delta() const {
    return static_cast<double>((rate_b - rate_a) / (1 + rate_a));
  }
};

struct Event {
  std::uint64_t a;
  std::uint64_t b;
  std::int64_t host;
};

// The event `period` seconds after the last one.
Event next(Pair& pair, double period, sim::Random& random) {
  const auto seconds = static_cast<long double>(period);
  pair.time += seconds;
  pair.offset_a += pair.rate_a * seconds * kTicksPerSecond;
  pair.offset_b += pair.rate_b * seconds * kTicksPerSecond;
  const auto stamp = [&](long double offset) {
    const auto noise = static_cast<long double>(random.normal(0, pair.sigma)) * kTicksPerSecond;
    return static_cast<std::uint64_t>(std::llround(pair.time * kTicksPerSecond + offset + noise));
  };
  const auto late = static_cast<long double>(random.uniform(0, pair.host_latency));
  const long double host = pair.time * (1 + pair.host_rate) + late;
  return {stamp(pair.offset_a), stamp(pair.offset_b), std::llround(1.7e15L + host * 1e6L)};
}

template <class S, unsigned Bits>
Result<Measured<S>> feed(RateTracker<S, Bits>& tracker, const Event& event) {
  return tracker.update(DeviceTime<Bits>{event.a}, DeviceTime<Bits>{event.b}, event.host);
}

template <class S, unsigned Bits>
Error refused(RateTracker<S, Bits>& tracker, const Event& event) {
  const auto rate = feed(tracker, event);
  REQUIRE_FALSE(rate);
  return rate.error();
}

template <class S>
constexpr double kRelative = 4 * static_cast<double>(std::numeric_limits<S>::epsilon());

template <class S, unsigned Bits>
void check_follows(double period, double worst) {
  sim::Random random{"follows a rate"};
  for (const long double rate_b : {-9e-6L, 20e-6L, 12.001e-6L, -40e-6L}) {
    Pair pair;
    pair.rate_b = rate_b;
    RateTracker<S, Bits> tracker;
    CHECK(refused(tracker, next(pair, 0.1, random)) == Error::NotYetTracked);
    for (int i = 0; i < 200; ++i) {
      const auto rate = feed(tracker, next(pair, period, random));
      REQUIRE(rate);
      CHECK(std::abs(static_cast<double>(rate->value) - pair.delta()) < worst);
    }
  }
}

// σt = 0.15 ns and a tick's rounding (4.5 ps) give √2·0.15 ns over the period, five of which
// are 1.1 ns over it.
TEST_CASE_TEMPLATE("A 32-bit counter that wraps every 67 ms is followed at any period", S, float,
                   double) {
  for (const double period : {0.005, 0.03, 0.0672, 0.1, 0.143, 0.5, 2.0, 30.0}) {
    check_follows<S, 32>(period, 1.2e-9 / period + 1e-11);
  }
}

TEST_CASE_TEMPLATE("A 40-bit counter is followed, also beyond its wrap", S, float, double) {
  for (const double period : {0.01, 0.1, 1.0, 8.6, 17.2, 100.0}) {
    check_follows<S, 40>(period, 1.2e-9 / period + 1e-11);
  }
}

TEST_CASE("Float and double give the same rate") {
  sim::Random random{"float and double"};
  Pair pair;
  RateTracker<float, 32> single;
  RateTracker<double, 32> precise;
  for (int i = 0; i < 2000; ++i) {
    const Event event = next(pair, random.uniform(0.02, 1.5), random);
    const auto a = feed(single, event);
    const auto b = feed(precise, event);
    REQUIRE(a.has_value() == b.has_value());
    if (!a) continue;
    CHECK(static_cast<double>(a->value) == doctest::Approx(b->value).epsilon(kRelative<float>));
    CHECK(static_cast<double>(a->variance) == doctest::Approx(b->variance).epsilon(1e-4));
  }
}

TEST_CASE_TEMPLATE("The variance bounds the error, and not by a mile", S, float, double) {
  sim::Random random{"honest variance"};
  std::vector<double> normalised;
  for (int run = 0; run < 400; ++run) {
    Pair pair;
    pair.rate_a = static_cast<long double>(random.uniform(-20e-6, 20e-6));
    pair.rate_b = static_cast<long double>(random.uniform(-20e-6, 20e-6));
    RateTracker<S, 32> tracker;
    const double period = 0.1;
    for (int i = 0; i < 60; ++i) {
      // The wander that the options state.
      pair.rate_b += static_cast<long double>(random.normal(0, 5e-9) * std::sqrt(period));
      const auto rate = feed(tracker, next(pair, period, random));
      if (!rate || i < 20) continue;
      normalised.push_back((static_cast<double>(rate->value) - pair.delta()) /
                           std::sqrt(static_cast<double>(rate->variance)));
    }
  }
  const double square = std::pow(test::root_mean_square(normalised), 2);
  // Below 1: successive measurements share a stamp, the filter takes them as independent.
  // 400 runs of a few independent values each: a sampling error of about 4 %.
  CHECK(square < 1.1);
  CHECK(square > 0.4);
  CHECK(std::abs(test::mean(normalised)) < 0.1);
}

TEST_CASE_TEMPLATE("Smoothing beats the last two exchanges", S, float, double) {
  sim::Random random{"smoothing"};
  Pair pair;
  RateTrackerOptions<S> options;
  options.wander = S(0.1e-9);
  RateTracker<S, 32> tracker{options};
  std::vector<double> errors;
  for (int i = 0; i < 4000; ++i) {
    const auto rate = feed(tracker, next(pair, 0.1, random));
    if (rate && i > 500) errors.push_back(static_cast<double>(rate->value) - pair.delta());
  }
  // Two stamps over 0.1 s: 2.1 ppb. A gain of 0.015 leaves a tenth of it, and less.
  CHECK(test::root_mean_square(errors) < 0.3e-9);
}

TEST_CASE_TEMPLATE("Lost frames and gaps up to minutes cost nothing", S, float, double) {
  sim::Random random{"gaps"};
  Pair pair;
  RateTracker<S, 32> tracker;
  CHECK(refused(tracker, next(pair, 0.1, random)) == Error::NotYetTracked);
  for (const double gap : {0.143, 0.143, 0.286, 1.43, 0.143, 60.0, 0.143, 299.0, 0.143}) {
    const auto rate = feed(tracker, next(pair, gap, random));
    REQUIRE(rate);
    CHECK(static_cast<double>(rate->value) == doctest::Approx(pair.delta()).epsilon(1e-3));
  }
}

TEST_CASE_TEMPLATE("A gap too long starts afresh and says so", S, float, double) {
  sim::Random random{"long gaps"};
  Pair pair;
  RateTracker<S, 32> tracker;
  CHECK(refused(tracker, next(pair, 0.1, random)) == Error::NotYetTracked);
  REQUIRE(feed(tracker, next(pair, 0.1, random)));
  CHECK(refused(tracker, next(pair, 301, random)) == Error::GapTooLong);
  CHECK(tracker.rate().error() == Error::NotYetTracked);
  REQUIRE(feed(tracker, next(pair, 0.1, random)));
  // 80 ppm of 420 s are half of 67.2 ms, whatever max_gap says.
  RateTrackerOptions<S> options;
  options.max_gap = 3'600'000'000;
  RateTracker<S, 32> patient{options};
  CHECK(refused(patient, next(pair, 0.1, random)) == Error::NotYetTracked);
  REQUIRE(feed(patient, next(pair, 415, random)));
  CHECK(refused(patient, next(pair, 425, random)) == Error::GapTooLong);
  const auto rate = feed(patient, next(pair, 0.1, random));
  REQUIRE(rate);
  CHECK(static_cast<double>(rate->value) == doctest::Approx(pair.delta()).epsilon(1e-3));
}

TEST_CASE_TEMPLATE("A restarted device is told, once, and the rate survives it", S, float, double) {
  sim::Random random{"restarts"};
  for (const bool of_a : {true, false}) {
    Pair pair;
    RateTracker<S, 32> tracker;
    for (int i = 0; i < 20; ++i) static_cast<void>(feed(tracker, next(pair, 0.1, random)));
    const auto before = tracker.rate();
    REQUIRE(before);
    (of_a ? pair.offset_a : pair.offset_b) += 1'234'567'890;
    CHECK(refused(tracker, next(pair, 0.1, random)) == Error::ClockJump);
    const auto kept = tracker.rate();
    REQUIRE(kept);
    CHECK(kept->value == before->value);
    CHECK(kept->variance > before->variance);
    const auto after = feed(tracker, next(pair, 0.1, random));
    REQUIRE(after);
    CHECK(static_cast<double>(after->value) == doctest::Approx(pair.delta()).epsilon(1e-3));
  }
}

TEST_CASE_TEMPLATE("Restarts with good stamps between them never cost the rate", S, float, double) {
  sim::Random random{"restarts apart"};
  Pair pair;
  RateTracker<S, 32> tracker;
  for (int i = 0; i < 20; ++i) static_cast<void>(feed(tracker, next(pair, 0.1, random)));
  for (int i = 0; i < 5; ++i) {
    pair.offset_b += 1'111'111'111;
    CHECK(refused(tracker, next(pair, 0.1, random)) == Error::ClockJump);
    CHECK(tracker.rate().has_value());
    CHECK(feed(tracker, next(pair, 0.1, random)).has_value());
  }
}

TEST_CASE_TEMPLATE("Another device under the same name does not lock the tracker out", S, float,
                   double) {
  sim::Random random{"another device"};
  Pair pair;
  RateTracker<S, 32> tracker;
  for (int i = 0; i < 50; ++i) static_cast<void>(feed(tracker, next(pair, 0.1, random)));
  pair.rate_b = 25e-6L;
  pair.offset_b += 999'999'999;
  CHECK(refused(tracker, next(pair, 0.1, random)) == Error::ClockJump);
  CHECK(refused(tracker, next(pair, 0.1, random)) == Error::ClockJump);
  CHECK(tracker.rate().error() == Error::NotYetTracked);
  const auto rate = feed(tracker, next(pair, 0.1, random));
  REQUIRE(rate);
  CHECK(static_cast<double>(rate->value) == doctest::Approx(pair.delta()).epsilon(1e-3));
}

TEST_CASE_TEMPLATE("A rate that drifts within what crystals do is followed", S, float, double) {
  sim::Random random{"warming up"};
  Pair pair;
  RateTracker<S, 32> tracker;
  static_cast<void>(feed(tracker, next(pair, 0.1, random)));
  for (int i = 0; i < 3000; ++i) {
    pair.rate_b += 0.5e-9L;  // 5 ppb a second
    const auto rate = feed(tracker, next(pair, 0.1, random));
    REQUIRE(rate);
    CHECK(std::abs(static_cast<double>(rate->value) - pair.delta()) < 20e-9);
  }
}

TEST_CASE_TEMPLATE("Clocks further apart than the bound are refused", S, float, double) {
  sim::Random random{"out of bounds"};
  Pair pair;
  pair.rate_b = 100e-6L;
  RateTracker<S, 32> tracker;
  CHECK(refused(tracker, next(pair, 0.1, random)) == Error::NotYetTracked);
  for (int i = 0; i < 5; ++i) {
    CHECK(refused(tracker, next(pair, 0.1, random)) == Error::ClockOffsetOutOfBounds);
  }
  pair.rate_b = 10e-6L;
  CHECK(feed(tracker, next(pair, 0.1, random)).has_value());
}

TEST_CASE_TEMPLATE("Late and repeated frames are ignored; a host set back starts afresh", S, float,
                   double) {
  sim::Random random{"host time"};
  Pair pair;
  RateTracker<S, 32> tracker;
  static_cast<void>(feed(tracker, next(pair, 0.1, random)));
  const Event first = next(pair, 0.1, random);
  REQUIRE(feed(tracker, first));
  Event last = next(pair, 0.1, random);
  REQUIRE(feed(tracker, last));
  const auto known = tracker.rate().value();
  CHECK(refused(tracker, last) == Error::TimeNotIncreasing);
  CHECK(refused(tracker, first) == Error::TimeNotIncreasing);
  CHECK(tracker.rate().value().value == known.value);
  CHECK(feed(tracker, next(pair, 0.1, random)).has_value());
  Event back = next(pair, 0.1, random);
  back.host -= 3'600'000'000;
  CHECK(refused(tracker, back) == Error::TimeNotIncreasing);
  CHECK(tracker.rate().error() == Error::NotYetTracked);
  Event after = next(pair, 0.1, random);
  after.host -= 3'600'000'000;
  CHECK(feed(tracker, after).has_value());
}

TEST_CASE_TEMPLATE("The ends of host time are times like others", S, float, double) {
  constexpr auto low = std::numeric_limits<std::int64_t>::min();
  constexpr auto high = std::numeric_limits<std::int64_t>::max();
  RateTracker<S, 32> tracker;
  const DeviceTime<32> zero{0};
  CHECK(tracker.update(zero, zero, low).error() == Error::NotYetTracked);
  CHECK(tracker.update(zero, zero, high).error() == Error::GapTooLong);
  CHECK(tracker.update(zero, zero, low).error() == Error::TimeNotIncreasing);
  const DeviceTime<32> later{1000};
  CHECK(tracker.update(later, later, low + 100'000).has_value());
}

TEST_CASE_TEMPLATE("An exchange that is logged twice is a repeat, not a wrap to the tick", S, float,
                   double) {
  sim::Random random{"logged twice"};
  Pair pair;
  RateTracker<S, 40> tracker;
  for (int i = 0; i < 50; ++i) {
    Event event = next(pair, 0.1, random);
    const auto result = feed(tracker, event);
    CHECK(result.has_value() == (i > 0));
    event.host += 2500;
    CHECK(refused(tracker, event) == Error::TimeNotIncreasing);
  }
  // Fifty events of 0.15 ns, 0.1 s apart: a few ppb.
  CHECK(std::abs(static_cast<double>(tracker.rate().value().value) - pair.delta()) < 1e-8);
}

TEST_CASE_TEMPLATE("NaN and options outside their domain pass no gate", S, float, double) {
  constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  constexpr S infinity = std::numeric_limits<S>::infinity();
  using Options = RateTrackerOptions<S>;
  const auto refuses = [](const Options& options) {
    RateTracker<S, 32> tracker{options};
    CHECK(tracker.update(DeviceTime<32>{0}, DeviceTime<32>{0}, 0).error() == Error::InvalidOption);
    CHECK(tracker.update(DeviceTime<32>{0}, DeviceTime<32>{0}, 100'000).error() ==
          Error::InvalidOption);
  };
  for (S Options::* const member : {&Options::sigma_timestamp, &Options::max_clock_offset,
                                    &Options::wander, &Options::max_rate_step}) {
    for (const S bad : {nan, infinity, -infinity, S(-1e-9), S(1)}) {
      Options options;
      options.*member = bad;
      refuses(options);
    }
  }
  for (std::int64_t Options::* const member :
       {&Options::max_gap, &Options::host_jitter, &Options::reorder_window}) {
    Options options;
    options.*member = -1;
    refuses(options);
  }
  Options options;
  options.max_gap = 3'600'000'000'001;
  refuses(options);
  options = {};
  options.host_jitter = options.max_gap + 1;
  refuses(options);
  options = {};
  options.sigma_timestamp = 0;
  refuses(options);
}

TEST_CASE_TEMPLATE("After a reset nothing of the past is left", S, float, double) {
  sim::Random random{"reset"};
  RateTrackerOptions<S> options;
  options.wander = S(2e-9);
  RateTracker<S, 32> used{options};
  Pair old;
  old.rate_b = 35e-6L;
  for (int i = 0; i < 30; ++i) static_cast<void>(feed(used, next(old, 0.1, random)));
  old.offset_a += 5e8L;  // and in the middle of a jump
  CHECK(refused(used, next(old, 0.1, random)) == Error::ClockJump);
  used.reset();
  CHECK(used.rate().error() == Error::NotYetTracked);
  RateTracker<S, 32> fresh{options};
  Pair pair;
  for (int i = 0; i < 30; ++i) {
    const Event event = next(pair, 0.1, random);
    const auto a = feed(used, event);
    const auto b = feed(fresh, event);
    REQUIRE(a.has_value() == b.has_value());
    if (!a) {
      CHECK(a.error() == b.error());
      continue;
    }
    CHECK(a->value == b->value);
    CHECK(a->variance == b->variance);
  }
}

// A radio that ranges every 98.87 ms writes to a queue; the host drains it every 142.86 ms, so its
// intervals are 44 ms too long, which is nearer to the next wrap (166.1 ms) than to the truth.
TEST_CASE_TEMPLATE("A host that reads a queue: the variance admits it, a gap settles it", S, float,
                   double) {
  sim::Random random{"queue"};
  Pair pair;
  pair.host_latency = 0;
  std::int64_t host = 0;
  RateTracker<S, 32> tracker;
  const auto row = [&](double seconds, std::int64_t host_step) {
    Event event = next(pair, seconds, random);
    event.host = host += host_step;
    return feed(tracker, event);
  };
  CHECK(row(0.1, 1).error() == Error::NotYetTracked);
  for (int i = 0; i < 25; ++i) {
    const auto rate = row(0.09887, 142'860);
    REQUIRE(rate);
    const double error = static_cast<double>(rate->value) - pair.delta();
    CHECK(std::abs(error) > 5e-6);  // 21 ppm come out as 12.5
    CHECK(std::abs(error) < 2 * std::sqrt(static_cast<double>(rate->variance)));
  }
  // A minute of silence: the host is off by the second that the queue held.
  const auto settled = row(60, 58'900'000);
  REQUIRE(settled);
  CHECK(static_cast<double>(settled->value) == doctest::Approx(pair.delta()).epsilon(0.03));
  for (int i = 0; i < 25; ++i) {
    const auto rate = row(0.09887, 142'860);
    REQUIRE(rate);
    CHECK(static_cast<double>(rate->value) == doctest::Approx(pair.delta()).epsilon(0.001));
    CHECK(std::sqrt(static_cast<double>(rate->variance)) < 10e-9);
  }
}

TEST_CASE("A slip of the host's that no gap preceded does not fool a rate that is known") {
  sim::Random random{"host slip"};
  Pair pair;
  RateTracker<double, 32> tracker;
  for (int i = 0; i < 20; ++i) static_cast<void>(feed(tracker, next(pair, 0.143, random)));
  Event late = next(pair, 0.143, random);
  late.host += 50'000;  // 50 ms late: nearer to one wrap more
  const auto rate = feed(tracker, late);
  REQUIRE(rate);
  CHECK(rate->value == doctest::Approx(pair.delta()).epsilon(1e-3));
  const auto after = feed(tracker, next(pair, 0.143, random));
  REQUIRE(after);
  CHECK(after->value == doctest::Approx(pair.delta()).epsilon(1e-3));
}

}  // namespace

}  // namespace tests::time_rate_tracker
