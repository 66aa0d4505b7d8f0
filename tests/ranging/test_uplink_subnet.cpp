// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <variant>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/ranging/uplink_subnet.hpp>
#include <uwbpos/sim/hall.hpp>
#include <uwbpos/sim/uplink.hpp>

#include "../support/statistics.hpp"

namespace tests::ranging_uplink_subnet {

namespace {

using namespace uwbpos;

constexpr std::uint32_t kControl = 4;

// Six anchors, the control anchor in the middle of the ids, a tag that drives.
sim::UplinkScenario hall() {
  sim::UplinkScenario scenario;
  const auto anchors = sim::hang_anchors({.width = 30, .depth = 20, .second_height = 5}, 6,
                                         sim::Placement::Perimeter);
  REQUIRE(anchors);
  REQUIRE(sim::add(scenario.site, sim::make_subnet(*anchors, kControl).value()));
  auto route = sim::lawn_mower({2, 2, 1}, {28, 18, 1}, 4);
  REQUIRE(route);
  scenario.site.path = *route;
  scenario.site.radio = {
      .max_rate = 20e-6, .rate_walk = 0.1e-9, .sigma_rx = 0.15e-9, .tx_grid = 512, .loss = 0.1};
  return scenario;
}

template <class S>
using Net = UplinkSubnet<S, 3, sim::kMaxSubnetAnchors>;

template <class S>
Net<S> net_of(const sim::Subnet& subnet) {
  Anchors<S, 3, sim::kMaxSubnetAnchors> anchors;
  for (const auto& anchor : subnet.anchors) {
    REQUIRE(anchors.add(anchor.id, anchor.position.template cast<S>()));
  }
  // Both clocks walk.
  ClockSyncOptions<S> options;
  options.wander = S(0.1414e-9);
  auto net = Net<S>::make(anchors, kControl, options);
  REQUIRE(net);
  return *net;
}

template <class S>
void feed(Net<S>& net, const sim::Subnet& subnet, const sim::SyncFrame& frame) {
  for (int i = 0; i < subnet.anchors.size(); ++i) {
    const auto& reception = frame.receptions[static_cast<std::size_t>(i)];
    if (!reception.received) continue;
    static_cast<void>(net.sync(subnet.anchors[i].id, frame.tx, reception.rx, frame.host));
  }
}

std::vector<BlinkArrival> arrivals_of(const sim::Subnet& subnet, const sim::Blink& blink) {
  std::vector<BlinkArrival> arrivals;
  for (int i = 0; i < subnet.anchors.size(); ++i) {
    const auto& reception = blink.receptions[0][static_cast<std::size_t>(i)];
    if (reception.received) arrivals.push_back({subnet.anchors[i].id, reception.rx});
  }
  return arrivals;
}

// A run up to a settled blink that every anchor has heard.
template <class S>
struct Settled {
  sim::UplinkScenario scenario = hall();
  Net<S> net = net_of<S>(scenario.site.subnets[0]);
  sim::Blink blink{};
  std::vector<BlinkArrival> arrivals;

