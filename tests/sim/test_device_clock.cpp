// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/core/constants.hpp>
#include <uwbpos/sim/device_clock.hpp>

#include "../support/statistics.hpp"

namespace tests::sim_device_clock {

namespace {

using namespace uwbpos::sim;
using uwbpos::DeviceTime;

// Picoseconds in a tick.
constexpr double kTickPicoseconds = uwbpos::kTickSeconds<double> * 1e12;

DeviceClock random_clock(Random& random) {
  DeviceClock clock;
  clock.rate = random.uniform(-100e-6, 100e-6);
  clock.reading = {static_cast<std::int64_t>(random.bits() >> 24), random.uniform()};
  clock.at = {random.integer(0, 100000000), random.uniform()};
  return clock;
}

TEST_CASE("The counter's frequency is a whole number of hertz") {
  CHECK(static_cast<double>(kTicksPerSecond) == 128 * 499.2e6);
  CHECK(static_cast<double>(kTicksPerSecond) * uwbpos::kTickSeconds<double> == 1);
}

TEST_CASE("A clock reads offset plus (1 + rate) times the time passed") {
  Random random{"clock reading"};
  for (int i = 0; i < 5000; ++i) {
    const DeviceClock clock = random_clock(random);
    const std::int64_t seconds = random.integer(-10, 3600);
    const double fraction = random.uniform();
    const Instant instant{clock.at.seconds + seconds, fraction};
    const Reading reading = read(clock, instant);
    // Equation (1) with the whole ticks set apart, in 64 bits of significand.
    using Exact = long double;
    const Exact part = static_cast<Exact>(fraction) - static_cast<Exact>(clock.at.fraction);
    const Exact passed = static_cast<Exact>(seconds) + part;
    const Exact beyond =
        static_cast<Exact>(clock.reading.fraction) +
        (part + static_cast<Exact>(clock.rate) * passed) * static_cast<Exact>(kTicksPerSecond);
    const std::int64_t whole = clock.reading.ticks + seconds * kTicksPerSecond;
    const Exact error =
        static_cast<Exact>(reading.ticks - whole) + static_cast<Exact>(reading.fraction) - beyond;
    CHECK(std::abs(static_cast<double>(error)) * kTickPicoseconds < 0.001);
    CHECK(reading.fraction >= 0);
    CHECK(reading.fraction < 1);
  }
}

TEST_CASE("A count is found again at the instant when the clock shows it") {
  Random random{"clock inverse"};
  for (int i = 0; i < 5000; ++i) {
    const DeviceClock clock = random_clock(random);
    const std::int64_t ticks =
        clock.reading.ticks + static_cast<std::int64_t>(random.uniform(-0.1, 10) * 6.3e10);
    const Reading shown = read(clock, when(clock, ticks));
    const double error = static_cast<double>(shown.ticks - ticks) + shown.fraction;
    CHECK(std::abs(error) * kTickPicoseconds < 0.003);
  }
}

TEST_CASE("The counter wraps at 40 bits, every 17.2 seconds") {
  DeviceClock clock;
  clock.reading.ticks = (std::int64_t{1} << 40) - 10;
  const auto before = counter(stamp(clock, clock.at, 0));
  const auto after = counter(stamp(clock, clock.at + 1e-9, 0));
  CHECK(before.ticks() == (std::uint64_t{1} << 40) - 10);
  CHECK(after.ticks() == 54);  // 63.9 ticks later, rounded
  CHECK(after - before == 64);

  const double period = static_cast<double>(std::int64_t{1} << 40) * uwbpos::kTickSeconds<double>;
  CHECK(period == doctest::Approx(17.2074).epsilon(1e-5));
  const auto one_lap_later = counter(stamp(clock, clock.at + period, 0));
  // The period is not representable: 4e-15 s of rounding, far below half a tick.
  CHECK(one_lap_later == before);

  // A clock that was set back counts below zero, and the counter shows that modulo 2^40.
  CHECK(counter(-1).ticks() == (std::uint64_t{1} << 40) - 1);
}

TEST_CASE("Advancing a clock in small steps is advancing it at once") {
  Random random{"advance"};
  for (int i = 0; i < 50; ++i) {
    const DeviceClock start = random_clock(random);
    DeviceClock stepped = start;
    Instant instant = start.at;
    for (int step = 0; step < 500; ++step) {
      instant = instant + random.exponential(0.01);
      stepped = advance(stepped, instant, random);
    }
    CHECK(stepped.rate == start.rate);
    CHECK(stepped.at == instant);
    const Reading direct = read(start, instant);
    const double error = static_cast<double>(stepped.reading.ticks - direct.ticks) +
                         (stepped.reading.fraction - direct.fraction);
    // Each step rounds some 1e-8 s of ticks and fractions below one: 500 · 1e-7 ticks at most.
    CHECK(std::abs(error) < 1e-4);
  }
}

TEST_CASE("A clock does not go back, and draws nothing when asked to") {
  Random random{"backwards"};
  Random untouched = random;
  DeviceClock clock;
  clock.rate_walk = 1e-9;
  clock.at = {100, 0.5};
  const DeviceClock same = advance(clock, clock.at, random);
  const DeviceClock earlier = advance(clock, {99, 0.5}, random);
  CHECK(same.at == clock.at);
  CHECK(earlier.at == clock.at);
  CHECK(earlier.reading.ticks == clock.reading.ticks);
  CHECK(random.bits() == untouched.bits());
}

TEST_CASE("The rate walks as a Wiener process whatever the steps") {
  Random random{"rate walk"};
  constexpr int kRuns = 4000;
  constexpr double kWalk = 1e-8;
  constexpr double kSeconds = 30;
  for (const int steps : {1, 7, 60}) {
    CAPTURE(steps);
    std::vector<double> rates;
    std::vector<double> phases;
    double product = 0;
    for (int run = 0; run < kRuns; ++run) {
      DeviceClock clock;
      clock.rate_walk = kWalk;
      for (int step = 1; step <= steps; ++step) {
        clock = advance(clock, Instant{} + kSeconds * step / steps, random);
      }
      const double phase = (static_cast<double>(clock.reading.ticks - 30 * kTicksPerSecond) +
                            clock.reading.fraction) *
                           uwbpos::kTickSeconds<double>;
      rates.push_back(clock.rate);
      phases.push_back(phase);
      product += clock.rate * phase / kRuns;
    }
    const auto interval = uwbpos::test::variance_ratio_interval(kRuns, 0.999);
    const double q2 = kWalk * kWalk;
    CHECK(interval.contains(uwbpos::test::variance(rates) / (q2 * kSeconds)));
    CHECK(interval.contains(uwbpos::test::variance(phases) / (q2 * std::pow(kSeconds, 3) / 3)));
    // cov(rate, phase) = q²T²/2; the relative standard error of the estimate is
    // √((1 + 1/ρ²)/n) with ρ² = 3/4.
    const double expected = q2 * kSeconds * kSeconds / 2;
    CHECK(std::abs(product / expected - 1) < 4 * std::sqrt((1 + 4.0 / 3) / kRuns));
  }
}

TEST_CASE("Stamps are rounded to the nearest tick and scatter with the noise asked for") {
  Random random{"stamp noise"};
  constexpr int kCount = 40000;
  constexpr double kSigma = 0.15e-9;
  DeviceClock clock = random_clock(random);
  std::vector<double> rounding;
  std::vector<double> noisy;
  for (int i = 0; i < kCount; ++i) {
    const Instant instant = clock.at + random.uniform(0, 10);
    const Reading truth = read(clock, instant);
    const auto error = [&](double noise) {
      return static_cast<double>(stamp(clock, instant, noise) - truth.ticks) - truth.fraction;
    };
    rounding.push_back(error(0));
    REQUIRE(std::abs(rounding.back()) <= 0.5);
    noisy.push_back(error(kSigma * random.normal()));
  }
  const double sigma = std::sqrt(std::pow(kSigma / uwbpos::kTickSeconds<double>, 2) + 1.0 / 12);
  CHECK(uwbpos::test::mean_interval(0, std::sqrt(1.0 / 12), kCount, 0.999)
            .contains(uwbpos::test::mean(rounding)));
  CHECK(uwbpos::test::mean_interval(0, sigma, kCount, 0.999).contains(uwbpos::test::mean(noisy)));
  CHECK(uwbpos::test::variance_ratio_interval(kCount, 0.999)
            .contains(uwbpos::test::variance(noisy) / (sigma * sigma)));
}

}  // namespace

}  // namespace tests::sim_device_clock
