// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The measurements that a track begins with: of each link the last one, no older than a window.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/filter/events.hpp"

namespace uwbpos {

/// One reading of a first fix: a range to `b`, or a difference b − a.
template <class S>
struct FirstReading {
  Vec<S, 3> a;         ///< [m]
  Vec<S, 3> b;         ///< [m]
  Vec<S, 3> lever;     ///< of the tag, turned so that z is up [m]
  S value;             ///< [m]
  S variance;          ///< with those of its age and bias [m²]
  bool is_difference;  ///< else a range
};

/// Up to 64 readings and what else the events tell of the pose. No allocation.
template <class S>
struct FirstReadings {
  std::array<FirstReading<S>, static_cast<std::size_t>(kMaxMeasurements)> readings;  ///< `count`
  int count = 0;            ///< how many there are
  int ranges = 0;           ///< how many of them are ranges
  std::int64_t span = 0;    ///< from the oldest of them to the last [µs]
  bool has_levers = false;  ///< two different lever arms occur
  bool repeated = false;    ///< a link was heard twice: all that are to be heard have been, perhaps
  std::optional<TimedPosition<S>> position = std::nullopt;  ///< the last of another system
  std::optional<TimedHeading<S>> heading = std::nullopt;    ///< the last measured
  Vec<S, 3> specific_force = Vec<S, 3>::Zero();             ///< mean of accelerometers, or zero
};

/// Gathers from events, oldest first, those within `window` [µs] before the last. `speed_sigma`:
/// of an unknown motion [m/s]; `bias_variance`: of an anchor's unknown bias [m²]. O(n²) in the
/// events of the window.
template <class S>
[[nodiscard]] FirstReadings<S> gather_first_readings(std::span<const Event<S>> events,
                                                     std::int64_t window, S speed_sigma,
                                                     S bias_variance) {
  FirstReadings<S> set;
  if (events.empty()) return set;
  const std::int64_t now = events.back().time;
  std::array<const ArrivalEvent<S>*, static_cast<std::size_t>(kMaxMeasurements)> taken;
  S samples = S(0);
  for (std::size_t left = events.size(); left > 0; --left) {
    const Event<S>& event = events[left - 1];
    if (now - event.time > window) break;
    if (const auto* imu = std::get_if<ImuSample<S>>(&event.what)) {
      set.specific_force += imu->accelerometer;
      samples += S(1);
    } else if (const auto* position = std::get_if<TimedPosition<S>>(&event.what)) {
      if (!set.position) set.position = *position;
    } else if (const auto* scalar = std::get_if<ScalarEvent<S>>(&event.what)) {
      if (scalar->kind == ScalarEvent<S>::Kind::Heading && !set.heading) {
        set.heading = TimedHeading<S>{event.time, scalar->value, std::sqrt(scalar->variance)};
      }
    } else if (const auto* arrival = std::get_if<ArrivalEvent<S>>(&event.what)) {
      bool fresh = set.count < kMaxMeasurements;
      for (int k = 0; k < set.count && fresh; ++k) {
        const ArrivalEvent<S>& other = *taken[static_cast<std::size_t>(k)];
        fresh = other.is_difference != arrival->is_difference || other.tag != arrival->tag ||
                other.anchor_b != arrival->anchor_b ||
                (other.is_difference && other.anchor_a != arrival->anchor_a);
      }
      set.repeated = set.repeated || !fresh;
      if (!fresh) continue;
      const S age = seconds_between<S>(event.time, now) * speed_sigma;
      const int biases = (arrival->bias_b >= 0 ? 1 : 0) + (arrival->bias_a >= 0 ? 1 : 0);
      const S unknown = age * age + static_cast<S>(biases) * bias_variance;
      taken[static_cast<std::size_t>(set.count)] = arrival;
      set.readings[static_cast<std::size_t>(set.count++)] = {arrival->a,
                                                             arrival->b,
                                                             arrival->lever,
                                                             arrival->value,
                                                             arrival->variance + unknown,
                                                             arrival->is_difference};
      if (!arrival->is_difference) ++set.ranges;
      set.span = now - event.time;
    }
  }
  if (samples > S(0)) set.specific_force /= samples;
  // Weights farther apart than rounding bears would leave of several readings one direction.
  S most = S(0);
  for (int k = 0; k < set.count; ++k) {
    most = std::max(most, set.readings[static_cast<std::size_t>(k)].variance);
  }
  const S least = most * std::sqrt(std::numeric_limits<S>::epsilon()) / S(4);
  const Quaternion<S> level = quaternion_between<S>(set.specific_force, {S(0), S(0), S(1)});
  for (int k = 0; k < set.count; ++k) {
    FirstReading<S>& reading = set.readings[static_cast<std::size_t>(k)];
    reading.variance = std::max(reading.variance, least);
    reading.lever = rotate<S>(level, reading.lever);
    set.has_levers = set.has_levers || reading.lever != set.readings[0].lever;
  }
  return set;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
