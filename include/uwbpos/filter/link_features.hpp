// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// How a link lies, as numbers for a bias network (004): what the antennas of tag and anchor see of
/// each other. In order: the offset anchor − tag in the map [m] (3), its length [m], its direction
/// in the map (3), its direction in the body (3), then one number for each anchor and one for each
/// tag, 1 for those of the link. The direction in the map is that at the anchor's antenna, turned
/// by what is the anchor's own; the direction in the body is that at the tag's.

#include <array>
#include <cstddef>

#include "uwbpos/core/linalg.hpp"

namespace uwbpos {

/// How many numbers tell of the geometry.
inline constexpr std::size_t kLinkGeometry = 10;

/// The inputs of a link. `offset`: anchor minus tag antenna in the map [m]; `map_R_body`: the
/// body's attitude; `anchor`, `tag`: their places among those that the network knows; one beyond
/// them has no number of its own, all are zero. A length of zero has no direction: zeros.
/// Some forty operations, one root; no allocation.
template <std::size_t Anchors, std::size_t Tags, class S>
[[nodiscard]] std::array<S, kLinkGeometry + Anchors + Tags> link_features(
    const Vec<S, 3>& offset, const Mat<S, 3>& map_R_body, std::size_t anchor, std::size_t tag) {
  std::array<S, kLinkGeometry + Anchors + Tags> inputs{};
  const S length = norm<S, 3>(offset);
  const S scale = length > S(0) ? S(1) / length : S(0);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    S ahead = S(0);
    for (Eigen::Index k = 0; k < 3; ++k) ahead += map_R_body(k, axis) * offset[k];
    inputs[i] = offset[axis];
    inputs[4 + i] = offset[axis] * scale;
    inputs[7 + i] = ahead * scale;
  }
  inputs[3] = length;
  if (anchor < Anchors) inputs[kLinkGeometry + anchor] = S(1);
  if (tag < Tags) inputs[kLinkGeometry + Anchors + tag] = S(1);
  return inputs;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
