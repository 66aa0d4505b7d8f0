// SPDX-License-Identifier: MIT
// The arithmetic of two-way ranging against long double, over all rates and reply times.
#include <cmath>

#include <doctest/doctest.h>

#include "exchange.hpp"

namespace tests::ranging_twr_accuracy {

namespace {

using namespace uwbpos;
using namespace uwbpos::test;

constexpr Real kTenthOfAMillimetre = 1e-4L;

Scene random_scene(sim::Random& random) {
  Scene s{};
  s.range = uniform(random, 0.1, 200);
  s.reply_b = random_reply(random);
  s.reply_a = random_reply(random);
  s.rate_a = uniform(random, -40e-6, 40e-6);
  // 80 ppm apart at most, whatever time the difference is counted in.
  s.rate_b = uniform(random, -39.9e-6, 39.9e-6);
  return s;
}

TEST_CASE_TEMPLATE("Asymmetric ranging agrees with long double to 0.1 mm", S, float, double) {
  sim::Random random{"asymmetric against long double"};
  for (int i = 0; i < 20000; ++i) {
    const Scene scene = random_scene(random);
    const DsTwrStamps s = random_stamps(scene, random);
    const auto range = ds_twr_range<S>(s);
    REQUIRE(range);
    CHECK(std::abs(real(range->value) - intervals(s).asymmetric()) < kTenthOfAMillimetre);
  }
}

TEST_CASE_TEMPLATE("Symmetric ranging agrees with long double to 0.1 mm", S, float, double) {
  sim::Random random{"symmetric against long double"};
  for (int i = 0; i < 20000; ++i) {
    Scene scene = random_scene(random);
    // Replies equal to within 1 ms: beyond, the method's own error is kilometres, of which a
    // float cannot show a tenth of a millimetre.
    scene.reply_a = scene.reply_b + uniform(random, 0, 1e-3);
    const DsTwrStamps s = random_stamps(scene, random);
    const auto range = ds_twr_range_symmetric<S>(s);
    const Real expected = intervals(s).symmetric();
    if (!range) {
      // The method's own error, up to (1 ms)(80 ppm)/4, may put a near tag behind the anchor.
      CHECK(range.error() == Error::NegativeTimeOfFlight);
      CHECK(expected < 0);
      continue;
    }
    CHECK(std::abs(real(range->value) - expected) < kTenthOfAMillimetre);
  }
}

TEST_CASE_TEMPLATE("Single-sided ranging with a known offset agrees with long double to 0.1 mm", S,
                   float, double) {
  sim::Random random{"single-sided against long double"};
  for (int i = 0; i < 20000; ++i) {
    const Scene scene = random_scene(random);
    const DsTwrStamps s = random_stamps(scene, random);
    TwrOptions<S> options;
    options.clock_offset = static_cast<S>(offset_in_b(scene));
    const auto range = ss_twr_range<S>(single(s), options);
    REQUIRE(range);
    // The reference is given the same δ, rounded to S.
    const Real expected = intervals(s).single(real(options.clock_offset));
    CHECK(std::abs(real(range->value) - expected) < kTenthOfAMillimetre);
  }
}

TEST_CASE_TEMPLATE("Single-sided ranging without an offset agrees with long double to 0.1 mm", S,
                   float, double) {
  sim::Random random{"single-sided without offset"};
  int answered = 0;
  for (int i = 0; i < 20000; ++i) {
    Scene scene = random_scene(random);
    scene.reply_b = uniform(random, 1e-4, 2e-3);
    const DsTwrStamps s = random_stamps(scene, random);
    TwrOptions<S> options;
    options.sigma_clock_offset = S(40e-6);
    const auto range = ss_twr_range<S>(single(s), options);
    REQUIRE(range);
    ++answered;
    CHECK(std::abs(real(range->value) - intervals(s).single(0)) < kTenthOfAMillimetre);
  }
  CHECK(answered == 20000);
}

TEST_CASE("Long-double stamps, unrounded, have the errors that the headers state") {
  // No rounding to ticks here: the methods' own errors, to 1e-9 m, which is what differences of
  // 64-bit numbers of 2^40 ticks leave (2^-24 tick · 4.7 mm = 3e-10 m a stamp), except where the
  // first-order expressions leave out products of rates (40 ppm² = 1.6e-9 of 200 m).
  sim::Random random{"unrounded"};
  for (int i = 0; i < 20000; ++i) {
    const Scene s = random_scene(random);
    const RealIntervals d = intervals(real_stamps(s));
    const Real flight = s.time_of_flight();
    const Real alpha = 1 + s.rate_a;
    const Real beta = 1 + s.rate_b;
    CHECK(std::abs(d.asymmetric() - s.range * 2 * alpha * beta / (alpha + beta)) < 2e-9L);
    CHECK(std::abs(d.asymmetric() - s.range - metres(ds_twr_error(flight, s.rate_a, s.rate_b))) <
          4e-7L);
    CHECK(std::abs(d.symmetric() - s.range -
                   metres(ds_twr_error_symmetric(flight, s.reply_a, s.reply_b, s.rate_a,
                                                 s.rate_b))) < 2e-9L);
    CHECK(std::abs(d.single(0) - s.range -
                   metres(ss_twr_error(flight, s.reply_b, s.rate_a, s.rate_b))) < 2e-9L);
    CHECK(std::abs(d.single(offset_in_b(s)) - s.range * alpha) < 2e-9L);
  }
}

// The mean error [m] over exchanges whose clocks stand at random phases of a tick. Six stamps
// rounded to ticks (variance 1/12 each) give the asymmetric range a standard deviation of
// √(3/4 · 1/12) tick = 1.2 mm, so the mean of 40 000 is sure to 6 µm, and of the other methods,
// no noisier than √(1/12 · 4/4) tick = 1.4 mm, to 7 µm.
struct MeanErrors {
  Real asymmetric = 0;
  Real symmetric = 0;
  Real single = 0;
};

template <class S>
MeanErrors mean_errors(const Scene& scene, sim::Random& random) {
  constexpr int count = 40000;
  TwrOptions<S> options;
  options.sigma_clock_offset = S(40e-6);
  options.max_range = S(5000);
  MeanErrors sum;
  for (int i = 0; i < count; ++i) {
    const DsTwrStamps s = random_stamps(scene, random);
    const auto asymmetric = ds_twr_range<S>(s, options);
    const auto symmetric = ds_twr_range_symmetric<S>(s, options);
    const auto single_sided = ss_twr_range<S>(single(s), options);
    REQUIRE(asymmetric);
    REQUIRE(symmetric);
    REQUIRE(single_sided);
    sum.asymmetric += real(asymmetric->value) - scene.range;
    sum.symmetric += real(symmetric->value) - scene.range;
    sum.single += real(single_sided->value) - scene.range;
  }
  return {sum.asymmetric / count, sum.symmetric / count, sum.single / count};
}

TEST_CASE_TEMPLATE("At 30 m the asymmetric error is the clocks' scale and nothing else", S, float,
                   double) {
  sim::Random random{"asymmetric at 30 m"};
  for (const Real reply_a : {1e-4L, 3e-3L, 0.2L, 4.0L}) {
    for (const Real reply_b : {1e-4L, 1e-3L, 4.0L}) {
      // Opposite rates: no scale is left, and the error itself is below 0.1 mm.
      const Scene opposite{30, reply_b, reply_a, 20e-6L, -20e-6L};
      Real sum = 0;
      Real scaled_sum = 0;
      const Scene equal{30, reply_b, reply_a, 40e-6L, 40e-6L};
      constexpr int count = 10000;
      for (int i = 0; i < count; ++i) {
        const auto range = ds_twr_range<S>(random_stamps(opposite, random));
        const auto scaled = ds_twr_range<S>(random_stamps(equal, random));
        REQUIRE(range);
        REQUIRE(scaled);
        sum += real(range->value) - 30;
        scaled_sum += real(scaled->value) - 30;
      }
      // Mean of 10 000 roundings of 1.2 mm: 12 µm; 0.1 mm is eight of that.
      CHECK(std::abs(sum / count) < kTenthOfAMillimetre);
      // Both at +40 ppm: 30 m · 40 ppm = 1.2 mm, which no exchange between the two can tell.
      CHECK(std::abs(scaled_sum / count - 1.2e-3L) < kTenthOfAMillimetre);
    }
  }
}

TEST_CASE_TEMPLATE("Mean errors of all methods follow the prediction functions", S, float, double) {
  sim::Random random{"prediction functions"};
  for (const Scene& scene :
       {Scene{30, 3e-4L, 3e-4L, 20e-6L, -20e-6L}, Scene{30, 3e-4L, 1.1e-3L, -20e-6L, 20e-6L},
        Scene{80, 1.1e-3L, 3e-4L, -20e-6L, 20e-6L}, Scene{12, 5e-3L, 5.3e-3L, 20e-6L, 15e-6L},
        Scene{120, 1e-3L, 2e-3L, 5e-6L, 40e-6L}}) {
    const MeanErrors error = mean_errors<S>(scene, random);
    const auto flight = static_cast<S>(scene.time_of_flight());
    const auto a = static_cast<S>(scene.rate_a);
    const auto b = static_cast<S>(scene.rate_b);
    const auto reply_a = static_cast<S>(scene.reply_a);
    const auto reply_b = static_cast<S>(scene.reply_b);
    CHECK(std::abs(error.asymmetric - metres(real(ds_twr_error<S>(flight, a, b)))) <
          kTenthOfAMillimetre);
    CHECK(std::abs(error.symmetric - metres(real(ds_twr_error_symmetric<S>(
                                         flight, reply_a, reply_b, a, b)))) < kTenthOfAMillimetre);
    CHECK(std::abs(error.single - metres(real(ss_twr_error<S>(flight, reply_b, a, b)))) <
          kTenthOfAMillimetre);
  }
}

TEST_CASE("The paper prints (000-14) with the wrong sign") {
  // T = Da − Db = 0.8 ms, eB − eA = 40 ppm: ±2.4 m, and the simulated exchange says +.
  sim::Random random{"sign of (000-14)"};
  const Scene scene{30, 3e-4L, 1.1e-3L, -20e-6L, 20e-6L};
  const Real error = mean_errors<double>(scene, random).symmetric;
  const Real printed = (scene.reply_a - scene.reply_b) * (scene.rate_a - scene.rate_b) / 4 * kAir;
  CHECK(std::abs(error + printed) < 1e-3L);
  CHECK(std::abs(error - printed) > 4.7L);
}

TEST_CASE("Ranging in plain float is off by millimetres to centimetres; this is not") {
  // The vendor example's way: raw intervals as floats, multiplied and subtracted.
  sim::Random random{"plain float"};
  for (const Real reply : {0.65e-3L, 5e-3L}) {
    Real naive_square = 0;
    Real own_square = 0;
    constexpr int count = 2000;
    for (int i = 0; i < count; ++i) {
      Scene scene{uniform(random, 1, 50), reply, reply, 10e-6L, -5e-6L};
      scene.reply_b += uniform(random, 0, 1e-5);
      const DsTwrStamps s = random_stamps(scene, random);
      const RealIntervals d = intervals(s);
      const auto ra = static_cast<float>(d.round_a);
      const auto rb = static_cast<float>(d.round_b);
      const auto da = static_cast<float>(d.reply_a);
      const auto db = static_cast<float>(d.reply_b);
      const float naive = (ra * rb - da * db) / (ra + rb + da + db);
      const Real naive_error = real(naive) * kTick * kAir - d.asymmetric();
      const Real own_error = real(ds_twr_range<float>(s).value().value) - d.asymmetric();
      naive_square += naive_error * naive_error;
      own_square += own_error * own_error;
    }
    // Float products of 0.65 ms and 5 ms leave 24 of 51 and 57 bits.
    CHECK(std::sqrt(naive_square / count) > (reply < 1e-3L ? 3e-3L : 20e-3L));
    CHECK(std::sqrt(own_square / count) < kTenthOfAMillimetre / 10);
  }
}

}  // namespace

}  // namespace tests::ranging_twr_accuracy
