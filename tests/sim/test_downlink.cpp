// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/sim/downlink.hpp>
#include <uwbpos/sim/hall.hpp>

#include "../support/statistics.hpp"

namespace tests::sim_downlink {

namespace {

using namespace uwbpos::sim;
using uwbpos::DeviceTime;
using uwbpos::Error;
using uwbpos::Vec;

constexpr double kSpeed = uwbpos::kSpeedOfLightAir<double>;
constexpr double kTick = uwbpos::kTickSeconds<double>;

// Two subnets of four and three anchors, two tags.
DownlinkScenario site() {
  DownlinkScenario scenario;
  for (const int count : {4, 3}) {
    const auto anchors = hang_anchors({.width = 15, .depth = 10}, count, Placement::Perimeter);
    REQUIRE(anchors);
    const auto subnet = make_subnet(*anchors, 1);
    REQUIRE(subnet);
    REQUIRE(add(scenario.site, *subnet));
  }
  Route route;
  REQUIRE(add(route, {2, 5, 0.5}));
  REQUIRE(add(route, {13, 6, 0.5}));
  scenario.site.path = route;
  scenario.site.tags[1] = {.id = 12, .lever = {0, -0.3, 0.4}};
  scenario.site.tag_count = 2;
  scenario.site.start = {500, 0.125};
  return scenario;
}

std::vector<Packet> all_packets(const DownlinkScenario& scenario) {
  auto run = DownlinkSimulation::start(scenario);
  REQUIRE(run);
  std::vector<Packet> packets;
  while (const auto packet = run->next()) packets.push_back(*packet);
  CHECK_FALSE(run->next());
  return packets;
}

TEST_CASE("Anchors send in turn, one in each slot") {
  const auto scenario = site();
  const auto packets = all_packets(scenario);
  const double rounds = duration(scenario.site.path) * 10;
  CHECK(std::abs(static_cast<double>(packets.size()) - rounds * 7) <= 7);
  for (std::size_t i = 0; i < packets.size(); ++i) {
    const Packet& packet = packets[i];
    const auto slot = static_cast<int>(i % 7);
    CHECK(packet.sequence == static_cast<std::int64_t>(i / 7));
    CHECK(packet.subnet == (slot < 4 ? 0 : 1));
    CHECK(packet.anchor == (slot < 4 ? slot : slot - 4));
    CHECK(packet.anchor_id == static_cast<std::uint32_t>(packet.anchor + 1));
    const double due = static_cast<double>(i / 7) / 10 + 2e-3 * slot;
    CHECK(std::abs(packet.time - scenario.site.start - due) < 9e-9);
  }
}

TEST_CASE("A packet tells when its sender heard the others last, and of its own subnet only") {
  auto scenario = site();
  scenario.site.radio = ideal_radio();
  auto run = DownlinkSimulation::start(scenario);
  REQUIRE(run);
  // Where the counters stood, from the packets themselves: perfect clocks keep their distance.
  std::array<std::array<Packet, 4>, 2> last{};
  while (const auto packet = run->next()) {
    const auto subnet = static_cast<std::size_t>(packet->subnet);
    const auto& anchors = scenario.site.subnets[subnet].anchors;
    const auto& clock = run->air().anchor(packet->subnet, packet->anchor).clock;
    for (int other = 0; other < kMaxSubnetAnchors; ++other) {
      const Heard& heard = packet->heard[static_cast<std::size_t>(other)];
      const bool there = other < anchors.size() && other != packet->anchor;
      const bool before = there && (packet->sequence > 0 || other < packet->anchor);
      CHECK(heard.valid == before);
      if (!before) continue;
      const Packet& sent = last[subnet][static_cast<std::size_t>(other)];
      CHECK(heard.sequence == sent.sequence);
      const Reading then = read(clock, sent.time);
      const double flight =
          (anchors[other].position - anchors[packet->anchor].position).norm() / kSpeed;
      const auto since = static_cast<double>(heard.rx - counter(then.ticks)) - then.fraction;
      CHECK(std::abs(since * kTick - flight) < 0.51 * kTick);
    }
    last[subnet][static_cast<std::size_t>(packet->anchor)] = *packet;
  }
}

TEST_CASE("With perfect radios tags stamp packets a flight later, wherever they drive") {
  auto scenario = site();
  scenario.site.radio = ideal_radio();
  auto run = DownlinkSimulation::start(scenario);
  REQUIRE(run);
  while (const auto packet = run->next()) {
    const auto& anchor =
        scenario.site.subnets[static_cast<std::size_t>(packet->subnet)].anchors[packet->anchor];
    for (int tag = 0; tag < 2; ++tag) {
      const TagReception& at = packet->tags[static_cast<std::size_t>(tag)];
      REQUIRE(at.reception.received);
      CHECK(at.tag_id == scenario.site.tags[static_cast<std::size_t>(tag)].id);
      // A walking tag moves 0.1 µm while the packet flies.
      CHECK(std::abs(at.reception.distance - (at.tag - anchor.position).norm()) < 2e-7);
      const Reading then = read(run->air().tag(tag).clock, packet->time);
      const auto since = static_cast<double>(at.reception.rx - counter(then.ticks)) - then.fraction;
      CHECK(std::abs(since * kTick - at.reception.distance / kSpeed) < 0.52 * kTick);
    }
  }
}

TEST_CASE("A run is the same twice; losses take receptions away and change nothing else") {
  auto scenario = site();
  const auto a = all_packets(scenario);
  const auto b = all_packets(scenario);
  scenario.site.radio.loss = 0.2;
  const auto c = all_packets(scenario);
  REQUIRE(a.size() == b.size());
  REQUIRE(a.size() == c.size());
  std::vector<double> lost;
  int stale = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t tag = 0; tag < 2; ++tag) {
      CHECK(a[i].tags[tag].reception.rx == b[i].tags[tag].reception.rx);
      CHECK(a[i].tags[tag].reception.rx == c[i].tags[tag].reception.rx);
      lost.push_back(c[i].tags[tag].reception.received ? 0 : 1);
    }
    for (std::size_t other = 0; other < 4; ++other) {
      const Heard& full = a[i].heard[other];
      const Heard& less = c[i].heard[other];
      if (less.valid && less.sequence == full.sequence) CHECK(less.rx == full.rx);
      if (less.valid && less.sequence < full.sequence) ++stale;
    }
  }
  CHECK(stale > 10);
  CHECK(
      uwbpos::test::mean_interval(0.2, 0.4, lost.size(), 0.999).contains(uwbpos::test::mean(lost)));
}

