// SPDX-License-Identifier: MIT
#include "demo_tdoa.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>

#include <fmt/format.h>

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/core/angle.hpp"
#include "uwbpos/frames/fit_transform.hpp"
#include "uwbpos/frames/fuse_fixes.hpp"
#include "uwbpos/geometry/anchors.hpp"
#include "uwbpos/ranging/uplink_subnet.hpp"
#include "uwbpos/sim/uplink.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/tdoa_chan.hpp"

#include "failure.hpp"
#include "gnuplot.hpp"
#include "output.hpp"

namespace uwbpos::host {
namespace {

constexpr int kSubnets = 4;
constexpr double kSide = 20;      // of a subnet's hall [m]
constexpr double kReach = 25;     // of a blink [m]
constexpr double kSurvey = 0.03;  // [m]
using Point = Vec<double, 3>;
using Uplink = UplinkSubnet<double, 3, sim::kMaxSubnetAnchors>;

template <class T>
T known(Result<T> result) {
  if (!result) throw Failure{fmt::format("demo: {}", describe(result.error()))};
  if constexpr (!std::is_void_v<T>) return *std::move(result);
}

// A quadrant of the map: anchors at four heights, so that differences tell the tag's; its frame is
// turned by 50 degrees more than the one before.
sim::Subnet quadrant(int k) {
  constexpr std::array<std::array<double, 3>, 6> places{
      {{0, 0, 4}, {1, 0, 1}, {1, 1, 4}, {0, 1, 1}, {0.5, 0, 4}, {0.5, 1, 0.5}}};
  Anchors<double, 3> anchors;
  const auto first = static_cast<std::uint32_t>(10 * (k + 1));
  auto id = first;
  const int column = k % 2;
  const int row = k / 2;
  for (const auto& [x, y, z] : places) {
    known(anchors.add(id++, {kSide * (x + column), kSide * (y + row), z}));
  }
  return known(sim::make_subnet(anchors, first, degrees_to_radians(50.0 * k)));
}

// The building as its devices know it.
struct Building {
  sim::Site site;
  std::vector<Uplink> uplinks;           // anchors in their own frames
  Subnets<double, 3, kSubnets> subnets;  // how those lie in the map, from surveyed anchors

  Building(const sim::Route& route, sim::Random& survey) : site{.path = route} {
    for (int k = 0; k < kSubnets; ++k) {
      const sim::Subnet subnet = quadrant(k);
      known(sim::add(site, subnet));
      Anchors<double, 3, sim::kMaxSubnetAnchors> own;
      std::vector<SharedPoint<double, 3>> points;
      for (const auto& anchor : subnet.anchors) {
        const Point local = sim::in_subnet(subnet, anchor.position);
        known(own.add(anchor.id, local));
        const Point error{survey.normal(0, kSurvey), survey.normal(0, kSurvey),
                          survey.normal(0, kSurvey)};
        points.push_back({local, anchor.position + error, kSurvey});
      }
      const std::uint32_t control = subnet.anchors[subnet.control].id;
      uplinks.push_back(known(Uplink::make(own, control)));
      known(subnets.add(
          {static_cast<std::uint32_t>(k + 1), control, known(fit_transform(points)).a_T_b}));
    }
  }
};

// Sums that become a `BuildingWalk`'s figures.
struct Sums {
  double bound = 0, likelihood = 0, chan = 0, squares = 0, normalised = 0;
};

}  // namespace

BuildingWalk walk_through_building(std::uint64_t seed) {
  sim::Route route{.speed = 1.5, .radius = 1};
  for (const auto& [x, y] :
       {std::pair{4.0, 4.0}, {36.0, 6.0}, {33.0, 35.0}, {5.0, 34.0}, {6.0, 6.0}, {34.0, 33.0}}) {
    known(sim::add(route, {x, y, 1.5}));
  }
  sim::Random survey{seed, "survey of the building"};
  Building building{route, survey};
  sim::UplinkScenario scenario{.site = building.site};
  scenario.site.reach = kReach;
  scenario.site.seed = seed;
  scenario.blink_rate = 5;
  auto run = known(sim::UplinkSimulation::start(scenario));

  BuildingWalk walk;
  for (const sim::Subnet& subnet : std::span{building.site.subnets}.first(kSubnets)) {
    for (const auto& anchor : subnet.anchors) walk.anchors.push_back(anchor.position);
  }
  Sums sums;
  std::optional<MapFix<double, 3>> previous;
  Point previous_error = Point::Zero();
  unsigned heard_before = 0;
  while (const auto event = run.next()) {
    if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) {
      const auto k = static_cast<std::size_t>(frame->subnet);
      const auto& anchors = building.site.subnets[k].anchors;
      for (int i = 0; i < anchors.size(); ++i) {
        const sim::Reception& at = frame->receptions[static_cast<std::size_t>(i)];
        // A frame that cannot be used is refused by the tracker, which coasts.
        if (at.received) {
          (void)building.uplinks[k].sync(anchors[i].id, frame->tx, at.rx, frame->host);
        }
      }
      continue;
    }
    const auto* blink = std::get_if<sim::Blink>(&*event);
    if (blink == nullptr) continue;
    ++walk.blinks;
    std::vector<SubnetFix<double, 3>> fixes;
    unsigned heard = 0;
    for (int k = 0; k < kSubnets; ++k) {
      const auto place = static_cast<std::size_t>(k);
      const sim::Subnet& subnet = building.site.subnets[place];
      std::vector<BlinkArrival> arrivals;
      for (int i = 0; i < subnet.anchors.size(); ++i) {
        const sim::Reception& at = blink->receptions[place][static_cast<std::size_t>(i)];
        if (at.received) arrivals.push_back({subnet.anchors[i].id, at.rx});
      }
      const auto told = building.uplinks[place].differences(arrivals, blink->host);
      if (!told || told->size < 4) continue;
      LocateOptions<double, 3> options;
      if (previous) {
        options.prior = apply(inverse(building.subnets[k].map_T_subnet), previous->fix.position);
      }
      const auto fix = locate(told->reference, told->differences(), told->sigma, options);
      if (!fix) continue;
      fixes.push_back({static_cast<std::uint32_t>(k + 1), *fix});
      heard |= 1U << place;
      // Beside it, Chan alone, and what no method can beat at the true place.
      const Point truth = sim::in_subnet(subnet, blink->tag);
      const auto chan = tdoa_chan(told->reference, told->differences(), told->sigma);
      const auto bound = cramer_rao_bound(told->reference, told->differences(), told->sigma, truth);
      if (!chan || !bound) {
        ++walk.chan_refused;
        continue;
      }
      ++walk.compared;
      sums.bound += bound->trace();
      sums.likelihood += (fix->position - truth).squaredNorm();
      sums.chan += (chan->position - truth).squaredNorm();
    }
    if (fixes.empty()) continue;
    FuseOptions<double> fusing;
    if (previous) fusing.preferred = previous->leading;
    const auto fused = known(fuse_and_learn(building.subnets, fixes, fusing));
    const Point error = fused.fix.position - blink->tag;
    const Mat<double, 3>& covariance = fused.fix.covariance;
    ++walk.located;
    sums.squares += error.squaredNorm();
    sums.normalised += dot<double, 3>(error, Ldlt<double, 3>{covariance}.solve(error));
    if (previous && heard != heard_before) {
      ++walk.borders;
      const Point step = error - previous_error;
      const Ldlt<double, 3> both{Mat<double, 3>{covariance + previous->fix.covariance}};
      walk.worst_step =
          std::max(walk.worst_step, std::sqrt(dot<double, 3>(step, both.solve(step))));
    }
    walk.track.push_back(fused.fix.position);
    walk.truth.push_back(blink->tag);
    previous = fused;
    previous_error = error;
    heard_before = heard;
  }
  const auto n = static_cast<double>(walk.located);
  walk.rms = std::sqrt(sums.squares / n);
  walk.nees = sums.normalised / n;
  walk.likelihood_ratio = sums.likelihood / sums.bound;
  walk.chan_ratio = sums.chan / sums.bound;
  return walk;
}

