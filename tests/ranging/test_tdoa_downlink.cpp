// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/ranging/tdoa_downlink.hpp>
#include <uwbpos/sim/downlink.hpp>
#include <uwbpos/sim/hall.hpp>
#include <uwbpos/time/rate_tracker.hpp>

#include "../support/statistics.hpp"

namespace tests::ranging_tdoa_downlink {

namespace {

using namespace uwbpos;

constexpr double kSpeed = kSpeedOfLightAir<double>;
constexpr double kTick = kTickSeconds<double>;
// Three noisy stamps, each rounded to a tick.
const double kStamps = kSpeed * std::sqrt(3 * (0.15e-9 * 0.15e-9 + kTick * kTick / 12));

sim::DownlinkScenario hall(std::uint64_t seed, double walk) {
  sim::DownlinkScenario scenario;
  const auto anchors = sim::hang_anchors({.width = 30, .depth = 20, .second_height = 5}, 6,
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
  scenario.site.seed = seed;
  return scenario;
}

double flight(const sim::Subnet& subnet, int a, int b) {
  return (subnet.anchors[a].position - subnet.anchors[b].position).norm() / kSpeed;
}

struct Scores {
  std::vector<double> errors;   // [m]
  std::vector<double> squares;  // normalised
  double worst_float = 0;       // [m]
};

// A tag's trackers of the anchors' rates, and what it heard last of each.
template <class S>
struct Listener {
  std::array<RateTracker<S>, sim::kMaxSubnetAnchors> rates{};

  explicit Listener(double wander) {
    RateTrackerOptions<S> options;
    options.wander = static_cast<S>(wander);
    for (auto& rate : rates) rate = RateTracker<S>{options};
  }

  Result<Measured<S>> difference(const sim::Packet& packet, const sim::Packet& earlier,
                                 double seconds, const TdoaDownlinkOptions<S>& options = {}) {
    const auto rate = rates[static_cast<std::size_t>(packet.anchor)].rate();
    if (!rate) return std::unexpected(rate.error());
    const auto& heard = packet.heard[static_cast<std::size_t>(earlier.anchor)];
    return tdoa_downlink_difference({.a_rx = earlier.tags[0].reception.rx,
                                     .b_rx = packet.tags[0].reception.rx,
                                     .a_rx_at_b = heard.rx,
                                     .b_tx = packet.tx},
                                    *rate, static_cast<S>(seconds), options);
  }

  void hear(const sim::Packet& packet) {
    static_cast<void>(rates[static_cast<std::size_t>(packet.anchor)].update(
        packet.tags[0].reception.rx, packet.tx, packet.host));
  }
};

// `before`: take the difference before the rate has seen the packet.
Scores run_chain(const sim::DownlinkScenario& scenario, double wander, bool before = false) {
  auto run = sim::DownlinkSimulation::start(scenario);
  REQUIRE(run);
  const sim::Subnet& subnet = scenario.site.subnets[0];
  Listener<double> precise{wander};
  Listener<float> rough{wander};
  std::array<std::optional<sim::Packet>, sim::kMaxSubnetAnchors> last{};
  Scores scores;
  while (const auto packet = run->next()) {
    if (!packet->tags[0].reception.received) continue;
    const auto listen = [&] {
      precise.hear(*packet);
      rough.hear(*packet);
    };
    if (!before) listen();
    for (int other = 0; other < subnet.anchors.size(); ++other) {
      const auto& earlier = last[static_cast<std::size_t>(other)];
      const auto& heard = packet->heard[static_cast<std::size_t>(other)];
      if (other == packet->anchor || !earlier || !heard.valid) continue;
      if (heard.sequence != earlier->sequence || packet->sequence < 30) continue;
      const double seconds = flight(subnet, other, packet->anchor);
      const auto a = precise.difference(*packet, *earlier, seconds);
      const auto b = rough.difference(*packet, *earlier, seconds);
      REQUIRE(a.has_value() == b.has_value());
      if (!a) {
        CHECK(a.error() == Error::TooOld);  // a packet of the round before the last
        continue;
      }
      const double truth = packet->tags[0].reception.distance - earlier->tags[0].reception.distance;
      const double error = a->value - truth;
      scores.errors.push_back(error);
      scores.squares.push_back(error * error / a->variance);
      scores.worst_float =
          std::max(scores.worst_float, std::abs(static_cast<double>(b->value) - a->value));
    }
    if (before) listen();
    last[static_cast<std::size_t>(packet->anchor)] = *packet;
  }
  return scores;
}

TEST_CASE("Differences at a listening tag are as good as its stamps, float or double") {
  std::vector<double> errors;
  std::vector<double> squares;
  double worst_float = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    auto scenario = hall(seed, 0.1e-9);
    auto& stops = std::get<sim::Stops>(scenario.site.path);
    stops.dwell = 100;  // stands still: what motion does is another test
    stops.size = 1;
    const Scores scores = run_chain(scenario, 0.1414e-9);
    errors.insert(errors.end(), scores.errors.begin(), scores.errors.end());
    squares.insert(squares.end(), scores.squares.begin(), scores.squares.end());
    worst_float = std::max(worst_float, scores.worst_float);
  }
  const double ratio = test::root_mean_square(errors) / kStamps;
  MESSAGE("rms over that of three stamps: ", ratio, ", mean NEES ", test::mean(squares),
          ", float against double at most ", worst_float * 1e3, " mm");
  CHECK(errors.size() > 8'000);
  // Rates smoothed over seconds add little over intervals of up to a tenth of one.
  CHECK(ratio < 1.15);
  CHECK(ratio > 0.95);
  // The variance is an upper bound: see the header.
  CHECK(test::mean(squares) < 1.05);
  CHECK(test::mean(squares) > 0.8);
  CHECK(worst_float < 1e-3);
  CHECK(std::abs(test::mean(errors)) < 0.005);
}

TEST_CASE("A rate known before the packet is the better for smoothing, one that holds it is not") {
  // 15 ms slots: intervals up to three quarters of a round.
  auto scenario = hall(11, 0.1e-9);
  scenario.slot = 15e-3;
  auto& stops = std::get<sim::Stops>(scenario.site.path);
  stops.dwell = 100;
  stops.size = 1;
  // A wander that believes the last two packets alone, against that of the clocks.
  const auto rms = [&](double wander, bool before) {
    return test::root_mean_square(run_chain(scenario, wander, before).errors) / kStamps;
  };
  const double last_two = rms(100e-9, true);
  const double smoothed = rms(0.1414e-9, true);
  MESSAGE("known before: last two ", last_two, ", smoothed ", smoothed);
  // Twice the square of the interval over the round, a fifth on average, on top of three: some
  // 5 %. Twenty thousand differences know their rms to 0.5 %.
  CHECK(smoothed < 0.97 * last_two);
  CHECK(smoothed < 1.03);
  // With B's two receptions on both sides of A's, the last two interpolate and average noise.
  CHECK(rms(100e-9, false) < rms(0.1414e-9, false));
}

TEST_CASE("A walking tag costs no more than its steps between the two packets") {
  auto scenario = hall(12, 0.1e-9);
  auto route = sim::lawn_mower({2, 2, 1}, {28, 18, 1}, 5);
  REQUIRE(route);
  scenario.site.path = *route;
  const Scores scores = run_chain(scenario, 1e-9);
  // 1 m/s over 90 ms at most, towards one anchor or the other.
  CHECK(test::root_mean_square(scores.errors) < kStamps + 0.09);
}

// Exact stamps: B answers `reply` ticks after it heard A, tag and B run alike.
DownlinkStamps exact(std::uint64_t tag, std::uint64_t b, std::int64_t reply, std::int64_t flight,
                     std::int64_t difference) {
  const DeviceTime<> a_rx{tag};
  const DeviceTime<> heard{b};
  return {.a_rx = a_rx,
          .b_rx = a_rx + (flight + reply + difference),
          .a_rx_at_b = heard,
          .b_tx = heard + reply};
}

TEST_CASE_TEMPLATE("Exact stamps give the exact difference, across wraps too", S, float, double) {
  const Measured<S> rate{S(0), S(0)};
  for (const std::uint64_t ticks : {0ULL, 77ULL, (1ULL << 40) - 1000, 1ULL << 39}) {
    for (const std::int64_t difference : {-2000LL, 0LL, 3LL, 2000LL}) {
      const auto d =
          tdoa_downlink_difference<S>(exact(ticks, ticks + 5, 200'000'000, 4000, difference), rate,
                                      static_cast<S>(4000 * kTick));
      REQUIRE(d);
      // 4000 ticks of flight are 19 m, of which float keeps 2e-6 m.
      CHECK(std::abs(static_cast<double>(d->value) -
                     static_cast<double>(difference) * kTick * kSpeed) < 1e-5);
      CHECK(static_cast<double>(d->variance) ==
            doctest::Approx(3 * std::pow(0.15e-9 * kSpeed, 2)).epsilon(1e-5));
    }
  }
}

TEST_CASE_TEMPLATE("The rate stretches the tag's interval", S, float, double) {
  // B runs 2^-15 = 30.5 ppm faster than the tag: 6103.5 ticks over 200 million.
  const std::int64_t interval = 200'000'000;
  const std::int64_t gained = 6103;
  const DownlinkStamps stamps{.a_rx = DeviceTime<>{5},
                              .b_rx = DeviceTime<>{5 + 200'000'000},
                              .a_rx_at_b = DeviceTime<>{9},
                              .b_tx = DeviceTime<>{9 + 200'000'000}};
  const auto d = tdoa_downlink_difference<S>(stamps, {S(0x1p-15), S(1e-20)}, S(0));
  REQUIRE(d);
  const double exact_ticks = static_cast<double>(interval) * 0x1p-15;
  CHECK(exact_ticks > static_cast<double>(gained));
  CHECK(static_cast<double>(d->value) ==
        doctest::Approx(exact_ticks * kTick * kSpeed).epsilon(1e-6));
  // (3): 3.13 ms at 1e-10.
  const double seconds = static_cast<double>(interval) * kTick;
  CHECK(static_cast<double>(d->variance) ==
        doctest::Approx(kSpeed * kSpeed * (3 * 0.15e-9 * 0.15e-9 + seconds * seconds * 1e-20))
            .epsilon(1e-5));
}

TEST_CASE_TEMPLATE("Antenna delays of A and of the tag cancel, that of B is told", S, float,
                   double) {
  auto scenario = hall(14, 0);
  auto& stops = std::get<sim::Stops>(scenario.site.path);
  stops.dwell = 100;
  stops.size = 1;
  scenario.site.radio.antenna_delay = 515e-9;
  scenario.site.radio.antenna_delay_spread = 2e-9;
  scenario.site.radio.sigma_rx = 0;
  scenario.site.radio.max_rate = 0;
  scenario.site.radio.loss = 0;
  auto run = sim::DownlinkSimulation::start(scenario);
  REQUIRE(run);
  const sim::Subnet& subnet = scenario.site.subnets[0];
  Listener<S> tag{1e-9};
  std::array<std::optional<sim::Packet>, sim::kMaxSubnetAnchors> last{};
  int count = 0;
  while (const auto packet = run->next()) {
    tag.hear(*packet);
    const auto& earlier = last[1];
    if (packet->anchor == 4 && earlier && packet->sequence > 30) {
      TdoaDownlinkOptions<S> options;
      options.antenna_delay_b = static_cast<S>(run->air().anchor(0, 4).antenna_delay);
      const auto d = tag.difference(*packet, *earlier, flight(subnet, 1, 4), options);
      REQUIRE(d);
      const double truth = packet->tags[0].reception.distance - earlier->tags[0].reception.distance;
      // Three stamps rounded to half a tick each: 7 mm, and a rate of rounded ones over 6 ms.
      CHECK(std::abs(static_cast<double>(d->value) - truth) < 0.009);
      ++count;
    }
    last[static_cast<std::size_t>(packet->anchor)] = *packet;
  }
  CHECK(count > 500);
}

TEST_CASE_TEMPLATE("Every refusal has its name", S, float, double) {
  constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  constexpr S infinity = std::numeric_limits<S>::infinity();
  using Options = TdoaDownlinkOptions<S>;
  const Measured<S> rate{S(1e-6), S(1e-18)};
  const S seconds = static_cast<S>(4000 * kTick);
  const DownlinkStamps good = exact(10, 20, 200'000'000, 4000, 100);
  const auto refused = [&](const DownlinkStamps& stamps, Measured<S> known, S tau,
                           const Options& options = {}) {
    const auto d = tdoa_downlink_difference<S>(stamps, known, tau, options);
    REQUIRE_FALSE(d);
    return d.error();
  };
  REQUIRE(tdoa_downlink_difference<S>(good, rate, seconds));
  for (S Options::* const member :
       {&Options::sigma_timestamp, &Options::max_clock_offset, &Options::max_interval,
        &Options::max_difference, &Options::antenna_delay_b, &Options::propagation_speed}) {
    for (const S bad : {nan, infinity, -infinity, S(-1), S(4e8)}) {
      Options options;
      options.*member = bad;
      CHECK(refused(good, rate, seconds, options) == Error::InvalidOption);
    }
  }
  for (const S bad : {nan, infinity, -infinity}) {
    CHECK(refused(good, {bad, S(0)}, seconds) == Error::NotFinite);
    CHECK(refused(good, {S(0), bad}, seconds) == Error::NotFinite);
    CHECK(refused(good, rate, bad) == Error::NotFinite);
  }
  CHECK(refused(good, {S(0), S(-1e-30)}, seconds) == Error::NonPositiveSigma);
  CHECK(refused(good, rate, S(-1e-9)) == Error::NegativeTimeOfFlight);
  CHECK(refused(good, rate, S(1.1e-3)) == Error::RangeBeyondMaximum);
  CHECK(refused(good, {S(81e-6), S(0)}, seconds) == Error::ClockOffsetOutOfBounds);
  CHECK(refused(good, {S(-81e-6), S(0)}, seconds) == Error::ClockOffsetOutOfBounds);

  DownlinkStamps bad = good;
  std::swap(bad.a_rx, bad.b_rx);
  CHECK(refused(bad, rate, seconds) == Error::NonPositiveInterval);
  bad = good;
  std::swap(bad.a_rx_at_b, bad.b_tx);
  CHECK(refused(bad, rate, seconds) == Error::NonPositiveInterval);
  bad = good;
  bad.b_tx = bad.a_rx_at_b;
  CHECK(refused(bad, rate, seconds) == Error::NonPositiveInterval);
  bad = good;
  bad.b_rx = bad.a_rx + DeviceTime<>::kHalfWrap;
  CHECK(refused(bad, rate, seconds) == Error::NonPositiveInterval);
  // A tenth of a second is 6.4e9 ticks.
  CHECK(refused(exact(10, 20, 6'400'000'000, 4000, 100), rate, seconds) == Error::TooOld);
  bad = good;
  bad.b_tx = bad.a_rx_at_b + 6'400'000'000;
  CHECK(refused(bad, rate, seconds) == Error::TooOld);
  CHECK(refused(good, {S(0), std::numeric_limits<S>::max()}, seconds) == Error::NumericOverflow);
  // The stamps of another packet.
  bad = good;
  bad.b_tx = bad.b_tx + 300'000;
  CHECK(refused(bad, rate, seconds) == Error::RangeBeyondMaximum);
}

TEST_CASE_TEMPLATE("Any stamps are an answer or an error", S, float, double) {
  sim::Random random{"any stamps"};
  TdoaDownlinkOptions<S> options;
  options.max_interval = 4;
  options.max_clock_offset = S(0.01);
  int answers = 0;
  for (int i = 0; i < 20000; ++i) {
    const int bits = random.integer(24, 50);
    const DownlinkStamps stamps{.a_rx = DeviceTime<>{random.bits() >> bits},
                                .b_rx = DeviceTime<>{random.bits() >> bits},
                                .a_rx_at_b = DeviceTime<>{random.bits() >> bits},
                                .b_tx = DeviceTime<>{random.bits() >> bits}};
    const auto d =
        tdoa_downlink_difference<S>(stamps, {static_cast<S>(random.uniform(-0.01, 0.01)), S(1e-18)},
                                    static_cast<S>(random.uniform(0, 1e-6)), options);
    if (!d) continue;
    ++answers;
    CHECK(std::abs(d->value) <= 500);
    CHECK(d->variance > 0);
  }
  CHECK(answers > 100);
}

}  // namespace

}  // namespace tests::ranging_tdoa_downlink
