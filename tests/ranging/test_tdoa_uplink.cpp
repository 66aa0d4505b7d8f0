// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/ranging/tdoa_uplink.hpp>
#include <uwbpos/sim/hall.hpp>
#include <uwbpos/sim/uplink.hpp>

#include "../support/statistics.hpp"
#include "../time/sync_bench.hpp"

namespace tests::ranging_tdoa_uplink {

namespace {

using namespace uwbpos;

constexpr double kSpeed = kSpeedOfLightAir<double>;
constexpr double kTick = kTickSeconds<double>;
// What perfect synchronisation would give: two noisy stamps, each rounded to a tick.
const double kPerfect = kSpeed * std::sqrt(2 * (0.15e-9 * 0.15e-9 + kTick * kTick / 12));

// One subnet of eight anchors and a tag that stands in various places.
sim::UplinkScenario hall(std::uint64_t seed, double walk) {
  sim::UplinkScenario scenario;
  const auto anchors = sim::hang_anchors({.width = 30, .depth = 20, .second_height = 5}, 8,
                                         sim::Placement::Perimeter);
  REQUIRE(anchors);
  const auto subnet = sim::make_subnet(*anchors, 1);
  REQUIRE(subnet);
  REQUIRE(sim::add(scenario.site, *subnet));
  sim::Random random{seed, "places"};
  auto stops = sim::random_stops({1, 1, 1}, {29, 19, 2}, 50, random);
  REQUIRE(stops);
  stops->dwell = 2;
  scenario.site.path = *stops;
  scenario.site.radio = {
      .max_rate = 20e-6, .rate_walk = walk, .sigma_rx = 0.15e-9, .tx_grid = 512, .loss = 0.1};
  scenario.site.start = {1000, 0.5};
  scenario.site.seed = seed;
  scenario.blink_rate = 13;  // not in step with the frames
  return scenario;
}

double flight(const sim::Subnet& subnet, int anchor) {
  return (subnet.anchors[anchor].position - subnet.anchors[subnet.control].position).norm() /
         kSpeed;
}

// The trackers of one subnet.
template <class S>
struct Chain {
  std::array<ClockSync<S>, sim::kMaxSubnetAnchors> syncs{};
  TdoaUplinkOptions<S> options{};

  explicit Chain(const ClockSyncOptions<S>& sync_options) {
    for (auto& sync : syncs) sync = ClockSync<S>{sync_options};
  }

  void feed(const sim::Subnet& subnet, const sim::SyncFrame& frame) {
    for (int anchor = 0; anchor < subnet.anchors.size(); ++anchor) {
      const auto i = static_cast<std::size_t>(anchor);
      if (!frame.receptions[i].received) continue;
      static_cast<void>(syncs[i].update(frame.tx, frame.receptions[i].rx,
                                        static_cast<S>(flight(subnet, anchor)), frame.host));
    }
  }

