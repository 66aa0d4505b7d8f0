// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A site of several subnets and a body that carries tags through it: what uplink and downlink
/// runs of range differences have in common. Every subnet has a control anchor, whose position is
/// the origin of its own frame, and is turned against the map by its heading ψ (up stays up):
///   (1) \f$ p_{subnet} = R(\psi)^T (p_{map} - a_{control}) \f$.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/geometry/anchors.hpp"
#include "uwbpos/sim/blockage.hpp"
#include "uwbpos/sim/instant.hpp"
#include "uwbpos/sim/path.hpp"
#include "uwbpos/sim/radio.hpp"
#include "uwbpos/sim/route.hpp"
#include "uwbpos/sim/scenario.hpp"

namespace uwbpos::sim {

/// The most subnets of a site.
inline constexpr int kMaxSubnets = 8;
/// The most anchors of a subnet, its control anchor among them.
inline constexpr int kMaxSubnetAnchors = 16;

/// Anchors that share a control anchor's clock.
struct Subnet {
  Anchors<double, 3, kMaxSubnetAnchors> anchors{};  ///< positions in the map [m]
  int control = 0;                                  ///< place of the control anchor in `anchors`
  double heading = 0;                               ///< ψ of (1) [rad]
};

/// A subnet of anchors whose positions are given in the map.
/// Errors: UnknownAnchor (`control_id`), CapacityExceeded, NotFinite (the heading).
[[nodiscard]] inline Result<Subnet> make_subnet(const Anchors<double, 3>& anchors,
                                                std::uint32_t control_id, double heading = 0) {
  if (!std::isfinite(heading)) return std::unexpected(Error::NotFinite);
  if (!anchors.contains(control_id)) return std::unexpected(Error::UnknownAnchor);
  Subnet subnet;
  subnet.heading = heading;
  for (const Anchor<double, 3>& anchor : anchors) {
    if (anchor.id == control_id) subnet.control = subnet.anchors.size();
    if (const auto added = subnet.anchors.add(anchor.id, anchor.position); !added) {
      return std::unexpected(added.error());
    }
  }
  return subnet;
}

/// Equation (1): a point of the map in the subnet's own frame.
[[nodiscard]] inline Vec<double, 3> in_subnet(const Subnet& subnet, const Vec<double, 3>& point) {
  const Vec<double, 3> from = point - subnet.anchors[subnet.control].position;
  const double c = std::cos(subnet.heading);
  const double s = std::sin(subnet.heading);
  return {c * from(0) + s * from(1), c * from(1) - s * from(0), from(2)};
}

/// Everything that a run of range differences is made of but its timetable. A plain struct of
/// fixed size. `radio.loss` is that of sync frames, blinks and packets alike; its replies are
/// not used.
struct Site {
  std::array<Subnet, kMaxSubnets> subnets{};  ///< of which the first `subnet_count` are there
  int subnet_count = 0;                       ///< 1 … kMaxSubnets
  Path path = Route{};                        ///< of the body
  /// The first `tag_count` of `tags`; one tag of id 0 in the body's centre unless told.
  std::array<Tag, kMaxTags> tags{};
  int tag_count = 1;             ///< 1 … kMaxTags
  Radio radio = dw1000_radio();  ///< of tags and anchors alike
  /// How links between tags and anchors come and go. Anchors see each other: what excess their
  /// links have is part of the surveyed distance.
  Blockage blockage{};
  std::array<Wall, kMaxWalls> walls{};  ///< of which the first `wall_count` stand, for tags
  int wall_count = 0;                   ///< 0 … kMaxWalls
  double reach = 1e6;                   ///< tags farther away [m] are not heard, nor hear
  double host_latency = 2e-3;           ///< the host's time is late by up to this [s]
  Instant start{};                      ///< true time of the first event
  std::uint64_t seed = 1;               ///< of everything random
};

/// Appends a subnet. Errors: TooFewMeasurements (a subnet without anchors), InvalidOption (a
/// control anchor that is none of them), CapacityExceeded.
[[nodiscard]] inline Result<void> add(Site& site, const Subnet& subnet) {
  if (subnet.anchors.empty()) return std::unexpected(Error::TooFewMeasurements);
  if (subnet.control < 0 || subnet.control >= subnet.anchors.size()) {
    return std::unexpected(Error::InvalidOption);
  }
  if (site.subnet_count == kMaxSubnets) return std::unexpected(Error::CapacityExceeded);
  site.subnets[static_cast<std::size_t>(site.subnet_count++)] = subnet;
  return {};
}

/// Anchors of all subnets.
[[nodiscard]] inline int anchor_count(const Site& site) {
  int count = 0;
  for (int i = 0; i < site.subnet_count; ++i) {
    count += site.subnets[static_cast<std::size_t>(i)].anchors.size();
  }
  return count;
}

namespace detail {

// Everything of a site in its domain.
inline bool is_valid(const Site& site) {
  const Radio& radio = site.radio;
  const auto share = [](double x) { return 0 <= x && x <= 1; };
  const auto length = [](double x) { return 0 <= x && x < 1e9; };
  if (site.subnet_count < 1 || site.subnet_count > kMaxSubnets) return false;
  for (int i = 0; i < site.subnet_count; ++i) {
    const Subnet& subnet = site.subnets[static_cast<std::size_t>(i)];
    if (subnet.control < 0 || subnet.control >= subnet.anchors.size()) return false;
    if (!std::isfinite(subnet.heading)) return false;
  }
  return 1 <= site.tag_count && site.tag_count <= kMaxTags && 0 <= site.wall_count &&
         site.wall_count <= kMaxWalls && share(radio.loss) && share(site.blockage.probability) &&
         length(site.blockage.mean_duration) && length(site.blockage.minimum_excess) &&
         length(site.blockage.mean_excess) && length(radio.max_rate) && radio.max_rate < 1e-2 &&
         length(radio.rate_walk) && length(radio.sigma_rx) && length(radio.sigma_tx) &&
         std::isfinite(radio.antenna_delay) && length(radio.antenna_delay_spread) &&
         radio.tx_grid >= 1 && radio.propagation_speed > 0 && length(site.reach) &&
         length(site.host_latency) && length(duration(site.path));
}

}  // namespace detail
}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
