// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Rectangular halls hung with anchors.

#include <cmath>
#include <cstdint>

#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/geometry/anchors.hpp"

namespace uwbpos::sim {

/// How anchors are placed in a hall.
enum class Placement : std::uint8_t {
  /// On the axes: (0, 0), (width, 0), (0, depth), as (000-16) wants them. Three anchors.
  Axes,
  /// In the corners, counter-clockwise from the origin. One to four anchors.
  Corners,
  /// In the middles of the walls, counter-clockwise from the wall along x. One to four anchors.
  Edges,
  /// Evenly along the walls, counter-clockwise from the origin.
  Perimeter,
  /// In the middles of the cells of a grid, row by row; the last row may be short.
  Grid,
};

/// A hall over [0, width] × [0, depth]. Anchors hang at `height`, every second one at
/// `second_height`: let them differ where heights are to be solved for.
struct Hall {
  double width = 30;              ///< along x [m]
  double depth = 20;              ///< along y [m]
  double height = 3;              ///< of the first, third, … anchor [m]
  double second_height = height;  ///< of the second, fourth, … anchor [m]
};

namespace detail {

// The point `s` metres along the walls, counter-clockwise from the origin, 0 ≤ s < perimeter.
inline Vec<double, 2> on_walls(const Hall& hall, double s) {
  if (s < hall.width) return {s, 0};
  s -= hall.width;
  if (s < hall.depth) return {hall.width, s};
  s -= hall.depth;
  if (s < hall.width) return {hall.width - s, hall.depth};
  return {0, hall.depth - (s - hall.width)};
}

inline Vec<double, 2> in_grid(const Hall& hall, int index, int count) {
  int columns = 1;
  while (columns * columns * hall.depth < count * hall.width) ++columns;
  const int rows = (count + columns - 1) / columns;
  const int row = index / columns;
  const int in_row = row == rows - 1 ? count - row * columns : columns;
  return {hall.width * (index % columns + 0.5) / in_row, hall.depth * (row + 0.5) / rows};
}

}  // namespace detail

/// `count` anchors with the ids 1 … count.
/// Errors: InvalidOption (a count that the placement does not take, sizes that are not positive),
/// NotFinite, CapacityExceeded.
[[nodiscard]] inline Result<Anchors<double, 3>> hang_anchors(const Hall& hall, int count,
                                                             Placement placement) {
  const bool few = placement == Placement::Corners || placement == Placement::Edges;
  if (count < 1 || (few && count > 4) || (placement == Placement::Axes && count != 3) ||
      !(hall.width > 0) || !(hall.depth > 0)) {
    return std::unexpected(Error::InvalidOption);
  }
  const double w = hall.width;
  const double d = hall.depth;
  const Vec<double, 2> axes[] = {{0, 0}, {w, 0}, {0, d}};
  const Vec<double, 2> corners[] = {{0, 0}, {w, 0}, {w, d}, {0, d}};
  const Vec<double, 2> edges[] = {{w / 2, 0}, {w, d / 2}, {w / 2, d}, {0, d / 2}};
  Anchors<double, 3> anchors;
  for (int i = 0; i < count; ++i) {
    Vec<double, 2> plan = Vec<double, 2>::Zero();
    switch (placement) {
      case Placement::Axes:
        plan = axes[i];
        break;
      case Placement::Corners:
        plan = corners[i];
        break;
      case Placement::Edges:
        plan = edges[i];
        break;
      case Placement::Perimeter:
        plan = detail::on_walls(hall, 2 * (w + d) * i / count);
        break;
      case Placement::Grid:
        plan = detail::in_grid(hall, i, count);
        break;
    }
    const double height = i % 2 == 0 ? hall.height : hall.second_height;
    const auto added = anchors.add(static_cast<std::uint32_t>(i + 1), {plan(0), plan(1), height});
    if (!added) return std::unexpected(added.error());
  }
  return anchors;
}

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
