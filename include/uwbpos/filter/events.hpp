// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a tracker remembers of a measurement.

#include <cstdint>
#include <variant>

#include "uwbpos/filter/measurements.hpp"

namespace uwbpos {

/// A range to `b`, or a difference b − a, with anchors and tag looked up.
template <class S>
struct ArrivalEvent {
  Vec<S, 3> a;                 ///< where anchor a is [m]
  Vec<S, 3> b;                 ///< where anchor b is [m]
  Vec<S, 3> lever;             ///< of the tag, in the body's frame [m]
  S value;                     ///< [m]
  S variance;                  ///< [m²]
  std::uint32_t anchor_a;      ///< id
  std::uint32_t anchor_b;      ///< id
  std::uint32_t tag;           ///< id
  int bias_a = -1;             ///< place of its bias, −1 without one
  int bias_b = -1;             ///< place of its bias, −1 without one
  bool is_difference = false;  ///< else a range
  bool shared = false;         ///< see `TimedDifference`
};

/// A single number about the body.
template <class S>
struct ScalarEvent {
  /// Which number.
  enum class Kind : std::uint8_t { Height, Heading, Speed, TurnRate };
  Kind kind;   ///< which
  S value;     ///< its unit is the kind's
  S variance;  ///< squared
};

/// Anything that a tracker was fed.
template <class S>
struct Event {
  std::int64_t time;  ///< [µs]
  std::variant<ArrivalEvent<S>, ImuSample<S>, ScalarEvent<S>, TimedPosition<S>, TimedVelocity<S>>
      what;           ///< one of them
  bool used = false;  ///< by the track as it stands
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
