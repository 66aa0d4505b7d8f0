// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A route of a simulated robot over waypoints, with rounded corners.
///
/// A corner of a route between the unit directions \f$ u \f$ and \f$ v \f$, turning by
/// \f$ \theta \f$, is rounded by an arc of radius \f$ r \f$ that leaves the leg
/// \f$ \ell = r \tan(\theta/2) \f$ before the corner,
/// \f[ p(\varphi) = p_0 + r\,(\sin\varphi\,u + (1 - \cos\varphi)\,n),\quad
///     p'(\varphi)/r = \cos\varphi\,u + \sin\varphi\,n,\qquad
///     n = \frac{v - (u\cdot v)u}{|v - (u\cdot v)u|} \tag{1} \f]
/// and is traversed at the same speed as the legs. \f$ \ell \f$ never takes more than half a leg.
///
/// Sines differ by an ulp between C libraries: 1e-15 m here, 2e-13 ticks, so that less than one
/// stamp in 1e12 rounds otherwise.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"

namespace uwbpos::sim {

/// The most waypoints of a route and the most stops.
inline constexpr int kMaxWaypoints = 128;

/// The state of the robot's body.
struct BodyState {
  Vec<double, 3> position = Vec<double, 3>::Zero();  ///< [m]
  Vec<double, 3> velocity = Vec<double, 3>::Zero();  ///< [m/s]
  /// Unit vector in plan along the body's x; heading = atan2(forward_y, forward_x).
  Vec<double, 2> forward = Vec<double, 2>::UnitX();
  double turn_rate = 0;  ///< about +z [rad/s]
};

/// Heading [rad] in (−π, π].
[[nodiscard]] inline double heading(const BodyState& body) {
  return std::atan2(body.forward(1), body.forward(0));
}

/// Waypoints driven at constant speed with rounded corners, and a turn on the spot where the route
/// reverses. Looks where it goes; on a vertical stretch along +x.
struct Route {
  std::array<Vec<double, 3>, kMaxWaypoints> waypoints{};  ///< [m]; the first `size` count
  int size = 0;                                           ///< 0 … kMaxWaypoints
  double speed = 1;                                       ///< [m/s]
  double radius = 0.5;  ///< of corners [m]; less where legs are short
};

/// Appends a waypoint. Errors: NotFinite, CapacityExceeded.
[[nodiscard]] inline Result<void> add(Route& route, const Vec<double, 3>& waypoint) {
  if (!waypoint.allFinite()) return std::unexpected(Error::NotFinite);
  if (route.size == kMaxWaypoints) return std::unexpected(Error::CapacityExceeded);
  route.waypoints[static_cast<std::size_t>(route.size++)] = waypoint;
  return {};
}

/// `lanes` parallel lanes along x, there and back, that fill a rectangle between two corners at
/// the height of `low`. Errors: InvalidOption (fewer than 1 lane), CapacityExceeded.
[[nodiscard]] inline Result<Route> lawn_mower(const Vec<double, 3>& low, const Vec<double, 3>& high,
                                              int lanes) {
  if (lanes < 1) return std::unexpected(Error::InvalidOption);
  Route route;
  for (int lane = 0; lane < lanes; ++lane) {
    const double share = lanes == 1 ? 0.5 : static_cast<double>(lane) / (lanes - 1);
    const double y = low(1) + share * (high(1) - low(1));
    const bool back = lane % 2 == 1;
    for (const double x : {back ? high(0) : low(0), back ? low(0) : high(0)}) {
      if (const auto added = add(route, {x, y, low(2)}); !added) {
        return std::unexpected(added.error());
      }
    }
  }
  return route;
}

namespace detail {

// A corner of (1): `length` ℓ of leg that it takes on either side, `radius`, `angle` θ, `normal`.
struct Corner {
  double length = 0;
  double radius = 0;
  double angle = 0;
  Vec<double, 3> normal = Vec<double, 3>::Zero();
};

inline Vec<double, 3> leg(const Route& route, int i) {
  return route.waypoints[static_cast<std::size_t>(i) + 1] -
         route.waypoints[static_cast<std::size_t>(i)];
}

// The corner at waypoint i, straight on at the ends, at reversals and at repeated points.
inline Corner corner(const Route& route, int i) {
  if (i <= 0 || i >= route.size - 1 || !(route.radius > 0)) return {};
  const Vec<double, 3> before = leg(route, i - 1);
  const Vec<double, 3> after = leg(route, i);
  const double length_before = before.norm();
  const double length_after = after.norm();
  const bool both = length_before > 0 && length_after > 0;
  if (!both) return {};
  const Vec<double, 3> u = before / length_before;
  const Vec<double, 3> v = after / length_after;
  const double cosine = u.dot(v);
  const Vec<double, 3> across = v - cosine * u;
  const double sine = across.norm();
  if (sine < 1e-9 || cosine < -1 + 1e-9) return {};
  const double tangent = sine / (1 + cosine);
  const double length = std::min(route.radius * tangent, std::min(length_before, length_after) / 2);
  return {length, length / tangent, std::atan2(sine, cosine), across / sine};
}

inline void face(BodyState& body, const Vec<double, 3>& direction, double speed,
                 const Vec<double, 3>& bend) {
  body.velocity = speed * direction;
  const double in_plan = std::sqrt(direction(0) * direction(0) + direction(1) * direction(1));
  if (!(in_plan > 1e-9)) return;
  body.forward = Vec<double, 2>(direction(0), direction(1)) / in_plan;
  body.turn_rate = speed * (direction(0) * bend(1) - direction(1) * bend(0)) / (in_plan * in_plan);
}

}  // namespace detail

/// Length [m] of the rounded route; O(waypoints).
[[nodiscard]] inline double length(const Route& route) {
  double sum = 0;
  double behind = 0;
  for (int i = 0; i + 1 < route.size; ++i) {
    const detail::Corner ahead = detail::corner(route, i + 1);
    sum += std::max(0.0, detail::leg(route, i).norm() - behind - ahead.length);
    sum += ahead.radius * ahead.angle;
    behind = ahead.length;
  }
  return sum;
}

/// The body after `distance` metres of the route: at its start before zero, at its end, standing
/// still, beyond its length. O(waypoints).
[[nodiscard]] inline BodyState state_after(const Route& route, double distance) {
  BodyState body;
  if (route.size > 0) body.position = route.waypoints[0];
  double left = std::max(0.0, distance);
  detail::Corner behind{};
  for (int i = 0; i + 1 < route.size; ++i) {
    const Vec<double, 3> whole = detail::leg(route, i);
    const double whole_length = whole.norm();
    if (!(whole_length > 0)) continue;
    const Vec<double, 3> u = whole / whole_length;
    const detail::Corner ahead = detail::corner(route, i + 1);
    const double straight = std::max(0.0, whole_length - behind.length - ahead.length);
    const double driven = std::min(left, straight);
    body.position = route.waypoints[static_cast<std::size_t>(i)] + (behind.length + driven) * u;
    detail::face(body, u, route.speed, Vec<double, 3>::Zero());
    if (left < straight) return body;
    left -= straight;

    const double arc = ahead.radius * ahead.angle;
    if (arc > 0) {  // (1)
      const double phi = std::min(left, arc) / ahead.radius;
      const double sine = std::sin(phi);
      const double cosine = std::cos(phi);
      body.position += ahead.radius * (sine * u + (1 - cosine) * ahead.normal);
      detail::face(body, cosine * u + sine * ahead.normal, route.speed,
                   (cosine * ahead.normal - sine * u) / ahead.radius);
      if (left < arc) return body;
      left -= arc;
    }
    behind = ahead;
  }
  body.velocity.setZero();
  body.turn_rate = 0;
  return body;
}

/// The body `time` seconds after the start.
[[nodiscard]] inline BodyState state_at(const Route& route, double time) {
  return state_after(route, time * route.speed);
}

/// How long the route takes [s].
[[nodiscard]] inline double duration(const Route& route) { return length(route) / route.speed; }

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
