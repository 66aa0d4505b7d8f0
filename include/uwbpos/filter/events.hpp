// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a tracker remembers of a measurement.

#include <cstdint>
#include <type_traits>
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
  bool expected = false;       ///< to be biased, by whatever `bias_sigma` says
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

/// Whether an event is a difference that shares an arrival with others of its time.
template <class S>
[[nodiscard]] bool is_shared(const Event<S>& event) {
  const auto* arrival = std::get_if<ArrivalEvent<S>>(&event.what);
  return arrival != nullptr && arrival->is_difference && arrival->shared;
}

/// Whether two events are one and the same measurement, told twice: time, what it is of and every
/// number. O(1).
template <class S>
[[nodiscard]] bool is_repeat(const Event<S>& a, const Event<S>& b) {
  if (a.time != b.time) return false;
  const auto same = [&](const auto& x) {
    using What = std::remove_cvref_t<decltype(x)>;
    const What* const y = std::get_if<What>(&b.what);
    if (y == nullptr) return false;
    if constexpr (std::is_same_v<What, ArrivalEvent<S>>) {
      return x.value == y->value && x.variance == y->variance && x.anchor_a == y->anchor_a &&
             x.anchor_b == y->anchor_b && x.tag == y->tag && x.is_difference == y->is_difference;
    } else if constexpr (std::is_same_v<What, ScalarEvent<S>>) {
      return x.kind == y->kind && x.value == y->value && x.variance == y->variance;
    } else if constexpr (std::is_same_v<What, ImuSample<S>>) {
      return x.gyro == y->gyro && x.accelerometer == y->accelerometer;
    } else if constexpr (std::is_same_v<What, TimedPosition<S>>) {
      return x.position == y->position && x.covariance == y->covariance;
    } else {
      return x.velocity == y->velocity && x.sigma == y->sigma;
    }
  };
  if (const auto* e = std::get_if<ArrivalEvent<S>>(&a.what)) return same(*e);
  if (const auto* e = std::get_if<ImuSample<S>>(&a.what)) return same(*e);
  if (const auto* e = std::get_if<ScalarEvent<S>>(&a.what)) return same(*e);
  if (const auto* e = std::get_if<TimedPosition<S>>(&a.what)) return same(*e);
  if (const auto* e = std::get_if<TimedVelocity<S>>(&a.what)) return same(*e);
  return false;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
