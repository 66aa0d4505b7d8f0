// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// How anything that a tracker was fed corrects a track: moved to the event's time, by one scalar
/// after the other. A position or a velocity is used whole or not at all.

#include <cmath>
#include <span>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/filter/apply_arrival.hpp"

namespace uwbpos {

/// A sample of an inertial unit: drives the motion that it can drive; to a planar robot its z axis
/// measures the turn rate.
template <class Motion, int Biases, class S>
[[nodiscard]] Result<Innovation<S>> apply(Track<Motion, Biases>& track,
                                          const TrackModel<Motion>& model,
                                          const ImuSample<S>& sample, std::span<const Event<S>>) {
  if constexpr (requires { track.input.gyro; }) {
    track.input = {sample.gyro, sample.accelerometer, S(0)};
    return Innovation<S>{};
  } else if constexpr (requires { model.motion.gyro_sigma; }) {
    Vec<S, Motion::kTurnRate + 1> row = Vec<S, Motion::kTurnRate + 1>::Zero();
    row[Motion::kTurnRate] = S(1);
    const S sigma = model.motion.gyro_sigma;
    const S innovation = sample.gyro[2] - track.state[Motion::kTurnRate];
    return gated_correct(track, model, row, innovation, S(sigma * sigma), S(0));
  } else {
    return Innovation<S>{};
  }
}

/// A height, a heading, a speed or a turn rate, of which the tracker lets in those that the motion
/// has.
template <class Motion, int Biases, class S>
[[nodiscard]] Result<Innovation<S>> apply(Track<Motion, Biases>& track,
                                          const TrackModel<Motion>& model,
                                          const ScalarEvent<S>& event, std::span<const Event<S>>) {
  using Kind = typename ScalarEvent<S>::Kind;
  if (event.kind == Kind::Height) {
    if constexpr (Motion::kDimension == 3) {
      const S z = model.motion.place(track.state, Vec<S, 3>::Zero().eval())[2];
      return gated_correct(track, model, Vec<S, 3>{S(0), S(0), S(1)}, S(event.value - z),
                           event.variance, S(1));
    }
  } else if (event.kind == Kind::Heading) {
    if constexpr (Motion::kHasHeading) {
      const S off = angle_difference(event.value, model.motion.heading(track.state));
      return gated_correct(track, model, model.motion.heading_row(track.state), off, event.variance,
                           S(0));
    }
  } else if constexpr (requires { Motion::kSpeed; }) {
    const int place = event.kind == Kind::Speed ? Motion::kSpeed : Motion::kTurnRate;
    Vec<S, Motion::kTurnRate + 1> row = Vec<S, Motion::kTurnRate + 1>::Zero();
    row[place] = S(1);
    return gated_correct(track, model, row, S(event.value - track.state[place]), event.variance,
                         S(0));
  }
  return std::unexpected(Error::InvalidOption);
}

/// A position, all of it or none. Its covariance is factored, so that its components come one by
/// one.
template <class Motion, int Biases, class S>
[[nodiscard]] Result<Innovation<S>> apply(Track<Motion, Biases>& track,
                                          const TrackModel<Motion>& model,
                                          const TimedPosition<S>& event,
                                          std::span<const Event<S>>) {
  constexpr int D = Motion::kDimension;
  const auto noise =
      FactoredCovariance<S, D>::from_matrix(event.covariance.template topLeftCorner<D, D>().eval());
  if (!noise) return std::unexpected(noise.error());
  const auto off = [&](const Track<Motion, Biases>& at) {
    const Vec<S, 3> place = model.motion.place(at.state, Vec<S, 3>::Zero().eval());
    return (event.position - place).template head<D>().eval();
  };
  const S distance = norm<S, D>(off(track));
  S variance = S(0);
  for (int k = 0; k < D; ++k) variance += event.covariance(k, k);
  const Reach<S> reach{seconds_between<S>(track.used_at, track.time), track.position_variance};
  if (const auto error = check_reach(model.gate, reach, distance, S(1), variance)) {
    return std::unexpected(*error);
  }
  Track<Motion, Biases> next = track;
  Mat<S, D> rows = Mat<S, D>::Identity();  // L⁻¹, row by row
  S square = S(0);
  for (int k = 0; k < D; ++k) {
    for (int j = 0; j < k; ++j) rows.row(k) -= noise->factor()(k, j) * rows.row(j);
    const Vec<S, D> row = rows.row(k).transpose();
    const ProjectedRow<S, D> projected = next.covariance.project(row);
    const S innovation = dot<S, D>(row, off(next));
    const S r = noise->diagonal()[k];
    square += innovation * innovation / (projected.variance + r);
    correct(next, model.motion, projected, innovation, r);
  }
  if (const auto error = check_statistics(model.gate, square, D)) return std::unexpected(*error);
  track = next;
  confirm(track);
  return Innovation<S>{distance, square, D};
}

/// A velocity, all of it or none.
template <class Motion, int Biases, class S>
[[nodiscard]] Result<Innovation<S>> apply(Track<Motion, Biases>& track,
                                          const TrackModel<Motion>& model,
                                          const TimedVelocity<S>& event,
                                          std::span<const Event<S>>) {
  constexpr int D = Motion::kDimension;
  const S variance = event.sigma * event.sigma;
  Track<Motion, Biases> next = track;
  S square = S(0);
  S length = S(0);
  for (int k = 0; k < D; ++k) {
    const auto projected = next.covariance.project(model.motion.velocity_row(next.state, k));
    const S innovation = event.velocity[k] - model.motion.velocity(next.state)[k];
    const S before = event.velocity[k] - model.motion.velocity(track.state)[k];
    length += before * before;
    square += innovation * innovation / (projected.variance + variance);
    correct(next, model.motion, projected, innovation, variance);
  }
  if (const auto error = check_statistics(model.gate, square, D)) return std::unexpected(*error);
  track = next;
  return Innovation<S>{std::sqrt(length), square, D};
}

/// Moves the track to the event's time and lets the event correct it. Errors: NotFinite,
/// Unreachable, OutlierRejected, InvalidCovariance; then the track has only moved.
template <class Motion, int Biases, class S>
[[nodiscard]] Result<Innovation<S>> apply(Track<Motion, Biases>& track,
                                          const TrackModel<Motion>& model, const Event<S>& event,
                                          std::span<const Event<S>> before) {
  advance(track, model, event.time);
  const auto with = [&](const auto& what) { return apply(track, model, what, before); };
  if (const auto* e = std::get_if<ArrivalEvent<S>>(&event.what)) return with(*e);
  if (const auto* e = std::get_if<ImuSample<S>>(&event.what)) return with(*e);
  if (const auto* e = std::get_if<ScalarEvent<S>>(&event.what)) return with(*e);
  if (const auto* e = std::get_if<TimedPosition<S>>(&event.what)) return with(*e);
  if (const auto* e = std::get_if<TimedVelocity<S>>(&event.what)) return with(*e);
  return Innovation<S>{};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
