// SPDX-License-Identifier: MIT
// The whole way from radio timestamps to a position, in the order that a tag goes it, with one
// simulated robot in a hall. Everything but the simulator runs unchanged on a microcontroller.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <string_view>

#include <uwbpos/sim/hall.hpp>
#include <uwbpos/sim/scenario.hpp>
#include <uwbpos/uwbpos.hpp>

namespace {

using namespace uwbpos;
using Real = float;  // as on a Cortex-M with a single-precision unit

constexpr Real kAnchorHeight = 3;
constexpr Real kTagHeight = 1;

// Estimate minus truth by received power, as measured once for an antenna (made up here).
constexpr std::array<RangeBiasPoint<Real>, 3> kBias{{{-95, 0.02f}, {-85, 0.0f}, {-75, -0.02f}}};

int complain(const char* what, Error error) {
  const std::string_view words = describe(error);
  std::printf("%s: %.*s\n", what, static_cast<int>(words.size()), words.data());
  return 1;
}

}  // namespace

int main() {
  // 1. Surveyed anchors, and a robot that drives between them.
  const auto hung = sim::hang_anchors({}, 4, sim::Placement::Corners);
  if (!hung) return complain("anchors", hung.error());
  sim::Route route{};
  for (const auto& corner : {Vec<double, 3>{5, 5, 1}, Vec<double, 3>{25, 15, 1}}) {
    if (const auto added = sim::add(route, corner); !added) return complain("route", added.error());
  }
  sim::Scenario scenario{.anchors = *hung, .path = route, .seed = 1};
  scenario.epoch_rate = 1;
  auto run = sim::Simulation::start(scenario);
  if (!run) return complain("simulation", run.error());

  const auto bias = RangeBias<Real>::make(kBias);
  if (!bias) return complain("bias table", bias.error());
  TwrOptions<Real> radio;  // antenna delays are what a calibration of the devices has given
  radio.antenna_delay_a = radio.antenna_delay_b = static_cast<Real>(scenario.radio.antenna_delay);

  std::array<RangeTo<Real, 2>, 4> ranges{};
  std::size_t count = 0;
  std::puts("    truth [m]      position [m]    ±1σ [m]    error [m]   HDOP");
  while (const auto shot = run->next()) {
    // 2. Six timestamps make a range, whatever the two clocks and reply times do.
    const auto stamps = sim::ds_stamps(shot->exchange);
    if (!stamps) continue;  // a frame was lost
    const auto slant = ds_twr_range<Real>(*stamps, radio);
    if (!slant) return complain("range", slant.error());

    // 3. Its bias by received power (on hardware the radio tells it), and its horizontal part.
    const auto unbiased = correct_range_bias(*slant, Real(-85), *bias);
    if (!unbiased) return complain("bias", unbiased.error());
    const auto flat = horizontal_range(*unbiased, kAnchorHeight, kTagHeight);
    if (!flat) return complain("height", flat.error());
    const Vec<Real, 2> anchor = shot->anchor.head<2>().cast<Real>();
    ranges[count++] = {anchor, flat->value, std::sqrt(flat->variance)};
    if (count < ranges.size()) continue;
    count = 0;

    // 4. Four ranges make a position, with its covariance.
    const auto fix = locate(ranges);
    if (!fix) return complain("position", fix.error());

    // 5. What the geometry would allow at best.
    std::array<Vec<Real, 2>, 4> anchors{};
    for (std::size_t i = 0; i < 4; ++i) anchors[i] = ranges[i].anchor;
    const auto dop = range_dop(anchors, fix->position);
    if (!dop) return complain("dilution", dop.error());

    const Vec<double, 2> truth = shot->tag.head<2>();
    const Vec<double, 2> at = fix->position.cast<double>();
    std::printf("%7.2f %7.2f  %7.2f %7.2f  %5.2f %5.2f  %9.3f  %5.2f\n", truth[0], truth[1], at[0],
                at[1], std::sqrt(static_cast<double>(fix->covariance(0, 0))),
                std::sqrt(static_cast<double>(fix->covariance(1, 1))), (at - truth).norm(),
                static_cast<double>(dop->hdop));
  }
  return 0;
}
