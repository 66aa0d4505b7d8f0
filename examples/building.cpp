// SPDX-License-Identifier: MIT
// A building of four subnets, each with a control anchor and a frame of its own, and a tag that
// blinks its way through all of them: from the stamps of blinks to one track in one map. Everything
// but the simulator runs unchanged on a microcontroller.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <uwbpos/sim/uplink.hpp>
#include <uwbpos/uwbpos.hpp>

namespace {

using namespace uwbpos;

constexpr int kSubnets = 4;
constexpr double kSide = 20;   // of a subnet's hall [m]
constexpr double kReach = 25;  // of a blink [m]
using Uplink = UplinkSubnet<double, 3, sim::kMaxSubnetAnchors>;

int refused(const char* what, Error error) {
  const std::string_view words = describe(error);
  std::printf("%s: %.*s\n", what, static_cast<int>(words.size()), words.data());
  return 1;
}

// Subnet k hangs in a quadrant of the map, its control anchor in the lower left corner; its frame
// is turned by 50 degrees more than the one before. Heights differ so that differences tell z.
Result<sim::Subnet> hang(int k) {
  constexpr std::array<std::array<double, 3>, 6> kPlaces{
      {{0, 0, 4}, {1, 0, 1}, {1, 1, 4}, {0, 1, 1}, {0.5, 0, 4}, {0.5, 1, 0.5}}};
  Anchors<double, 3> anchors;
  const auto first = static_cast<std::uint32_t>(10 * (k + 1));
  const int column = k % 2;
  const int row = k / 2;
  for (std::uint32_t i = 0; i < kPlaces.size(); ++i) {
    const auto& [x, y, z] = kPlaces[i];
    const auto added = anchors.add(first + i, {kSide * (x + column), kSide * (y + row), z});
    if (!added) return std::unexpected(added.error());
  }
  return sim::make_subnet(anchors, first, degrees_to_radians(50.0 * k));
}

// 1. What each subnet knows of itself: its anchors in its own frame.
Result<Uplink> own_frame(const sim::Subnet& subnet) {
  Anchors<double, 3, sim::kMaxSubnetAnchors> anchors;
  for (const auto& anchor : subnet.anchors) {
    const auto added = anchors.add(anchor.id, sim::in_subnet(subnet, anchor.position));
    if (!added) return std::unexpected(added.error());
  }
  return Uplink::make(anchors, subnet.anchors[subnet.control].id);
}

// 2. What the building knows of it: four of its anchors were surveyed in the map, to 3 cm.
Result<FittedTransform<double, 3>> survey(const sim::Subnet& subnet, sim::Random& random) {
  std::array<SharedPoint<double, 3>, 4> points;
  for (int i = 0; i < 4; ++i) {
    const Vec<double, 3>& at = subnet.anchors[i].position;
    const Vec<double, 3> error{random.normal(0, 0.03), random.normal(0, 0.03),
                               random.normal(0, 0.03)};
    points[static_cast<std::size_t>(i)] = {sim::in_subnet(subnet, at), at + error, 0.03};
  }
  return fit_transform(points);
}

}  // namespace

