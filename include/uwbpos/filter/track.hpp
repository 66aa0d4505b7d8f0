// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// One hypothesis of a moving body at one time: a motion model's state, the slowly varying bias of
/// some anchors, and their covariance; how time moves it and how it is corrected. The extended
/// Kalman filter, one scalar after the other. A bias is a Gauss-Markov process,
/// \f[ b' = e^{-t/\tau} b + n, \quad \mathrm{var}\,n = \sigma_b^2 (1 - e^{-2t/\tau}), \tag{1} \f]
/// so that what no measurement tells stays at zero ± σ_b, and does no harm.

#include <cmath>
#include <cstdint>

#include "uwbpos/core/exponential.hpp"
#include "uwbpos/filter/factored_covariance.hpp"
#include "uwbpos/filter/gate.hpp"
#include "uwbpos/filter/motion/propagation.hpp"

namespace uwbpos {

/// What a measurement said about the track.
template <class S>
struct Innovation {
  S value = S(0);              ///< ν, of a vector its length; in the measurement's unit
  S normalised_square = S(0);  ///< νᵀS⁻¹ν: the NIS, `dimension` on average when all is right
  int dimension = 0;           ///< of ν; zero for what only drives the motion
  S variance = S(0);           ///< S, of a scalar; zero of a vector
};

/// What a track is moved and judged by.
template <class Motion>
struct TrackModel {
  using S = typename Motion::Scalar;  ///< float or double
  Motion motion{};                    ///< with its noises
  GateOptions<S> gate{};              ///< what is believed
  S bias_sigma = S(0.1);              ///< σ_b [m]
  S bias_time = S(20);                ///< τ [s]
};

/// State of `Motion` and biases of up to `Biases` anchors at `time`.
template <class Motion, int Biases>
struct Track {
  using S = typename Motion::Scalar;                  ///< float or double
  static constexpr int kBias = Motion::kDof;          ///< where the biases begin
  static constexpr int kDof = Motion::kDof + Biases;  ///< of all

  std::int64_t time = 0;                         ///< [µs]
  std::int64_t used_at = 0;                      ///< when something was last used [µs]
  S position_variance = S(0);                    ///< tr P₀ then [m²]
  typename Motion::State state{};                ///< of the body
  typename Motion::Input input{};                ///< that drives it
  Vec<S, Biases> bias = Vec<S, Biases>::Zero();  ///< of ranges, estimate minus truth [m]
  FactoredCovariance<S, kDof> covariance;        ///< of the errors of state and biases
  int heard = 0;                                 ///< biases that a measurement has touched
};

/// Seconds from `from` to `to`, exact until the division: float loses nothing of the epoch.
template <class S>
[[nodiscard]] S seconds_between(std::int64_t from, std::int64_t to) {
  return static_cast<S>(to - from) / S(1e6);
}

namespace detail {

template <class Motion, int Biases>
void step_by(Track<Motion, Biases>& track, const TrackModel<Motion>& model,
             typename Motion::Scalar t) {
  using S = typename Motion::Scalar;
  const auto step = model.motion.propagate(track.state, track.input, t);
  if constexpr (requires { track.input.age; }) track.input.age += t;
  if constexpr (Biases == 0) {
    track.covariance.predict(step.f, step.g, step.q);
  } else {
    // What was not heard stays as it was: on its own, of variance σ_b².
    const int size = Motion::kDof + track.heard;
    track.covariance.predict_first(step.f, step.g, step.q, size);
    const S kept = exponential(-t / model.bias_time);  // (1)
    const S fresh = model.bias_sigma * model.bias_sigma * (S(1) - kept * kept);
    for (int k = 0; k < track.heard; ++k) {
      track.bias[k] *= kept;
      track.covariance.predict_process(Motion::kDof + k, kept, fresh, size);
    }
  }
}

}  // namespace detail

/// Moves the track to `time`; an earlier one changes nothing. Steps of at most a tenth of a second,
/// each O(N³). No allocation.
template <class Motion, int Biases>
void advance(Track<Motion, Biases>& track, const TrackModel<Motion>& model, std::int64_t time) {
  using S = typename Motion::Scalar;
  constexpr std::int64_t longest = 100'000;
  while (track.time < time) {
    const std::int64_t next = time - track.time > longest ? track.time + longest : time;
    detail::step_by(track, model, seconds_between<S>(track.time, next));
    track.time = next;
  }
}

/// Corrects the track by a scalar with innovation `innovation`, gradient `row` and noise variance
/// `noise`, without asking a gate. O(M·N). No allocation.
template <class Motion, int Biases, class S, int M>
void correct(Track<Motion, Biases>& track, const Motion& motion, const ProjectedRow<S, M>& row,
             S innovation, S noise) {
  Vec<S, Track<Motion, Biases>::kDof> step =
      track.covariance.update(row, noise, Motion::kDof + track.heard);
  step *= innovation;
  motion.correct(track.state, step.template head<Motion::kDof>());
  for (int k = 0; k < Biases; ++k) track.bias[k] += step[Motion::kDof + k];
}

/// Remembers that the track was confirmed now.
template <class Motion, int Biases>
void confirm(Track<Motion, Biases>& track) {
  track.used_at = track.time;
  track.position_variance = 0;
  for (int k = 0; k < Motion::kDimension; ++k) {
    track.position_variance += track.covariance(k, k);
  }
}

/// Corrects the track by a scalar if the gate lets it: by statistics, and where `slope` > 0, the
/// length of the gradient by position, by reachability, to which `unknown` is noise, too: the
/// variance of what else the row tells of. Errors: NotFinite, Unreachable, OutlierRejected; then
/// nothing changes.
template <class Motion, int Biases, class S, int M>
[[nodiscard]] Result<Innovation<S>> gated_correct(Track<Motion, Biases>& track,
                                                  const TrackModel<Motion>& model,
                                                  const Vec<S, M>& row, S innovation, S noise,
                                                  S slope, S unknown = S(0)) {
  if (slope > S(0)) {
    const Reach<S> reach{seconds_between<S>(track.used_at, track.time), track.position_variance};
    if (const auto error = check_reach(model.gate, reach, innovation, slope, S(noise + unknown))) {
      return std::unexpected(*error);
    }
  }
  const ProjectedRow<S, M> projected = track.covariance.project(row);
  const S variance = projected.variance + noise;
  const S square = innovation * innovation / variance;
  if (const auto error = check_statistics(model.gate, square, 1)) return std::unexpected(*error);
  correct(track, model.motion, projected, innovation, noise);
  if (slope > S(0)) confirm(track);
  return Innovation<S>{innovation, square, 1, variance};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
