// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Simulated runs of downlink range differences: anchors send in turn, each packet carries when it
/// was sent and when its sender heard the last packets of the others, and tags that only listen
/// stamp what they hear.
///
/// In round n, which begins n/round_rate after the start, every anchor sends once, subnet by
/// subnet, anchors in the order of their ids, one in each slot. Anchors hear those of their own
/// subnet, tags all within reach. The site's `radio.loss` applies to each reception by itself.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/sim/air.hpp"
#include "uwbpos/sim/instant.hpp"
#include "uwbpos/sim/path.hpp"
#include "uwbpos/sim/site.hpp"
#include "uwbpos/time/device_time.hpp"

namespace uwbpos::sim {

/// A site and its timetable.
struct DownlinkScenario {
  Site site{};             ///< who is there
  double round_rate = 10;  ///< rounds in a second
  double slot = 2e-3;      ///< from one packet to the next within a round [s]
};

/// What a packet says of another anchor's last packet.
struct Heard {
  bool valid = false;         ///< whether the sender has heard it at all
  std::int64_t sequence = 0;  ///< the round of the packet that was heard
  DeviceTime<> rx;            ///< on the clock of the anchor that heard it
};

/// What a tag saw of a packet, and the truth.
struct TagReception {
  Reception reception{};                        ///< the tag's stamp, the distance, the excess
  std::uint32_t tag_id = 0;                     ///< whose
  Vec<double, 3> tag = Vec<double, 3>::Zero();  ///< where the tag's antenna was, in the map [m]
};

/// A packet.
struct Packet {
  int subnet = 0;                                ///< of its sender: place in `Site::subnets`
  int anchor = 0;                                ///< the sender: place in its subnet
  std::uint32_t anchor_id = 0;                   ///< and its id
  std::int64_t sequence = 0;                     ///< the round
  Instant time{};                                ///< when it was sent
  std::int64_t host = 0;                         ///< when the host sees it [µs]
  DeviceTime<> tx;                               ///< on the sender's clock
  std::array<Heard, kMaxSubnetAnchors> heard{};  ///< by the anchors' places in the subnet
  std::array<TagReception, kMaxTags> tags{};     ///< by the tags' places in the site
};

/// A run in progress. About 100 kB, the scenario among it; never allocates.
class DownlinkSimulation {
 public:
  /// Draws the devices. Errors: InvalidOption (counts beyond their arrays, anything outside its
  /// domain, a path that never ends, slots that do not fit a round).
  [[nodiscard]] static Result<DownlinkSimulation> start(const DownlinkScenario& scenario) {
    if (!detail::is_valid(scenario.site) || !(scenario.round_rate > 0) ||
        !(scenario.round_rate <= 1e5) || !(scenario.slot >= 1e-5) ||
        !(anchor_count(scenario.site) * scenario.slot <= 1 / scenario.round_rate)) {
      return std::unexpected(Error::InvalidOption);
    }
    return DownlinkSimulation{scenario};
  }

  /// The next packet; nothing once the path has ended.
  [[nodiscard]] std::optional<Packet> next() {
    const Site& site = scenario_.site;
    const double since =
        static_cast<double>(round_) / scenario_.round_rate + slot_ * scenario_.slot;
    if (!(since < end_)) return std::nullopt;
    const Instant begin = site.start + since;
    air_.advance_to(site, begin);

    const auto place = static_cast<std::size_t>(subnet_);
    const auto sender = static_cast<std::size_t>(anchor_);
    const Subnet& subnet = site.subnets[place];
    const Departure sent = air_.send_from_anchor(site, subnet_, anchor_, begin);
    Packet packet;
    packet.subnet = subnet_;
    packet.anchor = anchor_;
    packet.anchor_id = subnet.anchors[anchor_].id;
    packet.sequence = round_;
    packet.time = sent.stamped;
    packet.host = sent.host;
    packet.tx = sent.tx;
    packet.heard = heard_[place][sender];
    for (int other = 0; other < subnet.anchors.size(); ++other) {
      if (other == anchor_) continue;
      const Reception reception = air_.anchor_to_anchor(site, sent, subnet_, other);
      if (!reception.received) continue;
      heard_[place][static_cast<std::size_t>(other)][sender] = {true, round_, reception.rx};
    }
    for (int tag = 0; tag < site.tag_count; ++tag) {
      TagReception& at = packet.tags[static_cast<std::size_t>(tag)];
      at.tag_id = site.tags[static_cast<std::size_t>(tag)].id;
      at.reception = air_.tag_and_anchor(site, sent, tag, subnet_, anchor_, false);
      at.tag = Air::motion_of_tag(site, tag, sent.stamped).position;
    }
    step();
    return packet;
  }

  /// The devices as they are now, to be looked at or interfered with.
  [[nodiscard]] Air& air() { return air_; }

  /// What is being run.
  [[nodiscard]] const DownlinkScenario& scenario() const { return scenario_; }

 private:
  explicit DownlinkSimulation(const DownlinkScenario& scenario)
      : scenario_{scenario}, air_{scenario.site} {
    const double lasts = duration(scenario.site.path);
    end_ = lasts > 0 ? lasts : 1 / scenario.round_rate;
  }

  void step() {
    const Site& site = scenario_.site;
    ++slot_;
    if (++anchor_ < site.subnets[static_cast<std::size_t>(subnet_)].anchors.size()) return;
    anchor_ = 0;
    if (++subnet_ < site.subnet_count) return;
    subnet_ = 0;
    slot_ = 0;
    ++round_;
  }

  // By receiver, then sender.
  using Table = std::array<std::array<Heard, kMaxSubnetAnchors>, kMaxSubnetAnchors>;

  DownlinkScenario scenario_;
  Air air_;
  std::array<Table, kMaxSubnets> heard_{};
  double end_ = 0;
  std::int64_t round_ = 0;
  int subnet_ = 0;
  int anchor_ = 0;
  int slot_ = 0;
};

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
