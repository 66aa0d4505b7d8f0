// SPDX-License-Identifier: MIT
// From the stamps of simulated clocks to positions, the way a user goes: uplink in one subnet and
// in a building of four, downlink through pairs.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/frames/fuse_fixes.hpp>
#include <uwbpos/ranging/tdoa_downlink.hpp>
#include <uwbpos/ranging/uplink_subnet.hpp>
#include <uwbpos/sim/downlink.hpp>
#include <uwbpos/sim/hall.hpp>
#include <uwbpos/sim/uplink.hpp>
#include <uwbpos/solve/locate.hpp>
#include <uwbpos/time/rate_tracker.hpp>

#include "../support/nees.hpp"
#include "../support/statistics.hpp"

namespace tests::sim_tdoa_positions {

namespace {

using namespace uwbpos;

constexpr double kSpeed = kSpeedOfLightAir<double>;

// Eight anchors along the walls of a quadrant of 20 m, high and low, at a corner of the map.
sim::Subnet quadrant(int k) {
  const auto hall = sim::hang_anchors({.width = 20, .depth = 20, .height = 6, .second_height = 0.5},
                                      8, sim::Placement::Perimeter);
  REQUIRE(hall);
  Anchors<double, 3> anchors;
  for (const auto& anchor : *hall) {
    REQUIRE(anchors.add(anchor.id, anchor.position + Vec<double, 3>(k % 2 * 20, k / 2 * 20, 0)));
  }
  const auto subnet = sim::make_subnet(anchors, 3, 0.7 * k);
  REQUIRE(subnet);
  return *subnet;
}

sim::Radio radio() {
  return {.max_rate = 20e-6, .rate_walk = 0.1e-9, .sigma_rx = 0.15e-9, .tx_grid = 512, .loss = 0.1};
}

template <class S>
using Net = UplinkSubnet<S, 3, sim::kMaxSubnetAnchors>;

// In the subnet's own frame, its control anchor in the origin.
template <class S>
Net<S> net_of(const sim::Subnet& subnet) {
  Anchors<S, 3, sim::kMaxSubnetAnchors> anchors;
  for (const auto& anchor : subnet.anchors) {
    REQUIRE(
        anchors.add(anchor.id, sim::in_subnet(subnet, anchor.position).template cast<S>().eval()));
  }
  ClockSyncOptions<S> options;
  options.wander = S(0.1414e-9);  // both clocks walk
  auto net = Net<S>::make(anchors, subnet.anchors[subnet.control].id, options);
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

template <class S>
Result<Fix<S, 3>> position(const Net<S>& net, const sim::Subnet& subnet, const sim::Blink& blink,
                           std::size_t place) {
  std::vector<BlinkArrival> arrivals;
  for (int i = 0; i < subnet.anchors.size(); ++i) {
    const auto& reception = blink.receptions[place][static_cast<std::size_t>(i)];
    if (reception.received) arrivals.push_back({subnet.anchors[i].id, reception.rx});
  }
  const auto found = net.differences(arrivals, blink.host);
  if (!found) return std::unexpected(found.error());
  if (found->size < 5) return std::unexpected(Error::TooFewMeasurements);
  return locate(found->reference, found->differences(), found->sigma);
}

TEST_CASE_TEMPLATE("From blinks to positions whose covariance is right", S, float, double) {
  sim::UplinkScenario scenario;
  REQUIRE(sim::add(scenario.site, quadrant(0)));
  auto route = sim::lawn_mower({2, 2, 1.5}, {18, 18, 1.5}, 5);
  REQUIRE(route);
  scenario.site.path = *route;
  scenario.site.radio = radio();
  const sim::Subnet& subnet = scenario.site.subnets[0];
  auto net = net_of<S>(subnet);
  auto run = sim::UplinkSimulation::start(scenario);
  REQUIRE(run);
  std::vector<double> squares;
  std::vector<double> errors;
  int refused = 0;
  while (const auto event = run->next()) {
    if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) {
      feed(net, subnet, *frame);
      continue;
    }
    const auto& blink = std::get<sim::Blink>(*event);
    if (blink.sequence < 30) continue;
    const auto fix = position(net, subnet, blink, 0);
    if (!fix) {
      ++refused;
      continue;
    }
    const Vec<double, 3> truth = sim::in_subnet(subnet, blink.tag);
    squares.push_back(test::normalised_squared_error<S, 3>(fix->position, fix->covariance, truth));
    errors.push_back((fix->position.template cast<double>() - truth).norm());
  }
  MESSAGE("mean NEES ", test::mean(squares), " of 3, rms ", test::root_mean_square(errors), " m, ",
          refused, " of ", refused + static_cast<int>(squares.size()), " refused");
  CHECK(squares.size() > 800);
  CHECK(refused < 100);
  // Trackers' errors last some 0.5 s: a fifth of the variance is common to neighbours. 900
  // fixes of 3 know their mean to 0.08; and one σ for all arrivals is an approximation.
  CHECK(std::abs(test::mean(squares) - 3) < 0.3);
  CHECK(test::root_mean_square(errors) < 0.15);
}

TEST_CASE_TEMPLATE("Four subnets, from blinks to one map: honest everywhere, no step at a border",
                   S, float, double) {
  sim::UplinkScenario scenario;
  for (int k = 0; k < 4; ++k) REQUIRE(sim::add(scenario.site, quadrant(k)));
  sim::Route route;
  for (const auto& [x, y] : {std::array{6.0, 6.0},
                             {34.0, 8.0},
                             {33.0, 34.0},
                             {7.0, 33.0},
                             {8.0, 7.0},
                             {33.0, 32.0},
                             {32.0, 8.0},
                             {8.0, 32.0}}) {
    REQUIRE(sim::add(route, {x, y, 1.5}));
  }
  route.speed = 1.5;
  scenario.site.path = route;
  scenario.site.radio = radio();
  scenario.site.reach = 25;

  std::vector<Net<S>> nets;
  Subnets<S, 3, 4> subnets;
  for (std::size_t k = 0; k < 4; ++k) {
    const sim::Subnet& subnet = scenario.site.subnets[k];
    nets.push_back(net_of<S>(subnet));
    // The control anchor surveyed to a centimetre, the heading to a milliradian.
    Mat<S, 6> survey = Mat<S, 6>::Identity() * S(1e-4);
    survey.template bottomRightCorner<3, 3>() = Mat<S, 3>::Identity() * S(1e-6);
    const auto map_T_subnet = transform_from_yaw<S, 3>(
        static_cast<S>(subnet.heading),
        subnet.anchors[subnet.control].position.template cast<S>().eval(), survey);
    REQUIRE(map_T_subnet);
    REQUIRE(subnets.add({static_cast<std::uint32_t>(k + 1), 3, *map_T_subnet}));
  }

  auto run = sim::UplinkSimulation::start(scenario);
  REQUIRE(run);
  std::vector<double> squares;
  std::vector<double> steps;
  std::vector<std::uint32_t> last_heard;
  Vec<double, 3> last_error = Vec<double, 3>::Zero();
  Mat<double, 3> last_covariance = Mat<double, 3>::Identity();
  int blinks = 0;
  int contradictions = 0;
  while (const auto event = run->next()) {
    if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) {
      const auto k = static_cast<std::size_t>(frame->subnet);
      feed(nets[k], scenario.site.subnets[k], *frame);
      continue;
    }
    const auto& blink = std::get<sim::Blink>(*event);
    if (blink.sequence < 30) continue;
    ++blinks;
    std::vector<SubnetFix<S, 3>> fixes;
    std::vector<std::uint32_t> heard;
    for (std::size_t k = 0; k < 4; ++k) {
      const auto fix = position(nets[k], scenario.site.subnets[k], blink, k);
      // Where a subnet sees the tag at a glance only, its fix is of the first order no more.
      if (!fix || fix->covariance.trace() > S(0.25)) continue;
      fixes.push_back({static_cast<std::uint32_t>(k + 1), *fix});
      heard.push_back(static_cast<std::uint32_t>(k + 1));
    }
    if (fixes.empty()) continue;
    const auto fused = fuse_and_learn(subnets, fixes);
    REQUIRE(fused);
    contradictions += fused->fused < fused->heard ? 1 : 0;
    const Vec<double, 3> error = fused->fix.position.template cast<double>() - blink.tag;
    const Mat<double, 3> covariance = fused->fix.covariance.template cast<double>();
    squares.push_back(
        test::normalised_squared_error<double, 3>(error, covariance, Vec<double, 3>::Zero()));
    if (!last_heard.empty() && heard != last_heard) {
      const Vec<double, 3> step = error - last_error;
      const Mat<double, 3> both = covariance + last_covariance;
      steps.push_back(
          test::normalised_squared_error<double, 3>(step, both, Vec<double, 3>::Zero()));
    }
    last_heard = heard;
    last_error = error;
    last_covariance = covariance;
  }
  const auto beyond = std::count_if(steps.begin(), steps.end(), [](double s) { return s > 14.16; });
  MESSAGE("mean NEES ", test::mean(squares), " of 3; ", steps.size(), " changes of subnets, mean ",
          test::mean(steps), " of 3, ", beyond, " beyond 3 sigma; ", squares.size(), " of ", blinks,
          " blinks located, ", contradictions, " contradictions");
  CHECK(static_cast<double>(squares.size()) > 0.95 * blinks);
  CHECK(test::mean(squares) < 3.5);
  CHECK(test::mean(squares) > 2);
  CHECK(steps.size() > 30);
  CHECK(test::mean(steps) < 3.7);
  // 14.16 is the quantile of χ²(3) that 3σ is of χ²(1): 0.27 % lie beyond by chance.
  CHECK(static_cast<double>(beyond) <= 1 + 0.01 * static_cast<double>(steps.size()));
  CHECK(static_cast<double>(contradictions) < 0.01 * blinks);
}

TEST_CASE_TEMPLATE("A listening tag finds itself from pairs of packets", S, float, double) {
  sim::DownlinkScenario scenario;
  REQUIRE(sim::add(scenario.site, quadrant(0)));
  sim::Random random{"listening"};
  auto stops = sim::random_stops({3, 3, 1}, {17, 17, 2}, 1, random);
  REQUIRE(stops);
  stops->dwell = 60;
  scenario.site.path = *stops;
  scenario.site.radio = radio();
  const sim::Subnet& subnet = scenario.site.subnets[0];
  const Vec<double, 3> truth = stops->places[0];
  auto run = sim::DownlinkSimulation::start(scenario);
  REQUIRE(run);
  RateTrackerOptions<S> rate_options;
  rate_options.wander = S(0.1414e-9);
  std::vector<RateTracker<S>> rates(8, RateTracker<S>{rate_options});
  std::vector<PairDifference<S, 3>> pairs;
  std::optional<sim::Packet> last;
  std::vector<double> errors;
  std::vector<double> squares;
  std::int64_t round = 0;
  while (const auto packet = run->next()) {
    if (packet->sequence != round) {
      round = packet->sequence;
      if (pairs.size() >= 5 && round > 30) {
        if (const auto fix = locate(pairs)) {
          errors.push_back((fix->position.template cast<double>() - truth).norm());
          squares.push_back(
              test::normalised_squared_error<S, 3>(fix->position, fix->covariance, truth));
        }
      }
      pairs.clear();
      last.reset();
    }
    const auto& here = packet->tags[0].reception;
    if (!here.received) continue;
    RateTracker<S>& tracker = rates[static_cast<std::size_t>(packet->anchor)];
    const auto rate = tracker.update(here.rx, packet->tx, packet->host);
    if (last && rate) {
      const auto& heard = packet->heard[static_cast<std::size_t>(last->anchor)];
      const Vec<double, 3>& a = subnet.anchors[last->anchor].position;
      const Vec<double, 3>& b = subnet.anchors[packet->anchor].position;
      if (heard.valid && heard.sequence == last->sequence) {
        const auto difference =
            tdoa_downlink_difference<S>({.a_rx = last->tags[0].reception.rx,
                                         .b_rx = here.rx,
                                         .a_rx_at_b = heard.rx,
                                         .b_tx = packet->tx},
                                        *rate, static_cast<S>((a - b).norm() / kSpeed));
        REQUIRE(difference);
        pairs.push_back(
            {a.cast<S>(), b.cast<S>(), difference->value, std::sqrt(difference->variance)});
      }
    }
    last = *packet;
  }
  MESSAGE("rms ", test::root_mean_square(errors), " m in ", errors.size(), " rounds, mean NEES ",
          test::mean(squares));
  CHECK(errors.size() > 150);
  // Neighbouring pairs share the tag's stamp of the packet between them with opposite signs, which
  // a solver of independent pairs does not know: its covariance is a guess, not a bound.
  CHECK(test::root_mean_square(errors) < 0.25);
  CHECK(test::mean(squares) < 9);
}

}  // namespace

}  // namespace tests::sim_tdoa_positions
