// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <variant>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/sim/hall.hpp>
#include <uwbpos/sim/uplink.hpp>

#include "../support/statistics.hpp"

namespace tests::sim_uplink {

namespace {

using namespace uwbpos::sim;
using uwbpos::Error;
using uwbpos::Vec;

constexpr double kSpeed = uwbpos::kSpeedOfLightAir<double>;
constexpr double kTick = uwbpos::kTickSeconds<double>;

// Two subnets in a row, a tag on each side of a robot that drives through both.
UplinkScenario two_halls() {
  UplinkScenario scenario;
  for (int i = 0; i < 2; ++i) {
    uwbpos::Anchors<double, 3> anchors;
    const auto hall = hang_anchors({.width = 15, .depth = 10}, 6, Placement::Perimeter);
    REQUIRE(hall);
    for (const auto& anchor : *hall) {
      REQUIRE(anchors.add(anchor.id + static_cast<std::uint32_t>(100 * i),
                          anchor.position + Vec<double, 3>(15.0 * i, 0, 0)));
    }
    const auto subnet = make_subnet(anchors, static_cast<std::uint32_t>(100 * i + 2), 0.5 * i);
    REQUIRE(subnet);
    REQUIRE(add(scenario.site, *subnet));
  }
  Route route;
  REQUIRE(add(route, {2, 5, 0.5}));
  REQUIRE(add(route, {28, 6, 0.5}));
  scenario.site.path = route;
  scenario.site.tags[0] = {.id = 11, .lever = {0, 0.3, 0.4}};
  scenario.site.tags[1] = {.id = 12, .lever = {0, -0.3, 0.4}};
  scenario.site.tag_count = 2;
  scenario.site.start = {500, 0.125};
  return scenario;
}

std::vector<UplinkEvent> all_events(const UplinkScenario& scenario) {
  auto run = UplinkSimulation::start(scenario);
  REQUIRE(run);
  std::vector<UplinkEvent> events;
  while (const auto event = run->next()) events.push_back(*event);
  CHECK_FALSE(run->next());
  return events;
}

Instant time_of(const UplinkEvent& event) {
  return std::visit([](const auto& e) { return e.time; }, event);
}

template <class Event>
std::vector<Event> only(const std::vector<UplinkEvent>& events) {
  std::vector<Event> chosen;
  for (const auto& event : events) {
    if (const auto* e = std::get_if<Event>(&event)) chosen.push_back(*e);
  }
  return chosen;
}

TEST_CASE("Sync frames and blinks come in order of time, each at its rate") {
  auto scenario = two_halls();
  scenario.sync_rate = 10;
  scenario.blink_rate = 4;
  const auto events = all_events(scenario);
  const double lasts = duration(scenario.site.path);
  std::array<std::int64_t, 2> syncs{};
  std::array<std::int64_t, 2> blinks{};
  for (std::size_t i = 0; i < events.size(); ++i) {
    if (i > 0) CHECK(time_of(events[i]) - time_of(events[i - 1]) > 0);
    if (const auto* frame = std::get_if<SyncFrame>(&events[i])) {
      CHECK(frame->sequence == syncs[static_cast<std::size_t>(frame->subnet)]++);
      // Within a grid of 8 ns of when it was due.
      const double due =
          static_cast<double>(frame->sequence) / 10 + 0.05 * static_cast<double>(frame->subnet);
      CHECK(std::abs(frame->time - scenario.site.start - due) < 9e-9);
    } else {
      const auto& blink = std::get<Blink>(events[i]);
      CHECK(blink.sequence == blinks[blink.tag_id - 11]++);
    }
  }
  for (const auto count : syncs) CHECK(std::abs(static_cast<double>(count) - lasts * 10) <= 1);
  for (const auto count : blinks) CHECK(std::abs(static_cast<double>(count) - lasts * 4) <= 1);
}

TEST_CASE("With perfect radios stamps differ by the flight, and truth is where the tag is") {
  auto scenario = two_halls();
  scenario.site.radio = ideal_radio();
  auto run = UplinkSimulation::start(scenario);
  REQUIRE(run);
  while (const auto event = run->next()) {
    if (const auto* frame = std::get_if<SyncFrame>(&*event)) {
      const Subnet& subnet = scenario.site.subnets[static_cast<std::size_t>(frame->subnet)];
      const DeviceClock& control = run->air().anchor(frame->subnet, subnet.control).clock;
      for (int i = 0; i < subnet.anchors.size(); ++i) {
        const Reception& r = frame->receptions[static_cast<std::size_t>(i)];
        CHECK(r.received == (i != subnet.control));
        if (!r.received) continue;
        const double distance =
            (subnet.anchors[i].position - subnet.anchors[subnet.control].position).norm();
        CHECK(r.distance == doctest::Approx(distance).epsilon(1e-14));
        // Both clocks are right but for where they stand, which the simulation knows.
        const Reading here = read(run->air().anchor(frame->subnet, i).clock, frame->time);
        const auto since = static_cast<double>(r.rx - counter(here.ticks)) - here.fraction;
        CHECK(std::abs(since * kTick - distance / kSpeed) < 0.51 * kTick);
        CHECK(std::abs(
                  static_cast<double>(frame->tx - counter(read(control, frame->time).ticks))) <= 1);
      }
      continue;
    }
    const auto& blink = std::get<Blink>(*event);
    const double side = blink.tag_id == 11 ? 0.3 : -0.3;
    const auto body = state_at(scenario.site.path, blink.time - scenario.site.start);
    CHECK((blink.tag - tag_motion(body, {0, side, 0.4}).position).norm() < 1e-9);
    for (std::size_t subnet = 0; subnet < 2; ++subnet) {
      for (int i = 0; i < 6; ++i) {
        const Reception& r = blink.receptions[subnet][static_cast<std::size_t>(i)];
        REQUIRE(r.received);
        const auto& anchor = scenario.site.subnets[subnet].anchors[i];
        CHECK(std::abs(r.distance - (anchor.position - blink.tag).norm()) < 1e-9);
        CHECK(r.excess == 0);
      }
    }
  }
}

TEST_CASE("A run is the same twice, and another with another seed") {
  auto scenario = two_halls();
  const auto a = only<Blink>(all_events(scenario));
  const auto b = only<Blink>(all_events(scenario));
  scenario.site.seed = 2;
  const auto c = only<Blink>(all_events(scenario));
  REQUIRE(a.size() == b.size());
  REQUIRE(a.size() == c.size());
  int same = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    CHECK(a[i].host == b[i].host);
    for (std::size_t k = 0; k < 6; ++k) {
      CHECK(a[i].receptions[1][k].rx == b[i].receptions[1][k].rx);
      if (a[i].receptions[1][k].rx == c[i].receptions[1][k].rx) ++same;
    }
  }
  CHECK(same == 0);
}

TEST_CASE("Losses take frames away and change nothing else") {
  auto scenario = two_halls();
  const auto whole = all_events(scenario);
  scenario.site.radio.loss = 0.2;
  const auto lossy = all_events(scenario);
  REQUIRE(whole.size() == lossy.size());
  std::vector<double> lost;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    const auto* a = std::get_if<SyncFrame>(&whole[i]);
    const auto* b = std::get_if<SyncFrame>(&lossy[i]);
    REQUIRE((a == nullptr) == (b == nullptr));
    if (a == nullptr) {
      const auto& x = std::get<Blink>(whole[i]).receptions[0];
      const auto& y = std::get<Blink>(lossy[i]).receptions[0];
      for (std::size_t k = 0; k < 6; ++k) {
        CHECK(x[k].rx == y[k].rx);
        lost.push_back(y[k].received ? 0 : 1);
      }
      continue;
    }
    CHECK(a->tx == b->tx);
    for (std::size_t k = 0; k < 6; ++k) CHECK(a->receptions[k].rx == b->receptions[k].rx);
  }
  CHECK(
      uwbpos::test::mean_interval(0.2, 0.4, lost.size(), 0.999).contains(uwbpos::test::mean(lost)));
}