std::optional<std::string> building_svg(const BuildingWalk& walk) {
  std::string script = picture_preamble(680) +
                       "set size ratio -1\nset xlabel 'x [m]'\nset ylabel 'y [m]'\n"
                       "set xrange [-2:42]\nset yrange [-2:42]\n"
                       "set arrow from 20,-2 to 20,42 nohead dt 2 lc rgb '#8a95a3'\n"
                       "set arrow from -2,20 to 42,20 nohead dt 2 lc rgb '#8a95a3'\n";
  const auto block = [&](std::string_view name, const std::vector<Point>& points) {
    std::string lines;
    for (const Point& p : points) lines += fmt::format("{:.3f} {:.3f}\n", p.x(), p.y());
    script += data_block(name, lines);
  };
  block("truth", walk.truth);
  block("track", walk.track);
  block("anchors", walk.anchors);
  script +=
      "plot $truth with lines lc rgb '#8a95a3' lw 1.5 title 'true walk', "
      "$track with points pt 7 ps 0.3 lc rgb '#2563eb' title 'track', "
      "$anchors with points pt 9 ps 1 lc rgb '#1b2430' title 'anchors'\n";
  return run_gnuplot(script);
}

void show_building(const std::filesystem::path& out) {
  const BuildingWalk walk = walk_through_building(4);
  fmt::print(
      "\n5. Range differences: a building of four subnets, each with its own clock and frame, and "
      "a\n"
      "   tag that only blinks. From the anchors' stamps to one track in one map.\n\n");
  const auto row = [](std::string_view what, const std::string& value) {
    fmt::print("  {:<50}{:>12}\n", what, value);
  };
  row("squared error over the bound, Chan alone", fmt::format("{:.2f}", walk.chan_ratio));
  row("  maximum likelihood (what uwbpos uses)", fmt::format("{:.2f}", walk.likelihood_ratio));
  row("differences that Chan alone could not solve",
      fmt::format("{} of {}", walk.chan_refused, walk.chan_refused + walk.compared));
  row("blinks located in the map", fmt::format("{} of {}", walk.located, walk.blinks));
  row("  their error, rms", fmt::format("{:.2f} m", walk.rms));
  row("  squared over the covariance claimed (3 wanted)", fmt::format("{:.2f}", walk.nees));
  row(fmt::format("worst step at a border, of {} crossed", walk.borders),
      fmt::format("{:.1f} σ", walk.worst_step));
  const std::filesystem::path folder = out / "building";
  make_directory(folder);
  if (const auto svg = building_svg(walk)) {
    write_file(folder / "walk.svg", *svg);
    fmt::print("\n   The walk, to scale: {}\n", (folder / "walk.svg").string());
  } else {
    fmt::print("\n   No picture: gnuplot could not be run.\n");
  }
}

}  // namespace uwbpos::host