  Settled() {
    scenario.site.radio.loss = 0;
    auto run = sim::UplinkSimulation::start(scenario);
    REQUIRE(run);
    while (const auto event = run->next()) {
      if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) {
        feed(net, scenario.site.subnets[0], *frame);
        continue;
      }
      blink = std::get<sim::Blink>(*event);
      if (blink.sequence == 40) break;
    }
    arrivals = arrivals_of(scenario.site.subnets[0], blink);
    REQUIRE(arrivals.size() == 6);
  }
};

TEST_CASE_TEMPLATE("Frames and blinks in, differences out, as good as their sigma says", S, float,
                   double) {
  const auto scenario = hall();
  const sim::Subnet& subnet = scenario.site.subnets[0];
  auto net = net_of<S>(subnet);
  auto run = sim::UplinkSimulation::start(scenario);
  REQUIRE(run);
  std::vector<double> normalised;
  int without_control = 0;
  while (const auto event = run->next()) {
    if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) {
      feed(net, subnet, *frame);
      continue;
    }
    const auto& blink = std::get<sim::Blink>(*event);
    if (blink.sequence < 20) continue;
    const auto arrivals = arrivals_of(subnet, blink);
    if (arrivals.size() < 2) continue;
    const auto found = net.differences(arrivals, blink.host);
    REQUIRE(found);
    CHECK(found->refused == 0);
    CHECK(found->size == static_cast<int>(arrivals.size()) - 1);
    const bool heard = blink.receptions[0][static_cast<std::size_t>(subnet.control)].received;
    CHECK((found->reference_id == kControl) == heard);
    if (!heard) ++without_control;
    const double reference = (found->reference.template cast<double>() - blink.tag).norm();
    for (const auto& entry : found->differences()) {
      const double truth = (entry.anchor.template cast<double>() - blink.tag).norm() - reference;
      normalised.push_back((static_cast<double>(entry.difference) - truth) /
                           (std::sqrt(2.0) * static_cast<double>(found->sigma)));
    }
  }
  CHECK(without_control > 50);
  // A tracker adds a quarter of a stamp's variance. One σ for all gives the control anchor a share
  // of that, so that differences against it are 7 % better than √2σ. 1200 blinks of some 2.5
  // independent differences: ± 2.6 %, thrice.
  const double square = std::pow(test::root_mean_square(normalised), 2);
  CHECK(square > 0.85);
  CHECK(square < 1.01);
  CHECK(std::abs(test::mean(normalised)) < 0.05);
}

TEST_CASE_TEMPLATE("Without the control anchor the best of the others is the reference", S, float,
                   double) {
  Settled<S> run;
  const auto full = run.net.differences(run.arrivals, run.blink.host);
  REQUIRE(full);
  CHECK(full->reference_id == kControl);
  std::erase_if(run.arrivals, [](const BlinkArrival& a) { return a.anchor_id == kControl; });
  const auto less = run.net.differences(run.arrivals, run.blink.host);
  REQUIRE(less);
  CHECK(less->reference_id != kControl);
  CHECK(less->size == 4);
  CHECK(less->sigma > full->sigma);
  // Differences of differences are the same: to float's rounding of 40 m.
  const auto find = [&](const auto& blink, const Vec<S, 3>& anchor) {
    for (const auto& entry : blink.differences()) {
      if (entry.anchor == anchor) return static_cast<double>(entry.difference);
    }
    return 0.0;
  };
  const double shift = find(*full, less->reference);
  for (const auto& entry : less->differences()) {
    CHECK(std::abs(find(*full, entry.anchor) - shift - static_cast<double>(entry.difference)) <
          2e-5);
  }
}