  [[nodiscard]] Result<UplinkDifference<S>> difference(const sim::Subnet& subnet,
                                                       const sim::Blink& blink, int anchor) const {
    const auto& receptions = blink.receptions[0];
    const auto i = static_cast<std::size_t>(anchor);
    const auto zero =
        control_arrival<S>(receptions[static_cast<std::size_t>(subnet.control)].rx, S(0), options);
    const auto one = anchor_arrival<S>(syncs[i], receptions[i].rx, blink.host, S(0), options);
    if (!one) return std::unexpected(one.error());
    return tdoa_uplink_difference(*zero, *one, options);
  }
};

struct Scores {
  std::vector<double> errors;   // [m]
  std::vector<double> squares;  // normalised
  double worst_float = 0;       // float against double [m]
  int refused = 0;
};

Scores run_chain(const sim::UplinkScenario& scenario, double wander) {
  ClockSyncOptions<double> options;
  options.wander = wander;
  ClockSyncOptions<float> single;
  single.wander = static_cast<float>(wander);
  Chain<double> precise{options};
  Chain<float> rough{single};
  auto run = sim::UplinkSimulation::start(scenario);
  REQUIRE(run);
  const sim::Subnet& subnet = scenario.site.subnets[0];
  Scores scores;
  while (const auto event = run->next()) {
    if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) {
      precise.feed(subnet, *frame);
      rough.feed(subnet, *frame);
      continue;
    }
    const auto& blink = std::get<sim::Blink>(*event);
    if (blink.sequence < 26) continue;  // two seconds to settle
    const auto& receptions = blink.receptions[0];
    const auto& control = receptions[static_cast<std::size_t>(subnet.control)];
    if (!control.received) continue;
    for (int anchor = 0; anchor < subnet.anchors.size(); ++anchor) {
      const auto& reception = receptions[static_cast<std::size_t>(anchor)];
      if (anchor == subnet.control || !reception.received) continue;
      const auto a = precise.difference(subnet, blink, anchor);
      const auto b = rough.difference(subnet, blink, anchor);
      REQUIRE(a.has_value() == b.has_value());
      if (!a) {
        ++scores.refused;
        continue;
      }
      const double truth = reception.distance - control.distance;
      const double error = a->value - truth;
      scores.errors.push_back(error);
      scores.squares.push_back(error * error / a->variance);
      scores.worst_float =
          std::max(scores.worst_float, std::abs(static_cast<double>(b->value) - a->value));
      CHECK(static_cast<double>(b->variance) == doctest::Approx(a->variance).epsilon(1e-3));
    }
  }
  return scores;
}

TEST_CASE("Differences are no worse than 1.25 times what perfect synchronisation would give") {
  std::vector<double> matched;
  std::vector<double> standard;
  std::vector<double> squares;
  double worst_float = 0;
  int refused = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    // Both clocks walk: √2 of one.
    const auto scenario = hall(seed, 0.1e-9);
    const Scores told = run_chain(scenario, 0.1e-9 * std::sqrt(2.0));
    const Scores untold = run_chain(scenario, ClockSyncOptions<double>{}.wander);
    matched.insert(matched.end(), told.errors.begin(), told.errors.end());
    standard.insert(standard.end(), untold.errors.begin(), untold.errors.end());
    squares.insert(squares.end(), told.squares.begin(), told.squares.end());
    worst_float = std::max({worst_float, told.worst_float, untold.worst_float});
    refused += told.refused + untold.refused;
  }
  const double ratio = test::root_mean_square(matched) / kPerfect;
  const double standard_ratio = test::root_mean_square(standard) / kPerfect;
  MESSAGE("rms over perfect: ", ratio, " matched, ", standard_ratio, " default wander; mean NEES ",
          test::mean(squares), "; float against double at most ", worst_float * 1e3, " mm");
  CHECK(matched.size() > 50'000);
  CHECK(ratio < 1.25);
  CHECK(standard_ratio < 1.25);
  CHECK(worst_float < 1e-3);
  CHECK(refused == 0);
  // The chain: what the variance promises is what there is. Differences of a blink share the
  // reference and successive ones the trackers: seven differences count as two, a hundred seconds
  // as so many blinks. Some 2500 × 8 values, of which a quarter are independent: ± 4 %.
  CHECK(std::abs(test::mean(squares) - 1) < 0.04);
  CHECK(std::abs(test::mean(matched)) < 0.002);
}

TEST_CASE("Clocks that walk as crystals do are synchronised as well as their walk allows") {
  for (const double walk : {1e-9, 5e-9}) {
    const Scores scores = run_chain(hall(21, walk), walk * std::sqrt(2.0));
    MESSAGE("walk ", walk, ": rms over perfect ", test::root_mean_square(scores.errors) / kPerfect);
    CHECK(std::abs(test::mean(scores.squares) - 1) < 0.1);
    CHECK(scores.worst_float < 1e-3);
    CHECK(test::root_mean_square(scores.errors) < 1.7 * kPerfect);
  }
}

TEST_CASE("The shared part of the variance is the covariance of two differences") {
  const auto scenario = hall(5, 0.1e-9);
  auto run = sim::UplinkSimulation::start(scenario);
  REQUIRE(run);
  const sim::Subnet& subnet = scenario.site.subnets[0];
  ClockSyncOptions<double> options;
  options.wander = 0.1414e-9;
  Chain<double> chain{options};
  std::vector<double> products;
  double shared = 0;
  while (const auto event = run->next()) {
    if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) {
      chain.feed(subnet, *frame);
      continue;
    }
    const auto& blink = std::get<sim::Blink>(*event);
    if (blink.sequence < 26) continue;
    const auto one = chain.difference(subnet, blink, 2);
    const auto two = chain.difference(subnet, blink, 5);
    REQUIRE(one);
    REQUIRE(two);
    const auto& r = blink.receptions[0];
    products.push_back((one->value - (r[2].distance - r[0].distance)) *
                       (two->value - (r[5].distance - r[0].distance)));
    shared = one->shared_variance;
    CHECK(one->shared_variance < one->variance);
    CHECK(one->shared_variance == two->shared_variance);
  }
  CHECK(shared == doctest::Approx(std::pow(0.15e-9 * kSpeed, 2)));
  // 1300 products whose standard deviation is 2.3 of `shared`: ± 6 %, three of which; the
  // trackers' common wander of the control clock adds some.
  CHECK(std::abs(test::mean(products) / shared - 1) < 0.25);
}

