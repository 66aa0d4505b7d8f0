// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Paths of a simulated robot: where it is, how fast, and which way it looks, at any time; and
/// where the tags are that it carries.
///
/// A tag on a lever arm \f$ l \f$ (body frame: x forward, y left, z up) of a planar body at
/// \f$ p \f$ with heading \f$ \psi \f$ turning at \f$ \omega \f$:
/// \f[ p + R(\psi)\,l, \qquad v + \omega\,\hat z \times R(\psi)\,l \tag{1} \f]

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <variant>

#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/sim/exchange.hpp"
#include "uwbpos/sim/noise.hpp"
#include "uwbpos/sim/route.hpp"

namespace uwbpos::sim {

/// A circle in plan, counter-clockwise from its +x side. Looks along the circle.
struct Circle {
  Vec<double, 3> centre = Vec<double, 3>::Zero();  ///< [m]
  double radius = 1;                               ///< [m]
  double speed = 1;                                ///< [m/s]
  double laps = 1;                                 ///< not necessarily whole
};

/// Standing still at one place after another, without travel between; looks along +x.
struct Stops {
  std::array<Vec<double, 3>, kMaxWaypoints> places{};  ///< [m]; the first `size` count
  int size = 0;                                        ///< 0 … kMaxWaypoints
  double dwell = 1;                                    ///< time at each [s]
};

/// Any of the paths.
using Path = std::variant<Route, Circle, Stops>;

/// Appends a place. Errors: NotFinite, CapacityExceeded.
[[nodiscard]] inline Result<void> add(Stops& stops, const Vec<double, 3>& place) {
  if (!place.allFinite()) return std::unexpected(Error::NotFinite);
  if (stops.size == kMaxWaypoints) return std::unexpected(Error::CapacityExceeded);
  stops.places[static_cast<std::size_t>(stops.size++)] = place;
  return {};
}

/// `count` places uniform in the box between two corners.
/// Errors: InvalidOption (negative count), NotFinite, CapacityExceeded.
[[nodiscard]] inline Result<Stops> random_stops(const Vec<double, 3>& low,
                                                const Vec<double, 3>& high, int count,
                                                Random& random) {
  if (count < 0) return std::unexpected(Error::InvalidOption);
  Stops stops;
  for (int i = 0; i < count; ++i) {
    Vec<double, 3> place;
    for (int axis = 0; axis < 3; ++axis) place(axis) = random.uniform(low(axis), high(axis));
    if (const auto added = add(stops, place); !added) return std::unexpected(added.error());
  }
  return stops;
}

/// The body `time` seconds after the start; on a last lap after the end it stands still.
[[nodiscard]] inline BodyState state_at(const Circle& circle, double time) {
  constexpr double turn = 2 * std::numbers::pi;
  const double whole = turn * circle.laps;
  const double angle = std::clamp(time * circle.speed / circle.radius, 0.0, whole);
  const Vec<double, 3> outward{std::cos(angle), std::sin(angle), 0};
  BodyState body;
  body.position = circle.centre + circle.radius * outward;
  body.forward = Vec<double, 2>{-outward(1), outward(0)};
  if (angle < whole) {
    body.velocity = circle.speed * Vec<double, 3>{-outward(1), outward(0), 0};
    body.turn_rate = circle.speed / circle.radius;
  }
  return body;
}

/// How long all laps take [s].
[[nodiscard]] inline double duration(const Circle& circle) {
  return 2 * std::numbers::pi * circle.laps * circle.radius / circle.speed;
}

/// The body `time` seconds after the start. Within a billionth of a dwell before a change it is
/// at the next place already, so that multiples of a rounded dwell meet every place once.
[[nodiscard]] inline BodyState state_at(const Stops& stops, double time) {
  BodyState body;
  if (stops.size == 0) return body;
  const double place =
      std::clamp(std::floor(time / stops.dwell + 1e-9), 0.0, static_cast<double>(stops.size - 1));
  body.position = stops.places[static_cast<std::size_t>(place)];
  return body;
}

/// How long all stops take [s].
[[nodiscard]] inline double duration(const Stops& stops) { return stops.size * stops.dwell; }

/// The body on whatever path, `time` seconds after the start.
[[nodiscard]] inline BodyState state_at(const Path& path, double time) {
  if (const auto* route = std::get_if<Route>(&path)) return state_at(*route, time);
  if (const auto* circle = std::get_if<Circle>(&path)) return state_at(*circle, time);
  if (const auto* stops = std::get_if<Stops>(&path)) return state_at(*stops, time);
  return {};
}

/// How long whatever path takes [s].
[[nodiscard]] inline double duration(const Path& path) {
  if (const auto* route = std::get_if<Route>(&path)) return duration(*route);
  if (const auto* circle = std::get_if<Circle>(&path)) return duration(*circle);
  if (const auto* stops = std::get_if<Stops>(&path)) return duration(*stops);
  return 0;
}

/// Where a tag on a lever arm [m] is and how it moves, by (1).
[[nodiscard]] inline Motion tag_motion(const BodyState& body, const Vec<double, 3>& lever) {
  const double c = body.forward(0);
  const double s = body.forward(1);
  const Vec<double, 3> arm{c * lever(0) - s * lever(1), s * lever(0) + c * lever(1), lever(2)};
  const Vec<double, 3> swing{-body.turn_rate * arm(1), body.turn_rate * arm(0), 0};
  return {body.position + arm, body.velocity + swing};
}

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
