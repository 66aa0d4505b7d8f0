// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A body on a floor that may move in any direction, whatever it looks at: a trolley, a robot on
/// Swedish wheels, a robot seen from a point off its axle. State (x, y, ψ, u, w, ω), u and w the
/// forward and sideward velocity in its own axes: what is constant on an arc, at a crab angle too.
/// Motion by (1) of planar_arc.hpp, disturbed by white forward, sideward and angular acceleration.
/// The noise of a step enters as in constant_velocity.hpp.

#include <cmath>
#include <cstdint>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/core/trigonometry.hpp"
#include "uwbpos/filter/factored_covariance.hpp"
#include "uwbpos/filter/motion/planar_arc.hpp"
#include "uwbpos/filter/motion/propagation.hpp"
#include "uwbpos/model/lever_arm.hpp"

namespace uwbpos {

/// Where a planar body is, and how it moves.
template <class S>
struct BodyPose {
  std::int64_t time;     ///< [µs]
  Pose2<S> pose;         ///< position [m], heading [rad], their covariance
  Vec<S, 2> velocity;    ///< forward, to the left [m/s]
  S turn_rate;           ///< counter-clockwise [rad/s]
  Mat<S, 6> covariance;  ///< of (x, y, ψ, u, w, ω)
};

/// The planar body. Odometry (forward) and gyro are measurements of u and ω, both optional.
template <class S>
struct PlanarBody {
  using Scalar = S;                           ///< float or double
  using State = Vec<S, 6>;                    ///< x, y [m], ψ [rad], u, w [m/s], ω [rad/s]
  using Input = NoInput;                      ///< measurements drive it
  using Pose = BodyPose<S>;                   ///< what a tracker tells
  static constexpr int kDof = 6;              ///< of the state's error
  static constexpr int kDimension = 2;        ///< of the position
  static constexpr int kPoseDof = 3;          ///< what a tag's place depends on
  static constexpr int kVelocityDof = 5;      ///< what the velocity depends on
  static constexpr bool kHasHeading = true;   ///< it looks somewhere
  static constexpr bool kLooksAhead = false;  ///< and may move elsewhere
  static constexpr int kHeading = 2;          ///< where ψ is in the error
  static constexpr int kSpeed = 3;            ///< where u is
  static constexpr int kTurnRate = 5;         ///< where ω is

  S acceleration = S(0.5);           ///< forward [m/s²/√Hz]
  S sideward_acceleration = S(0.5);  ///< sideward [m/s²/√Hz]
  S turn_acceleration = S(1);        ///< angular [rad/s²/√Hz]
  S height = S(0);                   ///< of the body's origin [m]
  S gyro_sigma = S(0.02);            ///< of a gyro's turn rate, bias included, > 1e-9 [rad/s]

  /// Whether all of these lie in their domain.
  [[nodiscard]] bool is_valid() const {
    return is_noise(acceleration) && is_noise(sideward_acceleration) &&
           is_noise(turn_acceleration) && is_height(height) && is_noise(gyro_sigma) &&
           gyro_sigma > S(1e-9);
  }

  /// Moves the state by `t` [s]. No allocation.
  [[nodiscard]] Propagation<S, 6, 6> propagate(State& state, const Input&, S t) const {
    const PlanarArc<S> arc = planar_arc<S>(state[2], state[5] * t / S(2));
    const S x = t * (arc.c * state[3] - arc.s * state[4]);  // t R(m) u
    const S y = t * (arc.s * state[3] + arc.c * state[4]);
    state[0] += arc.sinc * x;
    state[1] += arc.sinc * y;
    state[2] = wrap_angle(state[2] + state[5] * t);

    Propagation<S, 6, 6> step;
    step.f(0, 2) = -arc.sinc * y;
    step.f(1, 2) = arc.sinc * x;
    step.f(0, 3) = t * arc.sinc * arc.c;
    step.f(1, 3) = t * arc.sinc * arc.s;
    step.f(0, 4) = -t * arc.sinc * arc.s;
    step.f(1, 4) = t * arc.sinc * arc.c;
    step.f(0, 5) = t / S(2) * (arc.bend * x - arc.sinc * y);
    step.f(1, 5) = t / S(2) * (arc.bend * y + arc.sinc * x);
    step.f(2, 5) = t;
    const S noises[3] = {acceleration, sideward_acceleration, turn_acceleration};
    for (int k = 0; k < 3; ++k) {
      const S variance = noises[k] * noises[k] * t;
      for (int i = 0; i < 3; ++i) {
        step.g(i, k) = step.f(i, 3 + k) / S(2);
        step.g(i, 3 + k) = step.f(i, 3 + k) / t;
      }
      step.g(3 + k, k) = S(1);
      step.q[k] = variance;
      step.q[3 + k] = variance * t * t / S(12);
    }
    return step;
  }

  /// Adds an error.
  void correct(State& state, const Vec<S, 6>& step) const {
    state += step;
    state[2] = wrap_angle(state[2]);
  }

  /// Where the tag at `lever` [m], in the body's frame, is [m].
  [[nodiscard]] Vec<S, 3> place(const State& state, const Vec<S, 3>& lever) const {
    const Vec<S, 3> arm = turned<S, 3>(turn_of(state[2]), lever);
    return {state[0] + arm[0], state[1] + arm[1], height + arm[2]};
  }

  /// The gradient of something that has gradient `g` with respect to the tag's place.
  [[nodiscard]] Vec<S, 3> place_row(const State& state, const Vec<S, 3>& lever,
                                    const Vec<S, 3>& g) const {
    return {g[0], g[1], heading_gradient<S, 3>(turned<S, 3>(turn_of(state[2]), lever), g)};
  }

  /// In axes of the map [m/s].
  [[nodiscard]] Vec<S, 3> velocity(const State& state) const {
    return turned<S, 3>(turn_of(state[2]), {state[3], state[4], S(0)});
  }

  /// The gradient of its component `axis`.
  [[nodiscard]] Vec<S, 5> velocity_row(const State& state, int axis) const {
    const S c = cosine(state[2]);
    const S s = sine(state[2]);
    const Vec<S, 3> v = velocity(state);
    if (axis == 0) return {S(0), S(0), -v[1], c, -s};
    return {S(0), S(0), v[0], s, c};
  }

  /// ψ [rad].
  [[nodiscard]] S heading(const State& state) const { return state[2]; }
  /// Its gradient.
  [[nodiscard]] Vec<S, 3> heading_row(const State&) const { return {S(0), S(0), S(1)}; }

  /// The state to begin with, at rest; `variances` gets those of velocity and turn rate.
  [[nodiscard]] State begin(const Beginning<S>& from, Vec<S, 6>& variances) const {
    variances[3] = variances[4] = from.speed_variance;
    variances[5] = S(1);
    return {from.position[0], from.position[1], wrap_angle(from.heading), S(0), S(0), S(0)};
  }

  /// What a tracker tells of it.
  template <int N>
  [[nodiscard]] Pose pose(std::int64_t time, const State& state,
                          const FactoredCovariance<S, N>& covariance) const {
    const Mat<S, 6> p = covariance.template matrix<6>();
    return {time,
            {state.template head<2>(), state[2], p.template topLeftCorner<3, 3>()},
            {state[3], state[4]},
            state[5],
            p};
  }
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