TEST_CASE_TEMPLATE("Arrivals that cannot be used are counted by the way", S, float, double) {
  Settled<S> run;
  auto arrivals = run.arrivals;
  arrivals.push_back({99, DeviceTime<>{0}});
  auto found = run.net.differences(arrivals, run.blink.host);
  REQUIRE(found);
  CHECK(found->size == 5);
  CHECK(found->refused == 1);
  CHECK(found->last_refusal == Error::UnknownAnchor);

  arrivals = run.arrivals;
  arrivals.push_back(arrivals[0]);
  found = run.net.differences(arrivals, run.blink.host);
  REQUIRE(found);
  CHECK(found->size == 5);
  CHECK(found->refused == 1);
  CHECK(found->last_refusal == Error::DuplicateAnchor);

  arrivals = run.arrivals;
  arrivals[0].stamp = arrivals[0].stamp + 1'000'000;  // another blink's
  found = run.net.differences(arrivals, run.blink.host);
  REQUIRE(found);
  CHECK(found->size == 4);
  CHECK(found->refused == 1);
  CHECK(found->last_refusal == Error::RangeBeyondMaximum);

  // Nobody's clock is known any more but the control anchor's.
  CHECK(run.net.differences(run.arrivals, run.blink.host + 9'000'000).error() ==
        Error::TooFewMeasurements);
  CHECK(run.net.arrival(run.arrivals[0], run.blink.host + 9'000'000).error() == Error::TooOld);
  CHECK(run.net.differences({}, run.blink.host).error() == Error::TooFewMeasurements);
  CHECK(run.net.differences(std::span{run.arrivals}.first(1), run.blink.host).error() ==
        Error::TooFewMeasurements);
  arrivals.resize(17);
  CHECK(run.net.differences(arrivals, run.blink.host).error() == Error::TooManyMeasurements);
  // The reference itself of another blink: nothing is left.
  arrivals = {run.arrivals[3], run.arrivals[0]};
  CHECK(arrivals[0].anchor_id == kControl);
  arrivals[0].stamp = arrivals[0].stamp + 1'000'000;
  CHECK(run.net.differences(arrivals, run.blink.host).error() == Error::TooFewMeasurements);
}

TEST_CASE_TEMPLATE("Every refusal has its name", S, float, double) {
  Settled<S> run;
  const auto& anchors = run.net.anchors();
  CHECK(Net<S>::make(anchors, 77).error() == Error::UnknownAnchor);
  ClockSyncOptions<S> sync_options;
  sync_options.wander = std::numeric_limits<S>::quiet_NaN();
  CHECK(Net<S>::make(anchors, kControl, sync_options).error() == Error::InvalidOption);
  TdoaUplinkOptions<S> options;
  options.sigma_timestamp = 0;
  CHECK(Net<S>::make(anchors, kControl, {}, options).error() == Error::InvalidOption);

  const DeviceTime<> zero{0};
  CHECK(run.net.sync(77, zero, zero, 0).error() == Error::UnknownAnchor);
  CHECK(run.net.sync(kControl, zero, zero, 0).error() == Error::DuplicateAnchor);
  CHECK(run.net.sync(1, zero, zero, 0, std::numeric_limits<S>::quiet_NaN()).error() ==
        Error::NotFinite);
  CHECK(run.net.arrival({77, zero}, 0).error() == Error::UnknownAnchor);
  CHECK(run.net.rate(77).error() == Error::UnknownAnchor);
  CHECK(run.net.rate(1).has_value());
  auto fresh = net_of<S>(run.scenario.site.subnets[0]);
  CHECK(fresh.rate(1).error() == Error::NotYetTracked);
  CHECK(fresh.sync(1, zero, zero, 0).error() == Error::NotYetTracked);
  CHECK(fresh.arrival({1, zero}, 0).error() == Error::NotYetTracked);
}

TEST_CASE_TEMPLATE("Delays given to the sync frames are part of the flight", S, float, double) {
  Settled<S> run;
  auto plain = net_of<S>(run.scenario.site.subnets[0]);
  auto late = net_of<S>(run.scenario.site.subnets[0]);
  const std::int64_t flight = 5000;
  for (int i = 0; i < 10; ++i) {
    const DeviceTime<> tx{static_cast<std::uint64_t>(i) * 6'400'000'000};
    static_cast<void>(plain.sync(1, tx, tx + flight, i * 100'000));
    static_cast<void>(late.sync(1, tx, tx + flight, i * 100'000, S(100e-9)));
  }
  const BlinkArrival heard{1, DeviceTime<>{9ULL * 6'400'000'000 + 1'000'000}};
  const auto a = plain.arrival(heard, 900'000);
  const auto b = late.arrival(heard, 900'000);
  REQUIRE(a);
  REQUIRE(b);
  CHECK(static_cast<double>(seconds_between(*a, *b)) == doctest::Approx(100e-9).epsilon(1e-4));
}

}  // namespace

}  // namespace tests::ranging_uplink_subnet
