// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The devices of a site and the frames between them, each stamped by clocks of its own. A frame
/// that its sender stamps at t leaves the antenna at t + d_s/2 and is stamped by a receiver,
///   (1) \f$ t + d_s/2 + (|p_r - p_s| + \text{excess})/c + d_r/2 + \text{noise} \f$,
/// as in sim/exchange.hpp. All clocks are moved on together, and every frame draws the same count
/// of random numbers whether it is lost or not: two runs that differ in their losses alone have
/// the same clocks, noise and walls.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "uwbpos/core/types.hpp"
#include "uwbpos/sim/blockage.hpp"
#include "uwbpos/sim/device_clock.hpp"
#include "uwbpos/sim/exchange.hpp"
#include "uwbpos/sim/instant.hpp"
#include "uwbpos/sim/noise.hpp"
#include "uwbpos/sim/path.hpp"
#include "uwbpos/sim/radio.hpp"
#include "uwbpos/sim/site.hpp"
#include "uwbpos/time/device_time.hpp"

namespace uwbpos::sim {

/// A frame on its way.
struct Departure {
  DeviceTime<> tx;       ///< as its sender stamps it
  Instant stamped{};     ///< when its sender's clock shows that
  double delay = 0;      ///< until it leaves the antenna: half the sender's, and noise [s]
  Motion sender{};       ///< where the sender was when the frame was ordered, at `begin`
  Instant begin{};       ///< when the frame was ordered
  std::int64_t host{0};  ///< when the host sees it [µs]
};

/// A frame at one receiver.
struct Reception {
  bool received = false;  ///< neither lost nor out of reach; what follows holds anyway
  DeviceTime<> rx;        ///< as the receiver stamps it
  double distance = 0;    ///< that it really travelled, in a straight line [m]
  double excess = 0;      ///< and more than that [m]
};

/// Devices and links of a running site. About 40 kB; never allocates.
class Air {
 public:
  /// Draws the devices of a valid site.
  explicit Air(const Site& site)
      : link_stream_{site.seed, "links"},
        frame_stream_{site.seed, "frames"},
        clock_stream_{site.seed, "clocks"},
        host_stream_{site.seed, "host"} {
    Random random{site.seed, "devices"};
    for (Device& device : tags_) device = make_device(site.radio, site.start, random);
    for (Device& device : anchors_) device = make_device(site.radio, site.start, random);
  }

  /// Moves all clocks on.
  void advance_to(const Site& site, Instant instant) {
    for (int tag = 0; tag < site.tag_count; ++tag) move(tags_[index(tag)], instant);
    for (int subnet = 0; subnet < site.subnet_count; ++subnet) {
      const int count = site.subnets[index(subnet)].anchors.size();
      for (int anchor = 0; anchor < count; ++anchor) {
        move(anchors_[place(subnet, anchor)], instant);
      }
    }
  }

  /// A frame that an anchor sends at `begin` or within the radio's grid after it. Clocks have
  /// been moved on to `begin`.
  [[nodiscard]] Departure send_from_anchor(const Site& site, int subnet, int anchor,
                                           Instant begin) {
    const Vec<double, 3>& at = site.subnets[index(subnet)].anchors[anchor].position;
    return send(site, anchors_[place(subnet, anchor)], Motion{at}, begin);
  }

  /// A frame that a tag sends.
  [[nodiscard]] Departure send_from_tag(const Site& site, int tag, Instant begin) {
    return send(site, tags_[index(tag)], motion_of_tag(site, tag, begin), begin);
  }

  /// One anchor's frame at another of its subnet.
  [[nodiscard]] Reception anchor_to_anchor(const Site& site, const Departure& frame, int subnet,
                                           int anchor) {
    const Vec<double, 3>& at = site.subnets[index(subnet)].anchors[anchor].position;
    return receive(site, frame, anchors_[place(subnet, anchor)], Motion{at}, 0, 1e9);
  }

  /// A frame between a tag and an anchor, whichever sent it.
  [[nodiscard]] Reception tag_and_anchor(const Site& site, const Departure& frame, int tag,
                                         int subnet, int anchor, bool from_tag) {
    const Vec<double, 3>& at = site.subnets[index(subnet)].anchors[anchor].position;
    const Motion moving = motion_of_tag(site, tag, frame.begin);
    Link& link = links_[index(tag) * anchors_.size() + place(subnet, anchor)];
    link = update(link, site.blockage, frame.begin, link_stream_);
    const std::span<const Wall> walls{site.walls.data(), index(site.wall_count)};
    const double excess = link.excess + wall_excess(walls, moving.position, at);
    return from_tag ? receive(site, frame, anchors_[place(subnet, anchor)], Motion{at}, excess,
                              site.reach)
                    : receive(site, frame, tags_[index(tag)], moving, excess, site.reach);
  }

  /// Where a tag is and how it moves at an instant.
  [[nodiscard]] static Motion motion_of_tag(const Site& site, int tag, Instant instant) {
    return tag_motion(state_at(site.path, instant - site.start), site.tags[index(tag)].lever);
  }

  /// The radio of a tag as it is now.
  [[nodiscard]] const Device& tag(int tag) const { return tags_[index(tag)]; }
  /// The radio of an anchor as it is now.
  [[nodiscard]] const Device& anchor(int subnet, int anchor) const {
    return anchors_[place(subnet, anchor)];
  }
  /// The same, to be restarted or warmed by whoever runs the site.
  [[nodiscard]] Device& anchor(int subnet, int anchor) { return anchors_[place(subnet, anchor)]; }

 private:
  static constexpr std::size_t index(int i) { return static_cast<std::size_t>(i); }
  static constexpr std::size_t place(int subnet, int anchor) {
    return index(subnet * kMaxSubnetAnchors + anchor);
  }

  void move(Device& device, Instant instant) {
    device.clock = advance(device.clock, instant, clock_stream_);
  }

  Departure send(const Site& site, const Device& from, const Motion& motion, Instant begin) {
    const Reading now = read(from.clock, begin);
    const std::int64_t tx =
        detail::on_grid(now.ticks + (now.fraction > 0 ? 1 : 0), site.radio.tx_grid);
    const double late = host_stream_.uniform(0, site.host_latency);
    return {.tx = counter(tx),
            .stamped = when(from.clock, tx),
            .delay = from.antenna_delay / 2 + site.radio.sigma_tx * frame_stream_.normal(),
            .sender = motion,
            .begin = begin,
            .host = std::llround((to_seconds(begin) + late) * 1e6)};
  }

  // Equation (1).
  Reception receive(const Site& site, const Departure& frame, const Device& to,
                    const Motion& motion, double excess, double reach) {
    const Instant left = frame.stamped + frame.delay;
    const auto flight =
        detail::fly(frame.begin, left, frame.sender, motion, excess, site.radio.propagation_speed);
    const double noise = site.radio.sigma_rx * frame_stream_.normal();
    const bool lost = frame_stream_.chance(site.radio.loss);
    const std::int64_t rx = stamp(to.clock, flight.arrival + to.antenna_delay / 2, noise);
    return {.received = !lost && flight.distance <= reach,
            .rx = counter(rx),
            .distance = flight.distance,
            .excess = excess};
  }

  static constexpr std::size_t kAnchors = std::size_t{kMaxSubnets} * kMaxSubnetAnchors;

  std::array<Device, kMaxTags> tags_{};
  std::array<Device, kAnchors> anchors_{};
  std::array<Link, kMaxTags * kAnchors> links_{};
  Random link_stream_;
  Random frame_stream_;
  Random clock_stream_;
  Random host_stream_;
};

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
