// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a tracker can be told, and what it tells about each measurement.

#include <cmath>
#include <cstdint>
#include <optional>

#include "uwbpos/filter/track.hpp"
#include "uwbpos/solve/mirror_choice.hpp"

namespace uwbpos {

/// Options of a `Tracker`; all but `model.motion` have defaults that fit an indoor robot.
template <class Motion>
struct TrackerOptions {
  using S = typename Motion::Scalar;                     ///< float or double
  static constexpr int kDimension = Motion::kDimension;  ///< of the position

  TrackModel<Motion> model{};             ///< motion with its noises, gates, anchors' biases
  LocateOptions<S, kDimension> locate{};  ///< side or prior against mirror images at the start
  /// Heading at the start, if known [rad], [rad²]. Without it a body with a heading waits for one:
  /// from its tags, a measured one, or, driving where it looks, from its motion.
  std::optional<Measured<S>> heading = std::nullopt;
  S speed_sigma = S(1);               ///< of each component of the velocity at first [m/s]
  std::int64_t fix_window = 500'000;  ///< a first fix takes measurements this old [µs]
  std::int64_t patience = 500'000;    ///< without a used one before a locked-out filter asks
                                      ///< its measurements for another place [µs]
  std::int64_t max_gap = 5'000'000;   ///< without a used one, then the track is lost [µs];
                                      ///< at most `kLongestTrackGap`
};

/// The longest `TrackerOptions::max_gap`, an hour [µs]: a pose is told in steps of a tenth of a
/// second from the last measurement on.
inline constexpr std::int64_t kLongestTrackGap = 3'600'000'000;

/// Whether all options lie in their domain: what is positive is so and finite, deviations at most
/// 10⁶ of their unit, `max_gap` at most `kLongestTrackGap`, the motion by its own word.
template <class Motion>
[[nodiscard]] bool is_valid(const TrackerOptions<Motion>& o) {
  using S = typename Motion::Scalar;
  const auto positive = [](S x) { return x > S(0) && std::isfinite(x); };
  const auto deviation = [](S x) { return x > S(0) && is_noise(x); };
  const bool heading =
      !o.heading || (std::isfinite(o.heading->value) && deviation(o.heading->variance));
  return o.model.motion.is_valid() && is_valid(o.model.gate) && deviation(o.model.bias_sigma) &&
         positive(o.model.bias_time) && deviation(o.speed_sigma) && !check_options(o.locate) &&
         heading && o.fix_window > 0 && o.patience > 0 && o.max_gap > 0 &&
         o.max_gap <= kLongestTrackGap;
}

/// Sizes of a tracker, all fixed.
struct TrackerSize {
  int anchors = 32;  ///< most of them
  int tags = 8;      ///< most on the body
  int biases = 0;    ///< anchors, or links, whose bias is estimated, the first heard; 0: none
  int window = 64;   ///< measurements that are remembered
  int stride = 16;   ///< between snapshots of the track among them; divides `window`
  bool bias_by_link = false;  ///< each tag and anchor have a bias of their own; else each anchor
};

/// What became of a measurement.
enum class TrackEvent : std::uint8_t {
  Gathered,  ///< kept for the first fix
  Started,   ///< completed the first fix, or the one after the track was lost
  Used,      ///< corrected the track
  Reopened,  ///< the gate had locked the filter out; it began anew where recent measurements agree
};

/// What a measurement did to a tracker.
template <class S>
struct TrackUpdate {
  TrackEvent event;            ///< what became of it
  Innovation<S> innovation{};  ///< when used
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
