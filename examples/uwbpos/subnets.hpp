// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The subnets of a site: which anchors are whose, and how their frames lie in the map.

#include <filesystem>
#include <map>
#include <vector>

#include "uwbpos/frames/make_transform.hpp"

#include "csv.hpp"
#include "formats.hpp"

namespace uwbpos::host {

/// One subnet. Its frame is level: turned about z and moved.
struct SubnetFrame {
  Id id;
  Id control_anchor;
  Transform<double, 2> map_T_subnet;  ///< in plan
  Measured<double> height;            ///< of its frame's floor in the map [m, m²]
  double fit_rms = 0;                 ///< of shared points [m]; 0 where the transform was given
};

/// All subnets; empty when the site is one frame.
struct SubnetTable {
  std::vector<SubnetFrame> frames;
  std::map<Id, std::size_t> of_anchor;  ///< place in `frames`
  Points local;                         ///< anchors in their subnets' frames [m]

  [[nodiscard]] bool empty() const { return frames.empty(); }
};

/// The most subnets that fit a site.
inline constexpr int kMostSubnets = 8;

/// Reads subnets.csv, and `subnet_id` of the anchors' file. `anchors`, in their subnets' frames,
/// become positions in the map. A row of subnets.csv is either a transform
/// (`subnet_id,control_anchor_id,x_m,y_m,z_m,yaw_deg`: where the control anchor is in the map and
/// where the frame's x axis points, counter-clockwise from the map's) or, with `anchor_id` in place
/// of `yaw_deg`, an anchor of the subnet surveyed in the map; two or more of those are fitted.
/// `sigma_m` (of a transform 0, of a surveyed anchor 0.05 unless given) and `sigma_yaw_deg` say how
/// well it is known. Throws `Failure`.
[[nodiscard]] SubnetTable read_subnets(const std::filesystem::path& file,
                                       const std::filesystem::path& anchors_file, Points& anchors,
                                       Problems& problems);

}  // namespace uwbpos::host
