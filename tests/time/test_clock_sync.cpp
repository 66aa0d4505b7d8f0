// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/sim/noise.hpp>
#include <uwbpos/time/clock_sync.hpp>

#include "../support/statistics.hpp"
#include "sync_bench.hpp"

namespace tests::time_clock_sync {

namespace {

using namespace uwbpos;
using test::feed;
using test::SyncBench;
using test::SyncFrame;

constexpr double kTick = kTickSeconds<double>;

template <class S>
Error refused(ClockSync<S>& sync, const SyncBench& bench, const SyncFrame& frame) {
  const auto rate = feed(sync, bench, frame);
  REQUIRE_FALSE(rate);
  return rate.error();
}

// A tracker that has seen `frames` frames, a tenth of a second apart.
template <class S>
ClockSync<S> tracking(SyncBench& bench, int frames, const ClockSyncOptions<S>& options = {}) {
  ClockSync<S> sync{options};
  for (int i = 0; i < frames; ++i) {
    bench.wait(0.1);
    static_cast<void>(feed(sync, bench, bench.frame()));
  }
  return sync;
}

// How far the conversion of the anchor's time of now is off [s], and its variance.
template <class S>
Result<Measured<double>> conversion(const ClockSync<S>& sync, SyncBench& bench) {
  double left = 0;
  const DeviceTime<> stamp = bench.exact_stamp(left);
  const auto time = sync.to_control(stamp, bench.host());
  if (!time) return std::unexpected(time.error());
  return Measured<double>{bench.error(*time, bench.now) + left * kTick,
                          static_cast<double>(time->variance)};
}

// Clocks within ±20 ppm.
void draw_rates(SyncBench& bench) {
  bench.control.rate = bench.random.uniform(-20e-6, 20e-6);
  bench.anchor.rate = bench.random.uniform(-20e-6, 20e-6);
}

TEST_CASE_TEMPLATE("Clocks that do not walk, seen without noise, are known to a tick", S, float,
                   double) {
  for (const double period : {0.001, 0.1, 1.0, 4.9}) {
    SyncBench bench{"no noise"};
    bench.control.rate_walk = bench.anchor.rate_walk = 0;
    bench.sigma = 0;
    bench.host_latency = 0;
    ClockSync<S> sync;
    for (int i = 0; i < 100; ++i) {
      bench.wait(period);
      const auto rate = feed(sync, bench, bench.frame());
      if (i == 0) {
        CHECK(rate.error() == Error::NotYetTracked);
        continue;
      }
      REQUIRE(rate);
      // Two stamps rounded by half a tick each; float keeps 24 bits of the rate itself.
      CHECK(std::abs(static_cast<double>(rate->value) - bench.delta()) < kTick / period + 3e-12);
      const auto error = conversion(sync, bench);
      REQUIRE(error);
      CHECK(std::abs(error->value) < kTick);
    }
  }
}

TEST_CASE_TEMPLATE("The variance of a conversion is that of its error", S, float, double) {
  // q of the options is that of both clocks together.
  for (const double walk : {0.1e-9, 1e-9, 5e-9}) {
    std::vector<double> squares;
    for (int run = 0; run < 2000; ++run) {
      SyncBench bench{"nees " + std::to_string(run)};
      draw_rates(bench);
      bench.control.rate_walk = bench.anchor.rate_walk = walk;
      ClockSyncOptions<S> options;
      options.wander = static_cast<S>(walk * std::sqrt(2.0));
      ClockSync<S> sync{options};
      for (int i = 0; i < 40; ++i) {
        bench.wait(0.1);
        if (!bench.random.chance(0.1)) static_cast<void>(feed(sync, bench, bench.frame()));
      }
      bench.wait(bench.random.uniform(0, 0.1));
      const auto error = conversion(sync, bench);
      REQUIRE(error);
      squares.push_back(error->value * error->value / error->variance);
    }
    // One independent value a run.
    CHECK(test::mean_nees_interval(1, squares.size(), 0.999).contains(test::mean(squares)));
  }
}

TEST_CASE_TEMPLATE("A few frames are as honest as many, at any period", S, float, double) {
  for (const double period : {0.01, 1.0}) {
    for (const int frames : {2, 3, 5}) {
      std::vector<double> squares;
      for (int run = 0; run < 2000; ++run) {
        SyncBench bench{"few frames " + std::to_string(run)};
        draw_rates(bench);
        bench.control.rate_walk = bench.anchor.rate_walk = 1e-9;
        ClockSyncOptions<S> options;
        options.wander = static_cast<S>(1e-9 * std::sqrt(2.0));
        ClockSync<S> sync{options};
        for (int i = 0; i < frames; ++i) {
          bench.wait(period);
          static_cast<void>(feed(sync, bench, bench.frame()));
        }
        bench.wait(period / 2);
        const auto error = conversion(sync, bench);
        REQUIRE(error);
        squares.push_back(error->value * error->value / error->variance);
      }
      CHECK(test::mean_nees_interval(1, squares.size(), 0.999).contains(test::mean(squares)));
    }
  }
}

TEST_CASE_TEMPLATE("A wrong wander shows in the normalised errors", S, float, double) {
  std::vector<double> squares;
  for (int run = 0; run < 300; ++run) {
    SyncBench bench{"wrong wander " + std::to_string(run)};
    bench.control.rate_walk = bench.anchor.rate_walk = 1e-9;
    ClockSyncOptions<S> options;
    options.wander = S(0.1e-9);
    ClockSync<S> sync = tracking(bench, 100, options);
    const auto error = conversion(sync, bench);
    REQUIRE(error);
    squares.push_back(error->value * error->value / error->variance);
  }
  CHECK_FALSE(test::mean_nees_interval(1, squares.size(), 0.999).contains(test::mean(squares)));
}

TEST_CASE_TEMPLATE("A stamp just before the last frame converts as well", S, float, double) {
  std::vector<double> squares;
  for (int run = 0; run < 2000; ++run) {
    SyncBench bench{"before " + std::to_string(run)};
    draw_rates(bench);
    ClockSyncOptions<S> options;
    options.wander = S(0.1414e-9);
    ClockSync<S> sync = tracking(bench, 40, options);
    bench.wait(0.07);
    double left = 0;
    const DeviceTime<> stamp = bench.exact_stamp(left);
    const SyncBench then = bench;
    const std::int64_t host = bench.host();
    bench.wait(0.03);
    REQUIRE(feed(sync, bench, bench.frame()));
    const auto time = sync.to_control(stamp, host);
    REQUIRE(time);
    const double error = then.error(*time, then.now) + left * kTick;
    squares.push_back(error * error / static_cast<double>(time->variance));
  }
  // At this wander, what it adds in 0.03 s is nothing, and the formula is exact.
  CHECK(test::mean_nees_interval(1, squares.size(), 0.999).contains(test::mean(squares)));
}

TEST_CASE("Float and double convert alike to a tenth of a millimetre of light path") {
  SyncBench bench{"float and double"};
  bench.control.rate = 20e-6;
  bench.anchor.rate = -20e-6;
  ClockSync<float> single;
  ClockSync<double> precise;
  for (int i = 0; i < 3000; ++i) {
    bench.wait(bench.random.uniform(0.02, 0.5));
    const SyncFrame frame = bench.frame();
    const auto a = feed(single, bench, frame);
    const auto b = feed(precise, bench, frame);
    REQUIRE(a.has_value() == b.has_value());
    double left = 0;
    bench.wait(bench.random.uniform(0, 0.1));
    const DeviceTime<> stamp = bench.exact_stamp(left);
    const auto x = single.to_control(stamp, frame.host);
    const auto y = precise.to_control(stamp, frame.host);
    REQUIRE(x.has_value() == y.has_value());
    if (!x) continue;
    const double apart =
        static_cast<double>(x->ticks - y->ticks) + static_cast<double>(x->fraction) - y->fraction;
    CHECK(std::abs(apart) * kTick * kSpeedOfLightAir<double> < 1e-4);
    CHECK(static_cast<double>(x->variance) == doctest::Approx(y->variance).epsilon(1e-3));
  }
}

TEST_CASE("A long gap after short ones leaves float's variances as they are in double") {
  // The rate's variance falls by 1e-7 in one step: subtracted, as textbooks have it, nothing but
  // rounding would be left of it in float, or less than nothing.
  SyncBench bench{"short, then long"};
  bench.host_latency = 0;
  ClockSyncOptions<float> rough;
  rough.wander = 0;
  ClockSyncOptions<double> fine;
  fine.wander = 0;
  ClockSync<float> single{rough};
  ClockSync<double> precise{fine};
  for (const double gap : {0.1, 0.001, 0.001, 4.0, 0.001, 4.5, 4.9}) {
    bench.wait(gap);
    const SyncFrame frame = bench.frame();
    const auto a = feed(single, bench, frame);
    const auto b = feed(precise, bench, frame);
    REQUIRE(a.has_value() == b.has_value());
    if (!a) continue;
    CHECK(static_cast<double>(a->variance) == doctest::Approx(b->variance).epsilon(1e-5));
  }
}

TEST_CASE_TEMPLATE("Counters that wrap between frames, either or both, cost nothing", S, float,
                   double) {
  for (const std::uint64_t control : {0ULL, 5ULL, 1ULL << 39, (1ULL << 40) - 1}) {
    for (const std::uint64_t anchor : {0ULL, 5ULL, 1ULL << 39, (1ULL << 40) - 1}) {
      SyncBench bench{"wraps"};
      bench.control.reading.ticks = static_cast<std::int64_t>(control) - 30'000'000'000;
      bench.anchor.reading.ticks = static_cast<std::int64_t>(anchor) - 30'000'000'000;
      ClockSync<S> sync;
      for (int i = 0; i < 400; ++i) {  // 40 s, two wraps and more
        bench.wait(0.1);
        const auto rate = feed(sync, bench, bench.frame());
        REQUIRE(rate.has_value() == (i > 0));
        if (i < 20) continue;
        const auto error = conversion(sync, bench);
        REQUIRE(error);
        CHECK(std::abs(error->value) < 6 * std::sqrt(error->variance) + kTick);
      }
    }
  }
}

TEST_CASE_TEMPLATE("Lost frames widen the variance and nothing else", S, float, double) {
  SyncBench bench{"lost frames"};
  ClockSync<S> sync = tracking<S>(bench, 50);
  double last = 0;
  for (int lost = 0; lost < 9; ++lost) {
    bench.wait(0.1);
    const auto error = conversion(sync, bench);
    REQUIRE(error);
    CHECK(error->variance > last);
    CHECK(error->value * error->value < 36 * error->variance);
    last = error->variance;
  }
  bench.wait(2.5);
  CHECK(conversion(sync, bench).error() == Error::TooOld);
  CHECK(feed(sync, bench, bench.frame()).has_value());
  CHECK(conversion(sync, bench).has_value());
}

TEST_CASE_TEMPLATE("A gap too long starts afresh, also where counters hide it", S, float, double) {
  // 17.2 s and a little look like a little to the counters.
  for (const double gap : {5.1, 8.6, 17.25, 34.5, 3600.0}) {
    SyncBench bench{"long gaps"};
    ClockSync<S> sync = tracking<S>(bench, 20);
    bench.wait(gap);
    CHECK(conversion(sync, bench).error() == Error::TooOld);
    CHECK(refused(sync, bench, bench.frame()) == Error::GapTooLong);
    CHECK(conversion(sync, bench).error() == Error::NotYetTracked);
    CHECK(sync.rate().error() == Error::NotYetTracked);
    bench.wait(0.1);
    REQUIRE(feed(sync, bench, bench.frame()));
    const auto error = conversion(sync, bench);
    REQUIRE(error);
    CHECK(error->value * error->value < 36 * error->variance + kTick * kTick);
  }
}

TEST_CASE_TEMPLATE("A stamp older than a wrap is refused by the host's time", S, float, double) {
  SyncBench bench{"older than a wrap"};
  const ClockSync<S> sync = tracking<S>(bench, 20);
  double left = 0;
  const DeviceTime<> stamp = bench.exact_stamp(left);
  const std::int64_t host = bench.host();
  CHECK(sync.to_control(stamp, host).has_value());
  CHECK(sync.to_control(stamp, host - 17'207'000).error() == Error::TooOld);
  CHECK(sync.to_control(stamp, host + 17'207'000).error() == Error::TooOld);
  CHECK(sync.to_control(stamp, std::numeric_limits<std::int64_t>::min()).error() == Error::TooOld);
  CHECK(sync.to_control(stamp, std::numeric_limits<std::int64_t>::max()).error() == Error::TooOld);
  CHECK(sync.to_control(stamp - 64'000'000'000, host).error() == Error::TooOld);
  CHECK(sync.to_control(stamp + 64'000'000'000, host).error() == Error::TooOld);
}

TEST_CASE_TEMPLATE(
    "A restarted clock is told at once, is converted by no more, and costs one frame", S, float,
    double) {
  for (const bool of_anchor : {true, false}) {
    for (const std::int64_t jump : {100'000LL, -100'000LL, 1LL << 38, -(1LL << 38), 1LL << 39}) {
      SyncBench bench{"restarts"};
      ClockSync<S> sync = tracking<S>(bench, 50);
      const double rate = static_cast<double>(sync.rate().value().value);
      (of_anchor ? bench.anchor : bench.control).reading.ticks += jump;
      bench.wait(0.1);
      CHECK(refused(sync, bench, bench.frame()) == Error::ClockJump);
      CHECK(conversion(sync, bench).error() == Error::ClockJump);
      bench.wait(0.1);
      const auto after = feed(sync, bench, bench.frame());
      REQUIRE(after);
      // The rate is kept, and with it what is known of it: a new one of two frames is off by
      // 2 ppb.
      CHECK(std::abs(static_cast<double>(after->value) - rate) < 1e-12);
      const auto error = conversion(sync, bench);
      REQUIRE(error);
      CHECK(error->value * error->value < 25 * error->variance);
      CHECK(error->variance < 1.01 * 0.15e-9 * 0.15e-9 + kTick * kTick / 12);
    }
  }
}

TEST_CASE_TEMPLATE("One bad frame of any size is not used and costs no conversion after it", S,
                   float, double) {
  for (const double late : {3e-9, -3e-9, 30e-9, 0.9e-6, 1.1e-6, 1e-3, 1.0}) {
    SyncBench bench{"outliers"};
    ClockSync<S> sync = tracking<S>(bench, 50);
    bench.wait(0.1);
    const bool far = std::abs(late) > 1e-6;
    CHECK(refused(sync, bench, bench.frame(late)) ==
          (far ? Error::ClockJump : Error::OutlierRejected));
    // While a jump is possible nothing is said; an echo cannot silence the anchor.
    CHECK(conversion(sync, bench).has_value() == !far);
    bench.wait(0.1);
    CHECK(feed(sync, bench, bench.frame()).has_value());
    const auto error = conversion(sync, bench);
    REQUIRE(error);
    CHECK(error->value * error->value < 25 * error->variance);
  }
}

TEST_CASE_TEMPLATE("Something in the way of the sync frames is coasted through", S, float, double) {
  SyncBench bench{"blocked"};
  ClockSync<S> sync = tracking<S>(bench, 100);
  for (int i = 0; i < 9; ++i) {
    bench.wait(0.1);
    // Two metres: 6.7 ns. The gate of the coasting filter grows to 4.5 ns in 0.9 s.
    CHECK(refused(sync, bench, bench.frame(6.7e-9)) == Error::OutlierRejected);
    const auto error = conversion(sync, bench);
    REQUIRE(error);
    CHECK(error->value * error->value < 16 * error->variance);
  }
  bench.wait(0.1);
  CHECK(feed(sync, bench, bench.frame()).has_value());
}

TEST_CASE_TEMPLATE("The gate cannot lock the tracker out", S, float, double) {
  // A step that is no restart: told after `max_outliers` frames.
  SyncBench bench{"no lock-out"};
  ClockSync<S> sync = tracking<S>(bench, 50);
  bench.anchor.reading.ticks += 6000;  // 94 ns
  for (int i = 0; i < 9; ++i) {
    bench.wait(0.1);
    CHECK(refused(sync, bench, bench.frame()) == Error::OutlierRejected);
  }
  bench.wait(0.1);
  CHECK(refused(sync, bench, bench.frame()) == Error::ClockJump);
  const auto error = conversion(sync, bench);
  REQUIRE(error);
  CHECK(error->value * error->value < 25 * error->variance);
  // Another device under the same name, of another rate.
  bench.anchor.rate += 30e-6;
  bench.anchor.reading.ticks += 123'456'789'012;
  for (int i = 0; i < 3; ++i) {
    bench.wait(0.1);
    CHECK(refused(sync, bench, bench.frame()) == Error::ClockJump);
  }
  CHECK(sync.rate().error() == Error::NotYetTracked);
  bench.wait(0.1);
  CHECK(feed(sync, bench, bench.frame()).has_value());
  // Echoes that are never alike.
  for (int i = 0; i < 20; ++i) {
    bench.wait(0.1);
    static_cast<void>(feed(sync, bench, bench.frame()));
  }
  for (int i = 0; i < 10; ++i) {
    bench.wait(0.1);
    CHECK(refused(sync, bench, bench.frame((100 + 37 * (i % 3)) * 1e-9)) ==
          (i < 9 ? Error::OutlierRejected : Error::ClockJump));
  }
  CHECK(sync.rate().error() == Error::NotYetTracked);
}

TEST_CASE_TEMPLATE("A bad first frame is forgotten", S, float, double) {
  for (const double late : {50e-9, 500e-9}) {
    SyncBench bench{"bad start"};
    ClockSync<S> sync;
    bench.wait(0.1);
    CHECK(refused(sync, bench, bench.frame(late)) == Error::NotYetTracked);
    for (int i = 0; i < 30; ++i) {
      bench.wait(0.1);
      static_cast<void>(feed(sync, bench, bench.frame()));
    }
    const auto error = conversion(sync, bench);
    REQUIRE(error);
    CHECK(error->value * error->value < 25 * error->variance);
  }
}

TEST_CASE_TEMPLATE("Late and repeated frames are ignored; a host set back starts afresh", S, float,
                   double) {
  SyncBench bench{"order"};
  bench.host_latency = 0;
  ClockSync<S> sync = tracking<S>(bench, 20);
  bench.wait(0.1);
  const SyncFrame first = bench.frame();
  bench.wait(0.1);
  SyncFrame last = bench.frame();
  REQUIRE(feed(sync, bench, last));
  const auto before = sync.rate().value();
  CHECK(refused(sync, bench, last) == Error::TimeNotIncreasing);
  CHECK(refused(sync, bench, first) == Error::TimeNotIncreasing);
  // The same, handed in late.
  SyncFrame late = first;
  late.host = last.host + 1000;
  CHECK(refused(sync, bench, late) == Error::TimeNotIncreasing);
  late = last;
  late.host += 1000;
  CHECK(refused(sync, bench, late) == Error::TimeNotIncreasing);
  CHECK(sync.rate().value().value == before.value);
  CHECK(sync.rate().value().variance == before.variance);
  bench.wait(0.1);
  CHECK(feed(sync, bench, bench.frame()).has_value());
  bench.wait(0.1);
  SyncFrame back = bench.frame();
  back.host -= 3'600'000'000;
  CHECK(refused(sync, bench, back) == Error::TimeNotIncreasing);
  CHECK(sync.rate().error() == Error::NotYetTracked);
  bench.wait(0.1);
  SyncFrame next = bench.frame();
  next.host -= 3'600'000'000;
  CHECK(feed(sync, bench, next).has_value());
}

TEST_CASE_TEMPLATE("A second frame that is the first again gives no rate", S, float, double) {
  SyncBench bench{"twice"};
  ClockSync<S> sync;
  bench.wait(0.1);
  SyncFrame frame = bench.frame();
  CHECK(refused(sync, bench, frame) == Error::NotYetTracked);
  frame.host += 100;
  CHECK(refused(sync, bench, frame) == Error::TimeNotIncreasing);
  CHECK(sync.rate().error() == Error::NotYetTracked);
}

TEST_CASE_TEMPLATE("Clocks further apart than the bound are refused", S, float, double) {
  SyncBench bench{"out of bounds"};
  bench.control.rate = 60e-6;
  bench.anchor.rate = -60e-6;
  ClockSync<S> sync;
  for (int i = 0; i < 5; ++i) {
    bench.wait(0.1);
    CHECK(refused(sync, bench, bench.frame()) ==
          (i == 0 ? Error::NotYetTracked : Error::ClockOffsetOutOfBounds));
  }
  // A rate that walks out of it.
  ClockSyncOptions<S> options;
  options.max_clock_offset = S(21.001e-6);
  SyncBench warm{"walks out"};
  ClockSync<S> follower = tracking<S>(warm, 50, options);
  REQUIRE(follower.rate());
  Error last = Error::NotFinite;
  for (int i = 0; i < 50 && last != Error::ClockOffsetOutOfBounds; ++i) {
    warm.control.rate += 0.2e-9;
    warm.wait(0.1);
    const auto rate = feed(follower, warm, warm.frame());
    if (!rate) last = rate.error();
  }
  CHECK(last == Error::ClockOffsetOutOfBounds);
  CHECK(follower.rate().error() == Error::NotYetTracked);
}

TEST_CASE_TEMPLATE("NaN and options outside their domain pass no gate", S, float, double) {
  constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  constexpr S infinity = std::numeric_limits<S>::infinity();
  using Options = ClockSyncOptions<S>;
  const auto refuses = [](const Options& options) {
    ClockSync<S> sync{options};
    CHECK(sync.update(DeviceTime<>{0}, DeviceTime<>{0}, S(0), 0).error() == Error::InvalidOption);
  };
  for (S Options::* const member : {&Options::sigma_timestamp, &Options::wander,
                                    &Options::max_clock_offset, &Options::max_excess}) {
    for (const S bad : {nan, infinity, -infinity, S(-1e-9), S(2)}) {
      Options options;
      options.*member = bad;
      refuses(options);
    }
  }
  for (std::int64_t Options::* const member : {&Options::max_gap, &Options::max_age}) {
    for (const std::int64_t bad : {std::int64_t{0}, std::int64_t{-1}, std::int64_t{8'000'001}}) {
      Options options;
      options.*member = bad;
      refuses(options);
    }
  }
  Options options;
  options.reorder_window = -1;
  refuses(options);
  for (const int bad : {-1, 1, 1001}) {
    options = {};
    options.max_outliers = bad;
    refuses(options);
  }

  SyncBench bench{"nan"};
  ClockSync<S> sync = tracking<S>(bench, 20);
  const auto before = sync.rate().value();
  bench.wait(0.1);
  const SyncFrame frame = bench.frame();
  const auto with = [&](S flight) {
    return sync.update(frame.control_tx, frame.anchor_rx, flight, frame.host).error();
  };
  CHECK(with(nan) == Error::NotFinite);
  CHECK(with(infinity) == Error::NotFinite);
  CHECK(with(S(2e-3)) == Error::RangeBeyondMaximum);
  CHECK(with(S(-2e-3)) == Error::RangeBeyondMaximum);
  CHECK(sync.rate().value().value == before.value);
  CHECK(feed(sync, bench, frame).has_value());
}

TEST_CASE_TEMPLATE("Any stamps at any host time are an answer or an error", S, float, double) {
  sim::Random random{"anything"};
  for (int run = 0; run < 300; ++run) {
    ClockSyncOptions<S> options;
    if (run % 2 == 1) options.sigma_timestamp = S(1e-3);
    if (run % 3 == 1) options.wander = S(1e-6);
    ClockSync<S> sync{options};
    std::uint64_t control = random.bits();
    std::uint64_t anchor = random.bits();
    std::int64_t host = static_cast<std::int64_t>(random.bits() >> 1);
    for (int i = 0; i < 200; ++i) {
      // Small steps, large ones, and any.
      const int kind = random.integer(0, 4);
      const std::uint64_t step = random.bits() >> (kind == 0 ? 0 : random.integer(20, 63));
      anchor += step;
      control += kind < 4 ? step : random.bits();
      host = static_cast<std::int64_t>(static_cast<std::uint64_t>(host) +
                                       (kind == 3 ? random.bits() : 1 + step / 63'898));
      const auto rate = sync.update(DeviceTime<>{control}, DeviceTime<>{anchor},
                                    static_cast<S>(random.uniform(-1e-3, 1e-3)), host);
      if (rate) {
        CHECK(std::isfinite(rate->value));
        CHECK(rate->variance > 0);
      }
      const auto time = sync.to_control(DeviceTime<>{anchor + (random.bits() >> 30)}, host);
      if (time) {
        CHECK(std::isfinite(time->fraction));
        CHECK(time->variance > 0);
      }
    }
  }
}

TEST_CASE_TEMPLATE("Reset forgets all but the options", S, float, double) {
  SyncBench bench{"reset"};
  ClockSyncOptions<S> options;
  options.max_clock_offset = S(1e-6);
  ClockSync<S> sync{options};
  bench.wait(0.1);
  CHECK(refused(sync, bench, bench.frame()) == Error::NotYetTracked);
  sync.reset();
  bench.wait(0.1);
  CHECK(refused(sync, bench, bench.frame()) == Error::NotYetTracked);
  bench.wait(0.1);
  CHECK(refused(sync, bench, bench.frame()) == Error::ClockOffsetOutOfBounds);
}

}  // namespace

}  // namespace tests::time_clock_sync
