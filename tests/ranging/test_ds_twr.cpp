// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "../support/statistics.hpp"
#include "exchange.hpp"

namespace tests::ranging_ds_twr {

namespace {

using namespace uwbpos;
using namespace uwbpos::test;

constexpr std::int64_t kMillisecond = 63'897'600;

// An exchange by its four intervals.
DsTwrStamps exchange(std::int64_t round_a, std::int64_t reply_b, std::int64_t reply_a,
                     std::int64_t round_b) {
  const DeviceTime<> a{0xff'ffff'ff00};
  const DeviceTime<> b{987654321};
  return {a, b, b + reply_b, a + round_a, a + round_a + reply_a, b + reply_b + round_b};
}

// Equal clocks, `flight` ticks.
DsTwrStamps plain(std::int64_t flight, std::int64_t reply_b, std::int64_t reply_a) {
  return exchange(reply_b + 2 * flight, reply_b, reply_a, reply_a + 2 * flight);
}

template <class S>
void both_refuse(const DsTwrStamps& stamps, Error error, const TwrOptions<S>& options = {}) {
  const auto asymmetric = ds_twr_range<S>(stamps, options);
  REQUIRE_FALSE(asymmetric);
  CHECK(asymmetric.error() == error);
  const auto symmetric = ds_twr_range_symmetric<S>(stamps, options);
  REQUIRE_FALSE(symmetric);
  CHECK(symmetric.error() == error);
}

TEST_CASE_TEMPLATE("Whole ticks of flight come out exactly at any replies", S, float, double) {
  for (const std::int64_t flight : {0, 1, 100, 6396, 42000}) {
    for (const std::int64_t reply_b : {kMillisecond / 10, kMillisecond, 4000 * kMillisecond}) {
      for (const std::int64_t reply_a :
           {kMillisecond / 10, 3 * kMillisecond, 4000 * kMillisecond}) {
        const DsTwrStamps stamps = plain(flight, reply_b, reply_a);
        const double expected = static_cast<double>(flight) * static_cast<double>(kTick * kAir);
        const auto asymmetric = ds_twr_range<S>(stamps);
        const auto symmetric = ds_twr_range_symmetric<S>(stamps);
        REQUIRE(asymmetric);
        REQUIRE(symmetric);
        // The roundings that the header counts: 6e-7 in float.
        const double epsilon = 5.0 * static_cast<double>(std::numeric_limits<S>::epsilon());
        CHECK(static_cast<double>(asymmetric->value) == doctest::Approx(expected).epsilon(epsilon));
        CHECK(static_cast<double>(symmetric->value) == doctest::Approx(expected).epsilon(epsilon));
      }
    }
  }
}

// A reply of 2^10 to 2^`bits` ticks, even in its logarithm.
std::int64_t reply_below(int bits, sim::Random& random) {
  return std::llround(std::exp2(random.uniform(10, bits)));
}

// Flights to 150 m and a little below nothing, clocks 79 ppm apart at most, a few ticks of noise.
DsTwrStamps random_exchange(int bits, sim::Random& random) {
  const std::int64_t reply_b = reply_below(bits, random);
  const std::int64_t reply_a = reply_below(bits, random);
  const double rate = random.uniform(-79e-6, 79e-6);
  const double flight = 2 * random.uniform(-20, 32000);
  const auto round = [&](std::int64_t reply, double rate_of_other) {
    return reply + std::llround(static_cast<double>(reply) * rate_of_other + flight +
                                random.uniform(-10, 10));
  };
  return exchange(round(reply_b, rate), reply_b, reply_a, round(reply_a, -rate));
}

TEST_CASE_TEMPLATE("Two million ranges are the exact quotient but for the roundings counted", S,
                   float, double) {
  __extension__ using Wide = __int128;
  sim::Random random{"exact quotient"};
  const Real unit = real(std::numeric_limits<S>::epsilon()) / 2;
  int answered = 0;
  int wrong = 0;
  for (int i = 0; i < 2'000'000; ++i) {
    const DsTwrStamps s = random_exchange(i % 2 == 0 ? 30 : 38, random);
    const auto range = ds_twr_range<S>(s);
    if (!range) continue;
    ++answered;
    const Wide round_a = s.resp_rx - s.poll_tx;
    const Wide reply_a = s.final_tx - s.resp_rx;
    const Wide round_b = s.final_rx - s.resp_tx;
    const Wide reply_b = s.resp_tx - s.poll_rx;
    const Real ticks = static_cast<Real>(round_a * round_b - reply_a * reply_b) /
                       static_cast<Real>(round_a + reply_a + round_b + reply_b);
    const Real expected = ticks * kTick * kAir;
    const Real margin = 9.5L * unit * std::abs(expected);  // As the header counts.
    if (!(std::abs(real(range->value) - expected) <= margin)) ++wrong;
  }
  CHECK(wrong == 0);
  CHECK(answered > 1'900'000);
}

TEST_CASE_TEMPLATE("Short exchanges have the bits, and the errors, of long ones", S, float,
                   double) {
  sim::Random random{"short and long"};
  const auto one_of = [&](auto... values) {
    const std::array all{values...};
    return all[random.bits() % all.size()];
  };
  int answered = 0;
  int taken = 0;
  int different = 0;
  for (int i = 0; i < 1'000'000; ++i) {
    TwrOptions<S> options;
    if (i % 2 == 0) {
      options.sigma_timestamp = S(one_of(1e-12, 1e-10, 1e-6, 1e-3));
      options.max_clock_offset = S(one_of(1e-7, 20e-6, 0.01));
      options.max_range = S(one_of(1.0, 50.0, 1e7));
      options.antenna_delay_a = S(one_of(-500e-9, 0.0, 500e-9));
    }
    DsTwrStamps s = random_exchange(31, random);
    const std::int64_t shift =
        one_of(0, 0, 0, 100, -100, 5000, -5000, 1 << 25, -(1 << 25), 1 << 30, -(1 << 30));
    if (i % 3 == 0) s.resp_rx = s.resp_rx + shift;
    if (i % 5 == 0) s.final_rx = s.final_rx + shift;
    if (i % 7 == 0) s.resp_tx = s.poll_rx + one_of(-1, 0, 1, 1 << 29, (1 << 30) - 1, 1 << 30);
    const auto range = ds_twr_range<S>(s, options);
    const auto expected = detail::ds_twr_range_long<S>(s, options);
    Measured<S> unused;
    if (detail::ds_twr_range_short(s, options, unused)) ++taken;
    if (range) ++answered;
    const auto symmetric = ds_twr_range_symmetric<S>(s, options);
    const auto expected_symmetric = detail::ds_twr_range_symmetric_long<S>(s, options);
    const auto equal = [](const auto& one, const auto& other) {
      return one && other ? one->value == other->value && one->variance == other->variance
                          : !one && !other && one.error() == other.error();
    };
    if (!equal(range, expected) || !equal(symmetric, expected_symmetric)) ++different;
  }
  CHECK(different == 0);
  CHECK(answered > 300'000);
  CHECK(taken > 250'000);
  CHECK(taken < answered);
}

TEST_CASE_TEMPLATE("Where the counters stand changes nothing, wraps included", S, float, double) {
  const DsTwrStamps stamps =
      exchange(kMillisecond + 9000, kMillisecond + 30, 2 * kMillisecond, 2 * kMillisecond + 9030);
  const auto expected = ds_twr_range<S>(stamps);
  REQUIRE(expected);
  sim::Random random{"counter positions"};
  for (int i = 0; i < 500; ++i) {
    const auto a = static_cast<std::int64_t>(random.bits() >> 24);
    const auto b = static_cast<std::int64_t>(random.bits() >> 24);
    const DsTwrStamps moved{stamps.poll_tx + a, stamps.poll_rx + b,  stamps.resp_tx + b,
                            stamps.resp_rx + a, stamps.final_tx + a, stamps.final_rx + b};
    const auto range = ds_twr_range<S>(moved);
    REQUIRE(range);
    CHECK(range->value == expected->value);
  }
}

TEST_CASE_TEMPLATE("Variances are 3/8 for equal replies, and the derivatives' for others", S, float,
                   double) {
  const double c = static_cast<double>(kAir);
  const double unit = c * c * 0.15e-9 * 0.15e-9;
  const auto asymmetric = [&](std::int64_t reply_b, std::int64_t reply_a) {
    return static_cast<double>(ds_twr_range<S>(plain(100, reply_b, reply_a)).value().variance) /
           unit;
  };
  CHECK(asymmetric(kMillisecond, kMillisecond) == doctest::Approx(0.375).epsilon(1e-5));
  // f → 1 and f → 0: (1 + 1)/4.
  CHECK(asymmetric(kMillisecond / 10, 100 * kMillisecond) == doctest::Approx(0.5).epsilon(3e-3));
  CHECK(asymmetric(100 * kMillisecond, kMillisecond / 10) == doctest::Approx(0.5).epsilon(3e-3));
  // f = 3/4: (1 + 9/16 + 1/16)/4.
  CHECK(asymmetric(kMillisecond, 3 * kMillisecond) == doctest::Approx(0.40625).epsilon(1e-4));
  const auto symmetric = ds_twr_range_symmetric<S>(plain(100, kMillisecond, 3 * kMillisecond));
  REQUIRE(symmetric);
  CHECK(static_cast<double>(symmetric->variance) / unit == doctest::Approx(0.375).epsilon(1e-5));
}

TEST_CASE_TEMPLATE("Simulated noise has the variances that are promised", S, float, double) {
  sim::Random random{"double-sided noise"};
  const double sigma = 0.15e-9;
  for (const Real reply_a : {1e-3L, 2e-4L, 8e-3L}) {
    const Scene scene{25, 1e-3L, reply_a, 15e-6L, -15e-6L};
    const Real symmetric_error = metres(ds_twr_error_symmetric<Real>(
        scene.time_of_flight(), scene.reply_a, scene.reply_b, scene.rate_a, scene.rate_b));
    std::vector<double> asymmetric;
    std::vector<double> symmetric;
    for (int i = 0; i < 20000; ++i) {
      RealStamps r = real_stamps(scene, uniform(random, 0, 0x1p40), uniform(random, 0, 0x1p40));
      r.poll_rx += noise_ticks(random, sigma);
      r.resp_rx += noise_ticks(random, sigma);
      r.final_rx += noise_ticks(random, sigma);
      // A is scheduled by its own counter: the final's departure does not know the noise of the
      // response's arrival.
      const auto a = ds_twr_range<S>(stamps(r));
      REQUIRE(a);
      asymmetric.push_back((static_cast<double>(a->value) - 25) /
                           std::sqrt(static_cast<double>(a->variance)));
      TwrOptions<S> far;
      far.max_range = S(5000);
      far.sigma_timestamp = S(sigma);
      const auto s = ds_twr_range_symmetric<S>(stamps(r), far);
      if (!s) continue;  // behind the anchor by its own error at unequal replies
      symmetric.push_back(
          (static_cast<double>(s->value) - static_cast<double>(25 + symmetric_error)) /
          std::sqrt(static_cast<double>(s->variance)));
    }
    // 1 % of sampling error in 20 000 squares, ±4 of it.
    const double a = root_mean_square(asymmetric);
    CHECK(a * a == doctest::Approx(1).epsilon(0.04));
    if (symmetric.size() > 10000) {
      const double s = root_mean_square(symmetric);
      CHECK(s * s == doctest::Approx(1).epsilon(0.04));
    }
  }
}

TEST_CASE_TEMPLATE("The clock offset of an exchange is the clocks' ratio", S, float, double) {
  sim::Random random{"free clock offset"};
  for (int i = 0; i < 2000; ++i) {
    Scene s{uniform(random, 0, 100), random_reply(random), random_reply(random), 0, 0};
    s.rate_a = uniform(random, -40e-6, 40e-6);
    s.rate_b = uniform(random, -40e-6, 40e-6);
    const auto offset = ds_twr_clock_offset<S>(random_stamps(s, random));
    REQUIRE(offset);
    const Real expected = (s.rate_b - s.rate_a) / (1 + s.rate_a);
    // Four stamps rounded by half a tick over the span, and 2^-23 of the value.
    const Real span = (s.reply_a + s.reply_b + 2 * s.time_of_flight()) / kTick;
    CHECK(std::abs(real(*offset) - expected) <
          2.1L / span + real(std::numeric_limits<S>::epsilon()) * std::abs(expected));
  }
}

TEST_CASE_TEMPLATE("It has the same sign as single-sided ranging wants", S, float, double) {
  sim::Random random{"offset into single-sided"};
  const Scene scene{30, 2e-3L, 40e-3L, -15e-6L, 20e-6L};
  const DsTwrStamps s = random_stamps(scene, random);
  TwrOptions<S> options;
  options.clock_offset = ds_twr_clock_offset<S>(s).value();
  const auto range = ss_twr_range<S>(single(s), options);
  REQUIRE(range);
  // Rounded stamps: 2 ticks; offset: a tick over 42 ms, times 2 ms.
  CHECK(static_cast<double>(range->value) == doctest::Approx(30).epsilon(0.012 / 30));
}

TEST_CASE_TEMPLATE("Antenna delays come off, half of each", S, float, double) {
  const DsTwrStamps stamps = plain(40000, kMillisecond, 2 * kMillisecond);
  TwrOptions<S> options;
  options.antenna_delay_a = S(514e-9);
  options.antenna_delay_b = S(516e-9);
  const double taken = 515e-9 * static_cast<double>(kAir);
  const auto difference = [&](auto method) {
    return static_cast<double>(method(stamps, TwrOptions<S>{}).value().value -
                               method(stamps, options).value().value);
  };
  CHECK(difference([](auto s, auto o) { return ds_twr_range<S>(s, o); }) ==
        doctest::Approx(taken).epsilon(1e-6));
  CHECK(difference([](auto s, auto o) { return ds_twr_range_symmetric<S>(s, o); }) ==
        doctest::Approx(taken).epsilon(1e-6));
}

TEST_CASE_TEMPLATE("Impossible intervals are refused by name", S, float, double) {
  const std::int64_t half = DeviceTime<>::kHalfWrap;
  const std::int64_t exact = std::int64_t{1} << 38;
  const std::int64_t ms = kMillisecond;
  for (const std::int64_t bad : {std::int64_t{0}, std::int64_t{-1}, -ms}) {
    both_refuse<S>(exchange(bad, ms, ms, ms), Error::NonPositiveInterval);
    both_refuse<S>(exchange(ms, bad, ms, ms), Error::NonPositiveInterval);
    both_refuse<S>(exchange(ms, ms, bad, ms), Error::NonPositiveInterval);
    both_refuse<S>(exchange(ms, ms, ms, bad), Error::NonPositiveInterval);
    CHECK(ds_twr_clock_offset<S>(exchange(ms, ms, bad, ms)).error() == Error::NonPositiveInterval);
  }
  for (const std::int64_t bad : {half, half - 1, exact}) {
    both_refuse<S>(exchange(bad, ms, ms, ms), Error::IntervalTooLong);
    both_refuse<S>(exchange(ms, bad, ms, ms), Error::IntervalTooLong);
    both_refuse<S>(exchange(ms, ms, bad, ms), Error::IntervalTooLong);
    both_refuse<S>(exchange(ms, ms, ms, bad), Error::IntervalTooLong);
    CHECK(ds_twr_clock_offset<S>(exchange(bad, ms, ms, ms)).error() == Error::IntervalTooLong);
  }
  // 2^39 ticks and beyond look negative.
  both_refuse<S>(exchange(half + 1, ms, ms, ms), Error::NonPositiveInterval);
  // The longest that are exact are answered.
  const auto longest = ds_twr_range<S>(plain(1000, exact - 2001, exact - 2001));
  REQUIRE(longest);
  CHECK(static_cast<double>(longest->value) ==
        doctest::Approx(1000 * static_cast<double>(kTick * kAir)).epsilon(1e-6));
}

TEST_CASE_TEMPLATE("The largest products that the bounds admit do not overflow", S, float, double) {
  // Under the sanitizer, too. x = y = 2^25 − 1 with intervals just below 2^38: each product has 63
  // bits, their sum 64.
  const std::int64_t x = (std::int64_t{1} << 25) - 1;
  const std::int64_t reply = (std::int64_t{1} << 38) - 1 - x;
  TwrOptions<S> options;
  options.max_range = S(1e7);
  const auto summed = ds_twr_range<S>(exchange(reply + x, reply, reply, reply + x), options);
  REQUIRE_FALSE(summed);
  CHECK(summed.error() == Error::IntervalTooLong);
  // One step beyond the bound, short intervals.
  both_refuse<S>(exchange(reply / 2 + x + 1, reply / 2, reply / 2, reply / 2 + x + 1),
                 Error::IntervalTooLong, options);
  // Opposite signs cancel but for the flight; 2^25 of 2^38 is 122 ppm, whose square is 1024 ticks.
  options.max_clock_offset = S(200e-6);
  for (const DsTwrStamps& stamps : {exchange(reply + x, reply, reply, reply - x + 8000),
                                    exchange(reply - x + 8000, reply, reply, reply + x)}) {
    const auto range = ds_twr_range<S>(stamps, options);
    REQUIRE(range);
    CHECK(static_cast<double>(range->value) ==
          doctest::Approx(static_cast<double>(intervals(stamps).asymmetric())).epsilon(1e-6));
  }
}

TEST_CASE_TEMPLATE("A clock ratio outside the bound is refused", S, float, double) {
  const std::int64_t ms = kMillisecond;
  const std::int64_t flight = 6396;
  // B counts 79 and 82 ppm more than A; 83 ticks of noise are allowed.
  const auto faster = [&](std::int64_t ppm, std::int64_t span) {
    return exchange(span + 2 * flight, span + span * ppm / 1'000'000, span,
                    span + 2 * flight + span * ppm / 1'000'000);
  };
  CHECK(ds_twr_range<S>(faster(79, 10 * ms)).has_value());
  CHECK(ds_twr_range<S>(faster(-79, 10 * ms)).has_value());
  both_refuse<S>(faster(82, 100 * ms), Error::ClockOffsetOutOfBounds);
  both_refuse<S>(faster(-82, 100 * ms), Error::ClockOffsetOutOfBounds);
  // Over 0.1 ms, noise of four ticks a stamp is 80 ppm by itself, and no ground to refuse.
  CHECK(ds_twr_range<S>(
            exchange(ms / 20 + 2 * flight, ms / 20 - 40, ms / 20, ms / 20 + 2 * flight - 40))
            .has_value());
}

TEST_CASE_TEMPLATE("A reply longer than its round trip is refused", S, float, double) {
  const std::int64_t ms = kMillisecond;
  const std::int64_t beyond = ms * 80 / 1'000'000 + 100;
  both_refuse<S>(exchange(ms - beyond, ms, ms, ms - beyond), Error::ReplyExceedsRoundTrip);
  // Only one of the two, hidden in the ratio by a long other leg.
  both_refuse<S>(exchange(ms - beyond, ms, 1000 * ms, 1000 * ms), Error::ReplyExceedsRoundTrip);
  both_refuse<S>(exchange(1000 * ms, 1000 * ms, ms, ms - beyond), Error::ReplyExceedsRoundTrip);
}

TEST_CASE_TEMPLATE("Times of flight below zero or beyond the maximum are refused", S, float,
                   double) {
  const std::int64_t ms = kMillisecond;
  // σ is √(3/8)·9.58 = 5.87 ticks: six of it and two are 37.2.
  CHECK(ds_twr_range<S>(plain(-37, ms, ms)).has_value());
  both_refuse<S>(plain(-38, ms, ms), Error::NegativeTimeOfFlight);
  CHECK(ds_twr_range<S>(plain(106600, ms, ms)).has_value());
  both_refuse<S>(plain(106605, ms, ms), Error::RangeBeyondMaximum);
}

TEST_CASE_TEMPLATE("NaN, infinity and options outside their domain pass no gate", S, float,
                   double) {
  const DsTwrStamps good = plain(1000, kMillisecond, kMillisecond);
  using Member = S TwrOptions<S>::*;
  for (const Member member :
       {&TwrOptions<S>::antenna_delay_a, &TwrOptions<S>::antenna_delay_b,
        &TwrOptions<S>::sigma_timestamp, &TwrOptions<S>::max_range,
        &TwrOptions<S>::max_clock_offset, &TwrOptions<S>::propagation_speed}) {
    for (const S bad : {std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity(),
                        -std::numeric_limits<S>::infinity()}) {
      TwrOptions<S> options;
      options.*member = bad;
      both_refuse<S>(good, Error::NotFinite, options);
    }
  }
  TwrOptions<S> options;
  options.sigma_timestamp = 0;
  both_refuse<S>(good, Error::NonPositiveSigma, options);
  options = {};
  options.max_range = -1;
  both_refuse<S>(good, Error::InvalidOption, options);
}

TEST_CASE_TEMPLATE("Options are valid up to the ends of their domains and not beyond", S, float,
                   double) {
  const DsTwrStamps good = plain(1000, kMillisecond, kMillisecond);
  const auto refused = [&](S TwrOptions<S>::* member, S value, Error error) {
    TwrOptions<S> options;
    options.*member = value;
    both_refuse<S>(good, error, options);
  };
  const auto accepted = [&](S TwrOptions<S>::* member, S value) {
    TwrOptions<S> options;
    options.*member = value;
    // Refused it may be, but not for an option.
    const auto range = ds_twr_range<S>(good, options);
    return range || range.error() == Error::RangeBeyondMaximum ||
           range.error() == Error::ClockOffsetOutOfBounds ||
           range.error() == Error::NegativeTimeOfFlight;
  };
  const S huge = std::numeric_limits<S>::infinity();
  const S least = std::numeric_limits<S>::denorm_min();
  for (const auto member : {&TwrOptions<S>::antenna_delay_a, &TwrOptions<S>::antenna_delay_b}) {
    for (const S end : {S(1e-3), S(-1e-3), S(-0.0)}) CHECK(accepted(member, end));
    refused(member, std::nextafter(S(1e-3), huge), Error::InvalidOption);
    refused(member, std::nextafter(S(-1e-3), -huge), Error::InvalidOption);
  }
  CHECK(accepted(&TwrOptions<S>::sigma_timestamp, least));
  CHECK(accepted(&TwrOptions<S>::sigma_timestamp, S(1e-3)));
  refused(&TwrOptions<S>::sigma_timestamp, S(-0.0), Error::NonPositiveSigma);
  refused(&TwrOptions<S>::sigma_timestamp, -least, Error::NonPositiveSigma);
  for (const auto& [member, most] : {std::pair{&TwrOptions<S>::sigma_timestamp, S(1e-3)},
                                     std::pair{&TwrOptions<S>::max_range, S(1e7)},
                                     std::pair{&TwrOptions<S>::max_clock_offset, S(0.01)},
                                     std::pair{&TwrOptions<S>::propagation_speed, S(3e8)}}) {
    CHECK(accepted(member, most));
    refused(member, std::nextafter(most, huge), Error::InvalidOption);
  }
  for (const auto member : {&TwrOptions<S>::max_range, &TwrOptions<S>::max_clock_offset}) {
    CHECK(accepted(member, least));
    for (const S bad : {S(0), S(-0.0), -least}) refused(member, bad, Error::InvalidOption);
  }
  CHECK(accepted(&TwrOptions<S>::propagation_speed, S(1)));
  for (const S bad : {std::nextafter(S(1), S(0)), S(0), S(-1)}) {
    refused(&TwrOptions<S>::propagation_speed, bad, Error::InvalidOption);
  }
}

TEST_CASE_TEMPLATE("One frame of another exchange spoils the range visibly", S, float, double) {
  const DsTwrStamps good = plain(2000, kMillisecond, kMillisecond);
  for (const double seconds : {0.01, 0.1, 1.0, 4.0, 8.7, 17.0, 17.3}) {
    const std::int64_t age = std::llround(seconds * 63'897'600'000.0);
    DsTwrStamps stale = good;
    stale.poll_tx = good.poll_tx - age;
    CHECK_FALSE(ds_twr_range<S>(stale));
    stale = good;
    stale.poll_rx = good.poll_rx - age;
    CHECK_FALSE(ds_twr_range<S>(stale));
    stale = good;
    stale.final_rx = good.final_rx + age;
    CHECK_FALSE(ds_twr_range<S>(stale));
    stale = good;
    stale.resp_rx = good.resp_rx - age;
    CHECK_FALSE(ds_twr_range<S>(stale));
  }
}

}  // namespace

}  // namespace tests::ranging_ds_twr