int main() {
  sim::Route route{.speed = 1.5, .radius = 1};
  for (const auto& [x, y] :
       {std::pair{4.0, 4.0}, {36.0, 6.0}, {33.0, 35.0}, {5.0, 34.0}, {6.0, 6.0}, {34.0, 33.0}}) {
    const auto added = sim::add(route, {x, y, 1.5});
    if (!added) return refused("route", added.error());
  }
  sim::UplinkScenario scenario{.site = {.path = route}};
  sim::Site& site = scenario.site;
  Subnets<double, 3, kSubnets> map;
  std::vector<Uplink> uplinks;
  sim::Random random{"survey of the building"};
  for (int k = 0; k < kSubnets; ++k) {
    const auto subnet = hang(k);
    if (!subnet) return refused("anchors", subnet.error());
    if (const auto added = sim::add(site, *subnet); !added) return refused("site", added.error());
    const auto uplink = own_frame(*subnet);
    if (!uplink) return refused("uplink", uplink.error());
    uplinks.push_back(*uplink);
    const auto fit = survey(*subnet, random);
    if (!fit) return refused("transform", fit.error());
    const std::uint32_t control = subnet->anchors[subnet->control].id;
    if (const auto added = map.add({static_cast<std::uint32_t>(k + 1), control, fit->a_T_b});
        !added) {
      return refused("subnet", added.error());
    }
    std::printf("subnet %d: fits its surveyed anchors to %.0f mm rms\n", k + 1, 1000 * fit->rms);
  }

  site.reach = kReach;
  site.seed = 4;
  scenario.blink_rate = 5;
  auto run = sim::UplinkSimulation::start(scenario);
  if (!run) return refused("simulation", run.error());

  std::puts(
      "\n  t [s]     truth [m]             track [m]             ±1σ [m]          error [m]  by");
  std::optional<Vec<double, 3>> last;  // in the map
  std::optional<MapFix<double, 3>> previous;
  Vec<double, 3> previous_error = Vec<double, 3>::Zero();
  unsigned heard_before = 0;
  int blinks = 0;
  int fixes_made = 0;
  int borders = 0;
  double squares = 0;
  double normalised = 0;
  double worst_step = 0;
  while (const auto event = run->next()) {
    // 3. Sync frames keep every anchor's clock known in its control anchor's time.
    if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) {
      const auto k = static_cast<std::size_t>(frame->subnet);
      const auto& anchors = site.subnets[k].anchors;
      for (int i = 0; i < anchors.size(); ++i) {
        const sim::Reception& at = frame->receptions[static_cast<std::size_t>(i)];
        // A frame that cannot be used is refused by the tracker, which coasts.
        if (at.received) (void)uplinks[k].sync(anchors[i].id, frame->tx, at.rx, frame->host);
      }
      continue;
    }
    const auto* heard_blink = std::get_if<sim::Blink>(&*event);
    if (heard_blink == nullptr) continue;
    const sim::Blink& blink = *heard_blink;
    ++blinks;
    std::vector<SubnetFix<double, 3>> fixes;
    unsigned heard = 0;
    for (std::size_t k = 0; k < kSubnets; ++k) {
      // 4. A blink's stamps at the anchors that heard it become range differences …
      const auto& anchors = site.subnets[k].anchors;
      std::vector<BlinkArrival> arrivals;
      for (int i = 0; i < anchors.size(); ++i) {
        const sim::Reception& at = blink.receptions[k][static_cast<std::size_t>(i)];
        if (at.received) arrivals.push_back({anchors[i].id, at.rx});
      }
      const auto told = uplinks[k].differences(arrivals, blink.host);
      if (!told || told->size < 4) continue;
      // 5. … and those a position in the subnet's own frame, mirror images settled by the last.
      LocateOptions<double, 3> options;
      if (last) options.prior = apply(inverse(map[static_cast<int>(k)].map_T_subnet), *last);
      const auto fix = locate(told->reference, told->differences(), told->sigma, options);
      if (!fix) continue;
      fixes.push_back({static_cast<std::uint32_t>(k + 1), *fix});
      heard |= 1U << k;
    }
    if (fixes.empty()) continue;

    // 6. In the map, what several subnets saw is one position; overlaps teach the transforms.
    FuseOptions<double> fusing;
    if (previous) fusing.preferred = previous->leading;
    const auto fused = fuse_and_learn(map, fixes, fusing);
    if (!fused) return refused("fusion", fused.error());
    const Vec<double, 3> error = fused->fix.position - blink.tag;
    const Mat<double, 3>& covariance = fused->fix.covariance;
    const Ldlt<double, 3> claimed{covariance};
    squares += error.squaredNorm();
    normalised += dot<double, 3>(error, claimed.solve(error));
    if (previous && heard != heard_before) {
      ++borders;
      const Vec<double, 3> step = error - previous_error;
      const Ldlt<double, 3> both{Mat<double, 3>{covariance + previous->fix.covariance}};
      worst_step = std::max(worst_step, std::sqrt(dot<double, 3>(step, both.solve(step))));
    }
    if (fixes_made % 40 == 0) {
      const Vec<double, 3>& at = fused->fix.position;
      std::printf("%7.1f %6.2f %6.2f %6.2f  %6.2f %6.2f %6.2f  %5.2f %5.2f %5.2f  %8.3f   ",
                  sim::to_seconds(blink.time), blink.tag[0], blink.tag[1], blink.tag[2], at[0],
                  at[1], at[2], std::sqrt(covariance(0, 0)), std::sqrt(covariance(1, 1)),
                  std::sqrt(covariance(2, 2)), error.norm());
      for (std::size_t i = 0; i < fixes.size(); ++i) {
        if (fused->used[i]) std::printf(" %u", static_cast<unsigned>(fixes[i].subnet));
      }
      std::puts("");
    }
    ++fixes_made;
    last = fused->fix.position;
    previous = *fused;
    previous_error = error;
    heard_before = heard;
  }
  const double n = fixes_made;
  std::printf(
      "\n%d of %d blinks located, %.3f m rms; squared error over what is claimed: %.2f (3 wanted)\n"
      "%d hand-overs, the largest step of the track's error at one: %.1f σ\n",
      fixes_made, blinks, std::sqrt(squares / n), normalised / n, borders, worst_step);
  return 0;
}