TEST_CASE("A blocked tag shows in its differences, and losses only take some away") {
  auto clear = hall(9, 0.1e-9);
  auto blocked = clear;
  blocked.site.blockage = {.probability = 0.3, .mean_duration = 1, .minimum_excess = 1};
  const Scores a = run_chain(clear, 0.1414e-9);
  const Scores b = run_chain(blocked, 0.1414e-9);
  CHECK(test::root_mean_square(b.errors) > 5 * test::root_mean_square(a.errors));
}

TEST_CASE("An anchor that restarts is refused by name until its clock is known again") {
  auto scenario = hall(17, 0.1e-9);
  scenario.site.radio.loss = 0;
  auto run = sim::UplinkSimulation::start(scenario);
  REQUIRE(run);
  const sim::Subnet& subnet = scenario.site.subnets[0];
  Chain<double> chain{{}};
  const int restarted = 5;
  bool done = false;
  int refused = 0;
  int wrong = 0;
  while (const auto event = run->next()) {
    if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) {
      chain.feed(subnet, *frame);
      continue;
    }
    const auto& blink = std::get<sim::Blink>(*event);
    if (blink.sequence < 26) continue;
    for (int anchor = 1; anchor < subnet.anchors.size(); ++anchor) {
      const auto d = chain.difference(subnet, blink, anchor);
      if (!d) {
        CHECK(anchor == restarted);
        // Before the first frame that tells, the stamp alone does.
        CHECK((d.error() == Error::ClockJump || d.error() == Error::TooOld ||
               d.error() == Error::RangeBeyondMaximum));
        ++refused;
        continue;
      }
      const auto& r = blink.receptions[0];
      const double truth = r[static_cast<std::size_t>(anchor)].distance - r[0].distance;
      if (std::abs(d->value - truth) > 6 * std::sqrt(d->variance)) ++wrong;
    }
    if (!done && blink.sequence == 200) {
      run->air().anchor(0, restarted).clock.reading = {.ticks = 1234, .fraction = 0.5};
      done = true;
    }
  }
  CHECK(done);
  // A frame tells, the next settles: two periods of 0.1 s hold three blinks at most.
  CHECK(refused >= 1);
  CHECK(refused <= 3);
  CHECK(wrong == 0);
}

TEST_CASE_TEMPLATE("Exact stamps give the exact difference, with any delay and across wraps", S,
                   float, double) {
  const std::int64_t apart = 4321;
  for (const std::uint64_t ticks : {0ULL, 12345ULL, (1ULL << 40) - 7, 1ULL << 39}) {
    const DeviceTime<> first{ticks};
    const auto zero = control_arrival<S>(first);
    const auto one = control_arrival<S>(first + apart);
    REQUIRE(zero);
    REQUIRE(one);
    const auto difference = tdoa_uplink_difference(*zero, *one);
    REQUIRE(difference);
    // Four roundings of float at 20 m.
    CHECK(static_cast<double>(difference->value) ==
          doctest::Approx(static_cast<double>(apart) * kTick * kSpeed).epsilon(3e-7));
    CHECK(static_cast<double>(difference->variance) ==
          doctest::Approx(2 * std::pow(0.15e-9 * kSpeed, 2)).epsilon(1e-5));
    const auto back = tdoa_uplink_difference(*one, *zero);
    REQUIRE(back);
    CHECK(back->value == -difference->value);

    const auto delayed = control_arrival<S>(first + apart, S(257e-9));
    REQUIRE(delayed);
    const auto shorter = tdoa_uplink_difference(*zero, *delayed);
    REQUIRE(shorter);
    CHECK(static_cast<double>(shorter->value) ==
          doctest::Approx((static_cast<double>(apart) * kTick - 257e-9) * kSpeed).epsilon(1e-5));
  }
}

