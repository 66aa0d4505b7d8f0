// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What planar motions share: the chord of an arc. A body with constant velocity u in its own axes
/// and turn rate ω moves in t by
/// \f[ \Delta p = t\,\mathrm{sinc}(h)\,R(m)\,u, \qquad h = \tfrac{\omega t}{2},\; m = \psi + h.
///     \tag{1} \f]

#include <cmath>

#include "uwbpos/core/trigonometry.hpp"

namespace uwbpos {

/// The factors of (1).
template <class S>
struct PlanarArc {
  S sinc;  ///< sin(h)/h
  S bend;  ///< its derivative by h
  S c;     ///< cos m
  S s;     ///< sin m
};

/// Those of a body that looks along `heading` [rad] and turns by 2·`half` [rad].
template <class S>
[[nodiscard]] PlanarArc<S> planar_arc(S heading, S half) {
  // The series' next terms are below 1e-14.
  const bool straight = std::abs(half) < S(1e-3);
  const S sinc = straight ? S(1) - half * half / S(6) : sine(half) / half;
  const S bend = straight ? -half / S(3) : (cosine(half) - sinc) / half;
  return {sinc, bend, cosine(heading + half), sine(heading + half)};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
