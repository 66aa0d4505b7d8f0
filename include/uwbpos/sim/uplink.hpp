// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Simulated runs of uplink range differences: control anchors send sync frames, tags blink, and
/// every anchor that hears either stamps it.
///
/// \code
/// sim::UplinkScenario scenario;
/// sim::add(scenario.site, *sim::make_subnet(anchors, 1));
/// auto run = sim::UplinkSimulation::start(scenario);
/// while (const auto event = run->next()) {
///   if (const auto* frame = std::get_if<sim::SyncFrame>(&*event)) ...   // ClockSync::update
///   if (const auto* blink = std::get_if<sim::Blink>(&*event)) ...       // anchor_arrival
/// }
/// \endcode
///
/// Subnet k of m sends its n-th sync frame (n + k/m)/sync_rate after the start; tag k of m blinks
/// for the n-th time (n + (k + ½)/m)/blink_rate after it. One blink is heard by anchors of all
/// subnets. The site's `radio.loss` applies to each reception by itself.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <variant>

#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/sim/air.hpp"
#include "uwbpos/sim/instant.hpp"
#include "uwbpos/sim/path.hpp"
#include "uwbpos/sim/site.hpp"
#include "uwbpos/time/device_time.hpp"

namespace uwbpos::sim {

/// A site and its timetable.
struct UplinkScenario {
  Site site{};             ///< who is there
  double sync_rate = 10;   ///< sync frames of a control anchor in a second
  double blink_rate = 10;  ///< blinks of a tag in a second
};

/// A sync frame: what its control anchor and the anchors of its subnet saw of it.
struct SyncFrame {
  int subnet = 0;             ///< place in `Site::subnets`
  std::int64_t sequence = 0;  ///< counted from zero in each subnet
  Instant time{};             ///< when it was sent
  std::int64_t host = 0;      ///< when the host sees it [µs]
  DeviceTime<> tx;            ///< on the control anchor's clock
  /// By the anchors' places in their subnet; the control anchor does not receive its own.
  std::array<Reception, kMaxSubnetAnchors> receptions{};
};

/// A blink: what anchors saw of it, and the truth.
struct Blink {
  std::uint32_t tag_id = 0;                     ///< whose
  std::int64_t sequence = 0;                    ///< counted from zero for each tag
  Instant time{};                               ///< when it was sent
  std::int64_t host = 0;                        ///< when the host sees it [µs]
  BodyState body{};                             ///< where the body was
  Vec<double, 3> tag = Vec<double, 3>::Zero();  ///< where the tag's antenna was, in the map [m]
  /// By the subnets' places in the site and the anchors' places in their subnet.
  std::array<std::array<Reception, kMaxSubnetAnchors>, kMaxSubnets> receptions{};
};

/// What happens next.
using UplinkEvent = std::variant<SyncFrame, Blink>;

/// A run in progress. About 50 kB, the scenario among it; never allocates.
class UplinkSimulation {
 public:
  /// Draws the devices. Errors: InvalidOption (counts beyond their arrays, anything outside its
  /// domain, rates beyond 100 kHz, a path that never ends).
  [[nodiscard]] static Result<UplinkSimulation> start(const UplinkScenario& scenario) {
    const auto rate = [](double x) { return 0 < x && x <= 1e5; };
    if (!detail::is_valid(scenario.site) || !rate(scenario.sync_rate) ||
        !rate(scenario.blink_rate)) {
      return std::unexpected(Error::InvalidOption);
    }
    return UplinkSimulation{scenario};
  }

  /// The next event in order of time; nothing once the path has ended.
  [[nodiscard]] std::optional<UplinkEvent> next() {
    const Site& site = scenario_.site;
    const double sync = turn(syncs_, site.subnet_count, 0.0, scenario_.sync_rate);
    const double blink = turn(blinks_, site.tag_count, 0.5, scenario_.blink_rate);
    const double since = sync <= blink ? sync : blink;
    if (!(since < end_)) return std::nullopt;
    const Instant begin = site.start + since;
    air_.advance_to(site, begin);
    if (sync <= blink) return sync_frame(begin);
    return blinked(begin);
  }

  /// The devices as they are now, to be looked at or interfered with.
  [[nodiscard]] Air& air() { return air_; }

  /// What is being run.
  [[nodiscard]] const UplinkScenario& scenario() const { return scenario_; }

 private:
  explicit UplinkSimulation(const UplinkScenario& scenario)
      : scenario_{scenario}, air_{scenario.site} {
    const double lasts = duration(scenario.site.path);
    end_ = lasts > 0 ? lasts : 1 / scenario.blink_rate;
  }

  // When it is whose turn for the n-th time: `count` of them, one after the other.
  static double turn(std::int64_t n, int count, double phase, double rate) {
    const std::int64_t round = n / count;
    const std::int64_t place = n % count;
    return (static_cast<double>(round) + (static_cast<double>(place) + phase) / count) / rate;
  }

  UplinkEvent sync_frame(Instant begin) {
    const Site& site = scenario_.site;
    SyncFrame frame;
    frame.subnet = static_cast<int>(syncs_ % site.subnet_count);
    frame.sequence = syncs_++ / site.subnet_count;
    const Subnet& subnet = site.subnets[static_cast<std::size_t>(frame.subnet)];
    const Departure sent = air_.send_from_anchor(site, frame.subnet, subnet.control, begin);
    frame.time = sent.stamped;
    frame.host = sent.host;
    frame.tx = sent.tx;
    for (int anchor = 0; anchor < subnet.anchors.size(); ++anchor) {
      if (anchor == subnet.control) continue;
      frame.receptions[static_cast<std::size_t>(anchor)] =
          air_.anchor_to_anchor(site, sent, frame.subnet, anchor);
    }
    return frame;
  }

  UplinkEvent blinked(Instant begin) {
    const Site& site = scenario_.site;
    const int tag = static_cast<int>(blinks_ % site.tag_count);
    const Departure sent = air_.send_from_tag(site, tag, begin);
    Blink blink;
    blink.tag_id = site.tags[static_cast<std::size_t>(tag)].id;
    blink.sequence = blinks_++ / site.tag_count;
    blink.time = sent.stamped;
    blink.host = sent.host;
    blink.body = state_at(site.path, sent.stamped - site.start);
    blink.tag = Air::motion_of_tag(site, tag, sent.stamped).position;
    for (int subnet = 0; subnet < site.subnet_count; ++subnet) {
      const auto place = static_cast<std::size_t>(subnet);
      for (int anchor = 0; anchor < site.subnets[place].anchors.size(); ++anchor) {
        blink.receptions[place][static_cast<std::size_t>(anchor)] =
            air_.tag_and_anchor(site, sent, tag, subnet, anchor, true);
      }
    }
    return blink;
  }

  UplinkScenario scenario_;
  Air air_;
  double end_ = 0;
  std::int64_t syncs_ = 0;
  std::int64_t blinks_ = 0;
};

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