TEST_CASE("Walls lengthen the tags' links alone, and reach ends them") {
  auto scenario = two_halls();
  scenario.site.wall_count = 1;
  scenario.site.walls[0] = {.from = {15, -1}, .to = {15, 11}, .excess = 0.7};
  scenario.site.reach = 20;
  scenario.site.radio = ideal_radio();
  int through = 0;
  int deaf = 0;
  for (const auto& blink : only<Blink>(all_events(scenario))) {
    for (std::size_t subnet = 0; subnet < 2; ++subnet) {
      for (int i = 0; i < 6; ++i) {
        const Reception& r = blink.receptions[subnet][static_cast<std::size_t>(i)];
        const auto& anchor = scenario.site.subnets[subnet].anchors[i];
        CHECK(r.received == (r.distance <= 20));
        if (!r.received) ++deaf;
        // On the wall itself either answer is right.
        if (std::abs(anchor.position(0) - 15) < 1e-9 || std::abs(blink.tag(0) - 15) < 1e-3)
          continue;
        const bool crossed = (anchor.position(0) < 15) != (blink.tag(0) < 15);
        CHECK(r.excess == (crossed ? 0.7 : 0.0));
        if (crossed) ++through;
      }
    }
  }
  CHECK(through > 100);
  CHECK(deaf > 100);
  for (const auto& frame : only<SyncFrame>(all_events(scenario))) {
    for (const auto& reception : frame.receptions) CHECK(reception.excess == 0);
  }
}

