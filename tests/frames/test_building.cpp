// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <optional>
#include <variant>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/frames/fit_transform.hpp"
#include "uwbpos/frames/fuse_fixes.hpp"
#include "uwbpos/ranging/uplink_subnet.hpp"
#include "uwbpos/sim/uplink.hpp"
#include "uwbpos/solve/locate.hpp"

namespace tests::frames_building {

using namespace uwbpos;

namespace {

constexpr int kSubnets = 4;
constexpr double kSide = 20;
using Uplink = UplinkSubnet<double, 3, sim::kMaxSubnetAnchors>;

// The building of examples/building.cpp: quadrants of 20 m, frames turned, anchors at two heights.
sim::Subnet hang(int k) {
  const double places[][3] = {{0, 0, 4}, {1, 0, 1},   {1, 1, 4},
                              {0, 1, 1}, {0.5, 0, 4}, {0.5, 1, 0.5}};
  Anchors<double, 3> anchors;
  const auto first = static_cast<std::uint32_t>(10 * (k + 1));
  for (std::uint32_t i = 0; i < std::size(places); ++i) {
    REQUIRE(anchors.add(
        first + i, {kSide * (places[i][0] + k % 2), kSide * (places[i][1] + k / 2), places[i][2]}));
  }
  return *sim::make_subnet(anchors, first, 0.9 * k);
}

struct Walk {
  double mean_square;         // of errors over what is claimed
  double border_mean_square;  // right after a hand-over
  std::vector<double> steps;  // of the error at hand-overs, in σ
  int blinks = 0;
  int located = 0;
};

Walk walk(std::uint64_t seed) {
  sim::Route route{.speed = 1.5, .radius = 1};
  const double corners[][2] = {{4, 4}, {36, 6}, {33, 35}, {5, 34}, {6, 6}, {34, 33}};
  for (const auto& c : corners) REQUIRE(sim::add(route, {c[0], c[1], 1.5}));
  sim::UplinkScenario scenario{.site = {.path = route}};
  sim::Site& site = scenario.site;
  Subnets<double, 3, kSubnets> map;
  std::vector<Uplink> uplinks;
  sim::Random random{seed, "survey of the building"};
  for (int k = 0; k < kSubnets; ++k) {
    const sim::Subnet subnet = hang(k);
    REQUIRE(sim::add(site, subnet));
    Anchors<double, 3, sim::kMaxSubnetAnchors> own;
    std::vector<SharedPoint<double, 3>> points;
    for (const auto& anchor : subnet.anchors) {
      const Vec<double, 3> local = sim::in_subnet(subnet, anchor.position);
      REQUIRE(own.add(anchor.id, local));
      const Vec<double, 3> error{random.normal(0, 0.03), random.normal(0, 0.03),
                                 random.normal(0, 0.03)};
      points.push_back({local, anchor.position + error, 0.03});
    }
    uplinks.push_back(*Uplink::make(own, subnet.anchors[subnet.control].id));
    const auto fit = fit_transform(points);
    REQUIRE(fit);
    REQUIRE(map.add({static_cast<std::uint32_t>(k), 0, fit->a_T_b}));
  }
  site.reach = 25;
  site.radio.loss = 0.02;
  site.seed = seed;
  scenario.blink_rate = 5;
  auto run = *sim::UplinkSimulation::start(scenario);

  Walk result{};
  double sum = 0;
  double border_sum = 0;
  std::optional<MapFix<double, 3>> last;
  Vec<double, 3> last_error = Vec<double, 3>::Zero();
  unsigned last_heard = 0;
  while (const auto event = run.next()) {
    if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) {
      const auto k = static_cast<std::size_t>(frame->subnet);
      for (int i = 0; i < site.subnets[k].anchors.size(); ++i) {
        const sim::Reception& at = frame->receptions[static_cast<std::size_t>(i)];
        if (!at.received) continue;
        (void)uplinks[k].sync(site.subnets[k].anchors[i].id, frame->tx, at.rx, frame->host);
      }
      continue;
    }
    const sim::Blink& blink = std::get<sim::Blink>(*event);
    ++result.blinks;
    std::vector<SubnetFix<double, 3>> fixes;
    unsigned heard = 0;
    for (std::size_t k = 0; k < kSubnets; ++k) {
      std::vector<BlinkArrival> arrivals;
      for (int i = 0; i < site.subnets[k].anchors.size(); ++i) {
        const sim::Reception& at = blink.receptions[k][static_cast<std::size_t>(i)];
        if (at.received) arrivals.push_back({site.subnets[k].anchors[i].id, at.rx});
      }
      const auto told = uplinks[k].differences(arrivals, blink.host);
      if (!told || told->size < 4) continue;
      LocateOptions<double, 3> options;
      if (last) {
        options.prior = apply(inverse(map[static_cast<int>(k)].map_T_subnet), last->fix.position);
      }
      const auto fix = locate(told->reference, told->differences(), told->sigma, options);
      if (!fix) continue;
      fixes.push_back({static_cast<std::uint32_t>(k), *fix});
      heard |= 1U << k;
    }
    if (fixes.empty()) continue;
    const auto fused = fuse_and_learn(map, fixes);
    REQUIRE(fused);
    const Vec<double, 3> error = fused->fix.position - blink.tag;
    const double square =
        dot<double, 3>(error, Ldlt<double, 3>{fused->fix.covariance}.solve(error));
    ++result.located;
    sum += square;
    if (last && heard != last_heard) {
      border_sum += square;
      const Vec<double, 3> step = error - last_error;
      const Mat<double, 3> both = fused->fix.covariance + last->fix.covariance;
      result.steps.push_back(std::sqrt(dot<double, 3>(step, Ldlt<double, 3>{both}.solve(step))));
    }
    last = *fused;
    last_error = error;
    last_heard = heard;
  }
  result.mean_square = sum / result.located;
  result.border_mean_square = border_sum / static_cast<double>(result.steps.size());
  return result;
}

}  // namespace

TEST_CASE("From blinks to one map: four subnets, a walk through all of them") {
  constexpr int walks = 8;
  double mean = 0;
  double border_mean = 0;
  std::size_t borders = 0;
  std::size_t beyond = 0;
  for (int seed = 1; seed <= walks; ++seed) {
    const Walk w = walk(static_cast<std::uint64_t>(seed));
    CHECK(w.located > 0.97 * w.blinks);
    mean += w.mean_square / walks;
    border_mean += w.border_mean_square * static_cast<double>(w.steps.size());
    borders += w.steps.size();
    for (const double step : w.steps) beyond += step > 3 ? 1 : 0;
  }
  border_mean /= static_cast<double>(borders);
  CAPTURE(mean);
  CAPTURE(border_mean);
  CAPTURE(borders);
  CAPTURE(beyond);
  // Three is honest. At worst all of the variance were the transforms', which a walk's errors
  // share: then a walk is one χ² of three degrees of freedom, and the mean of eight deviates by √(2
  // · 3 / 8) = 0.87; twice that.
  CHECK(std::abs(mean - 3) < 1.74);
  CHECK(std::abs(border_mean - 3) < 1.74);
  CHECK(borders > 80);
  // The fixes' own noise alone makes two of them differ by more than 3σ once in 34.
  CHECK(beyond <= 2 * borders / 34);
}

}  // namespace tests::frames_building
