// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What a reader of poses should know: why there are none, and whether they fit their ranges.

#include <optional>
#include <string>
#include <vector>

#include "replay.hpp"

namespace uwbpos::host {

/// How far apart two tags are, by their own positions and by their lever arms, in plan [m].
struct TagDistance {
  Id first;
  Id second;
  double measured;  ///< median of what lies along the lever arms' difference, which noise leaves
  double given;
};

/// The pair whose distances differ most in proportion, of those located together often enough.
[[nodiscard]] std::optional<TagDistance> oddest_tag_distance(const Points& tags, const Body& body,
                                                             const std::vector<Position>& track);

/// Median of χ² over its degrees of freedom, of the epochs that have any; 0 of none.
[[nodiscard]] double misfit_of(const Body& body);

/// A lever arm longer than the anchors are apart, as of a tags file in other units.
[[nodiscard]] std::optional<std::string> arm_remark(const Site& site);

/// Why no two poses give a twist over `span` [s], where none do.
[[nodiscard]] std::optional<std::string> twist_remark(const Body& body, double span);

/// How many poses do not see the target, and why.
[[nodiscard]] std::optional<std::string> target_remark(const Body& body,
                                                       const Vec<double, 2>& target);

/// One sentence each.
[[nodiscard]] std::vector<std::string> pose_remarks(const Site& site, const Replay& replay);

}  // namespace uwbpos::host
