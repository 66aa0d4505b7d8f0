// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A track from a first fix, and the heading of a robot from where it drives.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>

#include "uwbpos/core/trigonometry.hpp"
#include "uwbpos/filter/first_fix.hpp"
#include "uwbpos/filter/tracker_options.hpp"

namespace uwbpos {

/// Where a robot without a heading was first seen. One that drives where it looks shows its heading
/// by the way from there, once that is six standard deviations long.
template <class S>
class Departure {
 public:
  /// The heading [rad] and its variance, or nothing yet. `variance`: of the position, both
  /// components together [m²]; a departure older than `max_age` [µs] is replaced.
  [[nodiscard]] std::optional<Measured<S>> heading(const Vec<S, 2>& position, S variance,
                                                   std::int64_t time, std::int64_t max_age) {
    constexpr S kSigmas = S(6);
    if (!from_ || time - time_ > max_age) {
      from_ = position;
      variance_ = variance;
      time_ = time;
      return std::nullopt;
    }
    const Vec<S, 2> way = position - *from_;
    const S square = squared_norm<S, 2>(way);
    const S noise = variance + variance_;
    if (!(square > kSigmas * kSigmas * noise)) return std::nullopt;
    return Measured<S>{arctangent(way[1], way[0]), noise / square};
  }

  /// Forgets it.
  void restart() { from_.reset(); }

 private:
  std::optional<Vec<S, 2>> from_;
  S variance_ = S(0);
  std::int64_t time_ = 0;
};

/// When to look for a beginning, and when to believe one.
class BeginningPace {
 public:
  /// Whether to look, at an event that tells of a place.
  [[nodiscard]] bool looks() { return --pause_ < 0; }
  /// `count` differences did not agree, which takes long to find. When a quarter of them are new
  /// they may, then half, then all.
  void disagreed(int count) {
    pause_ = failed_ = std::min(count, std::max(count / 4, 2 * failed_));
  }
  /// A track began.
  void restart() { pause_ = failed_ = 0; }

  /// Whether a fix with so much redundancy may be believed. Of a few readings one that lies may
  /// agree with the wrong ones: four more than needed are waited for, two once a link is
  /// `repeated`, and one when the window has passed (`waited`).
  [[nodiscard]] static bool believes(int degrees_of_freedom, bool repeated, bool waited) {
    return degrees_of_freedom >= (waited ? 1 : repeated ? 2 : 4);
  }

 private:
  int pause_ = 0;   // events before it is looked for again
  int failed_ = 0;  // what that was after the last that was not found
};

/// The track that begins at the last of `events` with a fix, a heading where the motion has one,
/// and what accelerometers told. O(N³), no allocation.
template <class Motion, int Biases, class S>
[[nodiscard]] Track<Motion, Biases> begun_track(const TrackerOptions<Motion>& options,
                                                const FirstFix<S, Motion::kDimension>& fix,
                                                const Measured<S>& heading,
                                                const FirstReadings<S>& set,
                                                std::span<const Event<S>> events) {
  constexpr int D = Motion::kDimension;
  constexpr int n = Motion::kDof;
  constexpr int all = Track<Motion, Biases>::kDof;
  Beginning<S> beginning{.position = Vec<S, 3>::Zero(), .heading = heading.value};
  beginning.position.template head<D>() = fix.position;
  beginning.speed_variance = options.speed_sigma * options.speed_sigma;
  beginning.specific_force = set.specific_force;
  Track<Motion, Biases> track;
  Vec<S, n> variances = Vec<S, n>::Zero();
  track.state = options.model.motion.begin(beginning, variances);
  Mat<S, all> p = Mat<S, all>::Zero();
  for (int k = 0; k < n; ++k) p(k, k) = variances[k];
  for (int k = n; k < all; ++k) p(k, k) = options.model.bias_sigma * options.model.bias_sigma;
  p.template topLeftCorner<D, D>() = fix.covariance.template topLeftCorner<D, D>();
  if constexpr (Motion::kHasHeading) {
    p(Motion::kHeading, Motion::kHeading) = heading.variance;
    for (int k = 0; k < D && fix.heading; ++k) {
      p(k, Motion::kHeading) = p(Motion::kHeading, k) = fix.covariance(k, D);
    }
  }
  const auto factored = FactoredCovariance<S, all>::from_matrix(p);
  track.covariance = factored ? *factored : FactoredCovariance<S, all>{p.diagonal().eval()};
  track.time = events.back().time;
  confirm(track);
  if constexpr (requires { track.input.age; }) {
    for (const Event<S>& event : events) {
      const auto* imu = std::get_if<ImuSample<S>>(&event.what);
      if (imu == nullptr) continue;
      track.input = {imu->gyro, imu->accelerometer, seconds_between<S>(event.time, track.time)};
    }
  }
  return track;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
