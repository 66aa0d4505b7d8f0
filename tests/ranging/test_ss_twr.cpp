// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include "../support/statistics.hpp"
#include "exchange.hpp"

namespace tests::ranging_ss_twr {

namespace {

using namespace uwbpos;
using namespace uwbpos::test;

constexpr std::int64_t kMillisecond = 63'897'600;

// An exchange by its two intervals, somewhere in the counter.
SsTwrStamps exchange(std::int64_t round_a, std::int64_t reply_b) {
  const DeviceTime<> a{123456789};
  const DeviceTime<> b{0xff'fff0'0000};
  return {a, b, b + reply_b, a + round_a};
}

template <class S>
Error error_of(const SsTwrStamps& stamps, const TwrOptions<S>& options = {}) {
  const auto range = ss_twr_range<S>(stamps, options);
  REQUIRE_FALSE(range);
  return range.error();
}

TEST_CASE_TEMPLATE("Whole ticks of flight come out exactly", S, float, double) {
  for (const std::int64_t flight : {0, 1, 100, 6396, 100000}) {
    const auto range = ss_twr_range<S>(exchange(kMillisecond + 2 * flight, kMillisecond));
    REQUIRE(range);
    // Two roundings of the scale, one of the product: 3·2^-24.
    CHECK(static_cast<double>(range->value) ==
          doctest::Approx(static_cast<double>(flight) * static_cast<double>(kTick * kAir))
              .epsilon(4.0 * static_cast<double>(std::numeric_limits<S>::epsilon())));
  }
}

TEST_CASE_TEMPLATE("A counter that wraps inside the exchange changes nothing", S, float, double) {
  const SsTwrStamps plain = exchange(kMillisecond + 2000, kMillisecond);
  const auto expected = ss_twr_range<S>(plain);
  REQUIRE(expected);
  for (const std::int64_t shift :
       {-kMillisecond, -kMillisecond / 2, std::int64_t{-1}, std::int64_t{0}}) {
    const DeviceTime<> edge = DeviceTime<>{0} + shift;
    const SsTwrStamps wrapping{edge, edge, edge + kMillisecond, edge + kMillisecond + 2000};
    const auto range = ss_twr_range<S>(wrapping);
    REQUIRE(range);
    CHECK(range->value == expected->value);
    CHECK(range->variance == expected->variance);
  }
}

TEST_CASE_TEMPLATE("The variance is that of two noisy receptions and of the offset", S, float,
                   double) {
  TwrOptions<S> options;
  options.sigma_timestamp = S(0.2e-9);
  const double c = static_cast<double>(kAir);
  const SsTwrStamps stamps = exchange(kMillisecond + 2000, kMillisecond);
  const double stamps_only = c * c * 0.04e-18 / 2;
  const auto range = ss_twr_range<S>(stamps, options);
  REQUIRE(range);
  CHECK(static_cast<double>(range->variance) == doctest::Approx(stamps_only).epsilon(1e-5));
  options.sigma_clock_offset = S(1e-6);
  const double drift = c * 1e-3 * 1e-6 / 2;
  const auto uncertain = ss_twr_range<S>(stamps, options);
  REQUIRE(uncertain);
  CHECK(static_cast<double>(uncertain->variance) ==
        doctest::Approx(stamps_only + drift * drift).epsilon(1e-5));
}

TEST_CASE_TEMPLATE("Simulated noise has the variance that is promised", S, float, double) {
  sim::Random random{"single-sided noise"};
  const double sigma = 0.15e-9;
  const double sigma_offset = 0.05e-6;
  TwrOptions<S> options;
  options.sigma_clock_offset = S(sigma_offset);
  const Scene scene{40, 2e-3L, 2e-3L, 0, 0};
  std::vector<double> normalised;
  for (int i = 0; i < 20000; ++i) {
    RealStamps r = real_stamps(scene, uniform(random, 0, 0x1p40), uniform(random, 0, 0x1p40));
    r.poll_rx += noise_ticks(random, sigma);
    r.resp_rx += noise_ticks(random, sigma);
    options.clock_offset = static_cast<S>(random.normal(0, sigma_offset));
    const auto range = ss_twr_range<S>(single(stamps(r)), options);
    REQUIRE(range);
    normalised.push_back((static_cast<double>(range->value) - 40) /
                         std::sqrt(static_cast<double>(range->variance)));
  }
  // The mean of 20 000 squares of normals has standard deviation √(2/20000) = 1 %; rounding to
  // ticks adds (1/12)/(9.6² · …) < 0.1 %.
  const double rms = root_mean_square(normalised);
  CHECK(rms * rms == doctest::Approx(1).epsilon(0.04));
  CHECK(std::abs(mean(normalised)) < 0.03);
}

TEST_CASE_TEMPLATE("Near zero the range is not clamped, so its mean is right", S, float, double) {
  sim::Random random{"single-sided near zero"};
  std::vector<double> values;
  for (int i = 0; i < 20000; ++i) {
    RealStamps r = real_stamps({0, 1e-3L, 1e-3L, 0, 0}, uniform(random, 0, 1e9), 0);
    r.poll_rx += noise_ticks(random, 0.15e-9);
    r.resp_rx += noise_ticks(random, 0.15e-9);
    const auto range = ss_twr_range<S>(single(stamps(r)));
    REQUIRE(range);
    values.push_back(static_cast<double>(range->value));
  }
  CHECK(quantile(values, 0) < -0.05);
  // 3.2 cm over √20000 is 0.23 mm; clamping would leave +13 mm.
  CHECK(std::abs(mean(values)) < 1.2e-3);
}

TEST_CASE_TEMPLATE("Antenna delays come off, half of each", S, float, double) {
  const SsTwrStamps stamps = exchange(kMillisecond + 2 * 40000, kMillisecond);
  TwrOptions<S> options;
  const auto raw = ss_twr_range<S>(stamps, options);
  options.antenna_delay_a = S(514e-9);
  options.antenna_delay_b = S(516e-9);
  const auto range = ss_twr_range<S>(stamps, options);
  REQUIRE(raw);
  REQUIRE(range);
  // 188 m less 154 m, each to a float's 2^-24 of 256.
  CHECK(static_cast<double>(raw->value - range->value) ==
        doctest::Approx(515e-9 * static_cast<double>(kAir)).epsilon(1e-6));
  CHECK(range->variance == raw->variance);
}

TEST_CASE_TEMPLATE("A reply longer than the round trip is explained by clocks or refused", S, float,
                   double) {
  // 79 ppm of 1 ms.
  const std::int64_t drift = kMillisecond * 79 / 1'000'000;
  TwrOptions<S> options;
  options.clock_offset = S(79e-6);
  const auto range =
      ss_twr_range<S>(exchange(kMillisecond + 2 * 6396 - drift, kMillisecond), options);
  REQUIRE(range);
  CHECK(static_cast<double>(range->value) == doctest::Approx(30.0).epsilon(1e-3));
  // 82 ppm and 100 ticks of noise are beyond ±80 ppm and six standard deviations (83 ticks).
  const std::int64_t beyond = kMillisecond * 82 / 1'000'000 + 100;
  CHECK(error_of<S>(exchange(kMillisecond - beyond, kMillisecond), options) ==
        Error::ReplyExceedsRoundTrip);
  // In a short reply clocks explain nothing; noise alone does.
  CHECK(error_of<S>(exchange(1000, 1200), options) == Error::ReplyExceedsRoundTrip);
  CHECK(ss_twr_range<S>(exchange(1000, 1020)).has_value());
}

TEST_CASE_TEMPLATE("Impossible intervals are refused by name", S, float, double) {
  const std::int64_t half = DeviceTime<>::kHalfWrap;
  CHECK(error_of<S>(exchange(0, 100)) == Error::NonPositiveInterval);
  CHECK(error_of<S>(exchange(100, 0)) == Error::NonPositiveInterval);
  CHECK(error_of<S>(exchange(-5, 100)) == Error::NonPositiveInterval);
  CHECK(error_of<S>(exchange(100, -5)) == Error::NonPositiveInterval);
  CHECK(error_of<S>(exchange(half, 100)) == Error::IntervalTooLong);
  CHECK(error_of<S>(exchange(100, half)) == Error::IntervalTooLong);
  // The longest that can be told, 8.6 s, is answered.
  CHECK(ss_twr_range<S>(exchange(half - 1, half - 201)).has_value());
}

TEST_CASE_TEMPLATE("Times of flight below zero or beyond the maximum are refused", S, float,
                   double) {
  // σ of the range is 3.2 cm = 6.8 ticks of flight: six of it and two ticks are 42.6.
  CHECK(ss_twr_range<S>(exchange(kMillisecond - 2 * 42, kMillisecond)).has_value());
  CHECK(error_of<S>(exchange(kMillisecond - 2 * 44, kMillisecond)) == Error::NegativeTimeOfFlight);
  // A wide offset sigma makes the same exchange plausible.
  TwrOptions<S> options;
  options.sigma_clock_offset = S(5e-6);
  CHECK(ss_twr_range<S>(exchange(kMillisecond - 2 * 44, kMillisecond), options).has_value());
  // 500 m are 106 602.6 ticks.
  CHECK(ss_twr_range<S>(exchange(kMillisecond + 2 * 106600, kMillisecond)).has_value());
  CHECK(error_of<S>(exchange(kMillisecond + 2 * 106605, kMillisecond)) ==
        Error::RangeBeyondMaximum);
  options.max_range = S(10);
  CHECK(error_of<S>(exchange(kMillisecond + 2 * 6396, kMillisecond), options) ==
        Error::RangeBeyondMaximum);
}

TEST_CASE_TEMPLATE("A clock offset beyond the bound is refused", S, float, double) {
  TwrOptions<S> options;
  for (const S offset : {S(81e-6), S(-81e-6), S(1), S(-1e30)}) {
    options.clock_offset = offset;
    CHECK(error_of<S>(exchange(kMillisecond, kMillisecond), options) ==
          Error::ClockOffsetOutOfBounds);
  }
}

TEST_CASE_TEMPLATE("NaN and infinity pass no gate", S, float, double) {
  const SsTwrStamps good = exchange(kMillisecond + 2000, kMillisecond);
  using Member = S TwrOptions<S>::*;
  for (const Member member :
       {&TwrOptions<S>::clock_offset, &TwrOptions<S>::antenna_delay_a,
        &TwrOptions<S>::antenna_delay_b, &TwrOptions<S>::sigma_timestamp, &TwrOptions<S>::max_range,
        &TwrOptions<S>::max_clock_offset, &TwrOptions<S>::propagation_speed,
        &TwrOptions<S>::sigma_clock_offset}) {
    for (const S bad : {std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity(),
                        -std::numeric_limits<S>::infinity()}) {
      TwrOptions<S> options;
      options.*member = bad;
      CHECK(error_of<S>(good, options) == Error::NotFinite);
    }
  }
}

TEST_CASE_TEMPLATE("Options outside their domain are refused by name", S, float, double) {
  const SsTwrStamps good = exchange(kMillisecond + 2000, kMillisecond);
  TwrOptions<S> options;
  for (const S sigma : {S(0), S(-1e-10)}) {
    options = {};
    options.sigma_timestamp = sigma;
    CHECK(error_of<S>(good, options) == Error::NonPositiveSigma);
  }
  const auto refuses = [&](S TwrOptions<S>::* member, S value) {
    options = {};
    options.*member = value;
    CHECK(error_of<S>(good, options) == Error::InvalidOption);
  };
  refuses(&TwrOptions<S>::antenna_delay_a, S(0.1));
  refuses(&TwrOptions<S>::antenna_delay_b, S(-0.1));
  refuses(&TwrOptions<S>::sigma_timestamp, S(1));
  refuses(&TwrOptions<S>::max_range, S(0));
  refuses(&TwrOptions<S>::max_range, S(-10));
  refuses(&TwrOptions<S>::max_clock_offset, S(0));
  refuses(&TwrOptions<S>::max_clock_offset, S(0.5));
  refuses(&TwrOptions<S>::propagation_speed, S(0));
  refuses(&TwrOptions<S>::propagation_speed, S(1e9));
  refuses(&TwrOptions<S>::sigma_clock_offset, S(-1e-9));
}

TEST_CASE_TEMPLATE("A tiny or denormal offset is a small offset", S, float, double) {
  TwrOptions<S> options;
  const SsTwrStamps stamps = exchange(2 * kMillisecond + 2000, 2 * kMillisecond);
  const auto expected = ss_twr_range<S>(stamps);
  REQUIRE(expected);
  for (const S offset : {std::numeric_limits<S>::min(), -std::numeric_limits<S>::min(),
                         std::numeric_limits<S>::denorm_min(), S(1e-15), S(-1e-15)}) {
    options.clock_offset = offset;
    const auto range = ss_twr_range<S>(stamps, options);
    REQUIRE(range);
    // 1e-15 of 2 ms is a hundred-thousandth of a tick.
    CHECK(static_cast<double>(range->value) ==
          doctest::Approx(static_cast<double>(expected->value)).epsilon(1e-6));
  }
}

TEST_CASE_TEMPLATE("Stamps older than a wrap give an error or an absurd range, never a near one", S,
                   float, double) {
  // The response of an exchange paired with the poll of one that is `age` older. Ages around whole
  // wraps alias to valid exchanges by the counter's nature; all others must be refused.
  const SsTwrStamps good = exchange(kMillisecond + 2000, kMillisecond);
  for (const double seconds : {0.1, 1.0, 5.0, 8.59, 8.7, 12.0, 17.0, 17.3, 20.0}) {
    SsTwrStamps stale = good;
    stale.poll_tx = good.poll_tx - std::llround(seconds * 63'897'600'000.0);
    CHECK_FALSE(ss_twr_range<S>(stale));
  }
}

TEST_CASE_TEMPLATE("Every exchange stands alone", S, float, double) {
  const SsTwrStamps good = exchange(kMillisecond + 2000, kMillisecond);
  const auto first = ss_twr_range<S>(good);
  CHECK_FALSE(ss_twr_range<S>(exchange(0, 0)));
  const auto second = ss_twr_range<S>(good);
  REQUIRE(first);
  REQUIRE(second);
  CHECK(first->value == second->value);
}

}  // namespace

}  // namespace tests::ranging_ss_twr