TEST_CASE("Walls lengthen what tags hear") {
  auto scenario = site();
  scenario.site.radio = ideal_radio();
  scenario.site.wall_count = 1;
  scenario.site.walls[0] = {.from = {-1, 4}, .to = {16, 4}, .excess = 0.7};
  int through = 0;
  for (const auto& packet : all_packets(scenario)) {
    const auto& anchor =
        scenario.site.subnets[static_cast<std::size_t>(packet.subnet)].anchors[packet.anchor];
    const TagReception& at = packet.tags[0];
    const bool crossed = (anchor.position(1) < 4) != (at.tag(1) < 4);
    CHECK(at.reception.excess == (crossed ? 0.7 : 0.0));
    if (crossed) ++through;
  }
  CHECK(through > 50);
}

TEST_CASE("Scenarios outside their domain are refused") {
  const auto refused = [](const DownlinkScenario& scenario) {
    const auto run = DownlinkSimulation::start(scenario);
    return !run && run.error() == Error::InvalidOption;
  };
  CHECK_FALSE(refused(site()));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double bad : {0.0, -1.0, 1e6, nan}) {
    auto scenario = site();
    scenario.round_rate = bad;
    CHECK(refused(scenario));
  }
  // Seven slots do not fit a tenth of a second.
  for (const double bad : {0.0, -1.0, 0.015, nan}) {
    auto scenario = site();
    scenario.slot = bad;
    CHECK(refused(scenario));
  }
  auto scenario = site();
  scenario.site.radio.loss = nan;
  CHECK(refused(scenario));
  CHECK(refused(DownlinkScenario{}));
}

}  // namespace

}  // namespace tests::sim_downlink