TEST_CASE("Blockages come and go by link") {
  auto scenario = two_halls();
  scenario.site.blockage = {.probability = 0.3, .mean_duration = 0.2, .minimum_excess = 0.5};
  std::vector<double> blocked;
  for (const auto& blink : only<Blink>(all_events(scenario))) {
    for (const auto& subnet : blink.receptions) {
      for (std::size_t i = 0; i < 6 && &subnet < &blink.receptions[2]; ++i) {
        blocked.push_back(subnet[i].excess > 0 ? 1 : 0);
        CHECK((subnet[i].excess == 0 || subnet[i].excess >= 0.5));
      }
    }
  }
  // 24 links for 26 s, looked at ten times a second; correlated for 0.14 s: some 2500 independent
  // looks, one deviation of 0.9 %.
  CHECK(std::abs(uwbpos::test::mean(blocked) - 0.3) < 0.03);
}

TEST_CASE("The host's time is late by no more than it is told to be") {
  auto scenario = two_halls();
  scenario.site.host_latency = 5e-3;
  double worst = 0;
  for (const auto& event : all_events(scenario)) {
    const auto host = std::visit([](const auto& e) { return e.host; }, event);
    const double late = static_cast<double>(host) * 1e-6 - to_seconds(time_of(event));
    CHECK(late > -1e-6);
    CHECK(late < 5.001e-3);
    worst = std::max(worst, late);
  }
  CHECK(worst > 4e-3);
}

TEST_CASE("Scenarios outside their domain are refused") {
  const auto refused = [](const UplinkScenario& scenario) {
    const auto run = UplinkSimulation::start(scenario);
    return !run && run.error() == Error::InvalidOption;
  };
  CHECK_FALSE(refused(two_halls()));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double bad : {0.0, -1.0, 1e6, nan}) {
    auto scenario = two_halls();
    scenario.sync_rate = bad;
    CHECK(refused(scenario));
    scenario = two_halls();
    scenario.blink_rate = bad;
    CHECK(refused(scenario));
  }
  for (const double bad : {-1.0, nan}) {
    for (double Site::* const member : {&Site::reach, &Site::host_latency}) {
      auto scenario = two_halls();
      scenario.site.*member = bad;
      CHECK(refused(scenario));
    }
    for (double Radio::* const member :
         {&Radio::max_rate, &Radio::rate_walk, &Radio::sigma_rx, &Radio::sigma_tx, &Radio::loss,
          &Radio::antenna_delay_spread, &Radio::propagation_speed}) {
      auto scenario = two_halls();
      scenario.site.radio.*member = bad;
      CHECK(refused(scenario));
    }
  }
  for (int Site::* const member : {&Site::subnet_count, &Site::tag_count, &Site::wall_count}) {
    for (const int bad : {-1, 1000}) {
      auto scenario = two_halls();
      scenario.site.*member = bad;
      CHECK(refused(scenario));
    }
  }
  auto scenario = two_halls();
  scenario.site.subnets[1].control = 6;
  CHECK(refused(scenario));
  scenario = two_halls();
  scenario.site.subnets[1].heading = nan;
  CHECK(refused(scenario));
  CHECK(refused(UplinkScenario{}));
}

}  // namespace

}  // namespace tests::sim_uplink
