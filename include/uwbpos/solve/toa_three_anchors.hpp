// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The simplified TOA of the delivery robot: a position in the plane from three anchors by bare
/// arithmetic, without roots, weights, mirror images or a covariance. What `toa_closed_form` also
/// judges costs some ten times as much.

#include <array>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "uwbpos/core/lanes.hpp"
#include "uwbpos/core/linalg.hpp"
#include "uwbpos/model/range_set.hpp"

namespace uwbpos {

namespace detail {

/// Why there is no answer, or the one that is finite though the sum of its coordinates is not.
/// `known`: anchors and ranges; `degenerate`: the anchors.
template <class S>
[[nodiscard, gnu::cold, gnu::noinline]] Result<Vec<S, 2>> doubtful_position(
    const Vec<S, 9>& known, bool degenerate, const Vec<S, 2>& position) {
  if (!all_finite(known)) return std::unexpected(Error::NotFinite);
  if (known.template tail<3>().minCoeff() < S(0)) return std::unexpected(Error::NegativeRange);
  if (degenerate) return std::unexpected(Error::DegenerateGeometry);
  if (!all_finite(position)) return std::unexpected(Error::NumericOverflow);
  return position;
}

/// The same of anchors on axes.
template <class S>
[[nodiscard, gnu::cold, gnu::noinline]] Result<Vec<S, 2>> doubtful_on_axes(
    S d1, S d2, S d3, S x2, S y3, const Vec<S, 2>& position) {
  Vec<S, 9> known;
  known << S(0), S(0), x2, S(0), S(0), y3, d1, d2, d3;
  return doubtful_position<S>(known, x2 == S(0) || y3 == S(0), position);
}

}  // namespace detail

/// (000-15): three anchors anywhere but in a line. Differences of the squares, with b = a₂ − a₁, c
/// = a₃ − a₁, and s from a₁:
/// \f[ b^T s = \tfrac12 (r_1^2 - r_2^2 + |b|^2) = u, \quad c^T s = \tfrac12 (r_1^2 - r_3^2 +
///     |c|^2) = v, \quad s = \frac{(u c_y - v b_y,\; b_x v - c_x u)}{b_x c_y - b_y c_x}. \f]
/// Exact on exact ranges [m]; the three weigh alike, their sigmas are not read. One division, no
/// allocation. Errors: Error::NotFinite; Error::NegativeRange; Error::DegenerateGeometry, anchors
/// in a line to working precision; Error::NumericOverflow.
template <class S>
[[nodiscard]] Result<Vec<S, 2>> toa_three_anchors(const std::array<RangeTo<S, 2>, 3>& ranges) {
  const auto& [first, second, third] = ranges;
  const S bx = second.anchor[0] - first.anchor[0];
  const S by = second.anchor[1] - first.anchor[1];
  const S cx = third.anchor[0] - first.anchor[0];
  const S cy = third.anchor[1] - first.anchor[1];
  const S bb = bx * bx + by * by;
  const S cc = cx * cx + cy * cy;
  const S u = (first.range - second.range) * (first.range + second.range) + bb;
  const S v = (first.range - third.range) * (first.range + third.range) + cc;
  const S area = bx * cy - by * cx;
  const S inverse = S(0.5) / area;
  const S x = first.anchor[0] + (u * cy - v * by) * inverse;
  const S y = first.anchor[1] + (bx * v - cx * u) * inverse;
  constexpr S kRounding = S(16) * std::numeric_limits<S>::epsilon();
  const bool spans = std::abs(area) > kRounding * (bb + cc);
  const S least = lesser(first.range, lesser(second.range, third.range));
  // What is not finite is not finite in the end.
  if (spans && least >= (x + y) * S(0)) return Result<Vec<S, 2>>{std::in_place, x, y};
  Vec<S, 9> known;
  known << first.anchor, second.anchor, third.anchor, first.range, second.range, third.range;
  return detail::doubtful_position<S>(known, !spans && std::isfinite(bb + cc), {x, y});
}

/// (000-16): anchors at (0, 0), (x2, 0) and (0, y3) at ranges d1, d2, d3 [m]:
/// \f[ x = \frac{d_1^2 - d_2^2 + x_2^2}{2 x_2}, \qquad y = \frac{d_1^2 - d_3^2 + y_3^2}{2 y_3}. \f]
/// Two divisions, no allocation. Errors: Error::NotFinite; Error::NegativeRange;
/// Error::DegenerateGeometry when x2 or y3 is 0; Error::NumericOverflow.
template <class S>
[[nodiscard]] inline Result<Vec<S, 2>> toa_on_axes(S d1, S d2, S d3, S x2, S y3) {
  // What is not finite, or divides by zero, is not finite in the end.
  const auto coordinate = [](const auto& near, const auto& far,
                             const auto& axis) __attribute__((always_inline)) {
    const auto at = ((near - far) * (near + far) / axis + axis) * S(0.5);
    return std::pair{at, lesser(near, far) >= at * S(0)};
  };
  using Pair = typename PairOf<S>::Type;
  S x;
  S y;
  bool sound = false;
  if constexpr (std::is_void_v<Pair>) {
    const auto [along_x, sound_x] = coordinate(d1, d2, x2);
    const auto [along_y, sound_y] = coordinate(d1, d3, y3);
    x = along_x;
    y = along_y;
    sound = sound_x && sound_y;
  } else {
    const auto [at, both] = coordinate(Pair{d1, d1}, Pair{d2, d3}, Pair{x2, y3});
    x = at[0];
    y = at[1];
    sound = is_certain(both);
  }
  if (sound) return Result<Vec<S, 2>>{std::in_place, x, y};
  return detail::doubtful_on_axes<S>(d1, d2, d3, x2, y3, {x, y});
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