TEST_CASE_TEMPLATE("Antenna delays given on both sides cancel", S, float, double) {
  auto scenario = hall(31, 0);
  scenario.site.radio.antenna_delay = 515e-9;
  scenario.site.radio.antenna_delay_spread = 1e-9;
  scenario.site.radio.sigma_rx = 0;
  scenario.site.radio.loss = 0;
  auto run = sim::UplinkSimulation::start(scenario);
  REQUIRE(run);
  const sim::Subnet& subnet = scenario.site.subnets[0];
  const int far = 4;
  ClockSync<S> sync;
  const double tx_delay = run->air().anchor(0, subnet.control).antenna_delay / 2;
  const double rx_delay = run->air().anchor(0, far).antenna_delay / 2;
  int seen = 0;
  while (const auto event = run->next()) {
    if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) {
      const double whole = flight(subnet, far) + tx_delay + rx_delay;
      static_cast<void>(
          sync.update(frame->tx, frame->receptions[far].rx, static_cast<S>(whole), frame->host));
      continue;
    }
    const auto& blink = std::get<sim::Blink>(*event);
    if (blink.sequence < 20 || ++seen > 200) continue;
    const auto& r = blink.receptions[0];
    const auto zero = control_arrival<S>(r[static_cast<std::size_t>(subnet.control)].rx,
                                         static_cast<S>(tx_delay));
    const auto one = anchor_arrival<S>(sync, r[far].rx, blink.host, static_cast<S>(rx_delay));
    REQUIRE(zero);
    REQUIRE(one);
    const auto difference = tdoa_uplink_difference(*zero, *one);
    REQUIRE(difference);
    const double truth = r[far].distance - r[static_cast<std::size_t>(subnet.control)].distance;
    // Stamps are rounded to 4.7 mm; 36 m by a clock of 20 ppm are 0.7 mm off.
    CHECK(std::abs(static_cast<double>(difference->value) - truth) < 0.011);
  }
}

TEST_CASE_TEMPLATE("What the synchronisation refuses is passed on by name", S, float, double) {
  test::SyncBench bench{"refusals"};
  ClockSync<S> sync;
  const DeviceTime<> stamp{1000};
  CHECK(anchor_arrival(sync, stamp, 0).error() == Error::NotYetTracked);
  for (int i = 0; i < 20; ++i) {
    bench.wait(0.1);
    static_cast<void>(feed(sync, bench, bench.frame()));
  }
  CHECK(anchor_arrival(sync, bench.stamp_at(bench.now), bench.host()).has_value());
  bench.wait(2);
  CHECK(anchor_arrival(sync, bench.stamp_at(bench.now), bench.host()).error() == Error::TooOld);
  bench.anchor.reading.ticks += 1'000'000'000;
  CHECK(feed(sync, bench, bench.frame()).error() == Error::ClockJump);
  CHECK(anchor_arrival(sync, bench.stamp_at(bench.now), bench.host()).error() == Error::ClockJump);
}

TEST_CASE_TEMPLATE("NaN, options outside their domain and blinks mixed up are refused", S, float,
                   double) {
  constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  constexpr S infinity = std::numeric_limits<S>::infinity();
  using Options = TdoaUplinkOptions<S>;
  const DeviceTime<> stamp{1000};
  const auto good = control_arrival<S>(stamp);
  REQUIRE(good);
  for (S Options::* const member :
       {&Options::sigma_timestamp, &Options::max_difference, &Options::propagation_speed}) {
    for (const S bad : {nan, infinity, -infinity, S(0), S(-1), S(4e8)}) {
      Options options;
      options.*member = bad;
      CHECK(control_arrival<S>(stamp, S(0), options).error() == Error::InvalidOption);
      CHECK(tdoa_uplink_difference(*good, *good, options).error() == Error::InvalidOption);
    }
  }
  CHECK(control_arrival<S>(stamp, nan).error() == Error::NotFinite);
  CHECK(control_arrival<S>(stamp, -infinity).error() == Error::NotFinite);
  CHECK(control_arrival<S>(stamp, S(2e-3)).error() == Error::InvalidOption);
  for (const S bad : {nan, infinity}) {
    ControlTime<S> broken = *good;
    broken.fraction = bad;
    CHECK(tdoa_uplink_difference(*good, broken).error() == Error::NotFinite);
    CHECK(tdoa_uplink_difference(broken, *good).error() == Error::NotFinite);
    broken = *good;
    broken.variance = bad;
    CHECK(tdoa_uplink_difference(*good, broken).error() == Error::NotFinite);
    CHECK(tdoa_uplink_difference(broken, *good).error() == Error::NotFinite);
  }
  // 500 m are 106 564 ticks.
  CHECK(tdoa_uplink_difference(*good, *control_arrival<S>(stamp + 106'500)).has_value());
  CHECK(tdoa_uplink_difference(*good, *control_arrival<S>(stamp + 106'700)).error() ==
        Error::RangeBeyondMaximum);
  CHECK(tdoa_uplink_difference(*control_arrival<S>(stamp + 6'400'000'000), *good).error() ==
        Error::RangeBeyondMaximum);
}

}  // namespace

}  // namespace tests::ranging_tdoa_uplink
