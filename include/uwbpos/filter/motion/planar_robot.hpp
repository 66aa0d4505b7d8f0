// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A robot on a floor that drives where it looks: state (x, y, ψ, v, ω), arcs of constant speed and
/// turn rate by (1) of planar_arc.hpp, disturbed by white forward and angular acceleration and,
/// sideways, by slip. The noise of a step enters as in constant_velocity.hpp: half a step of it
/// acts on what the rate moves.

#include <cmath>
#include <cstdint>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/core/trigonometry.hpp"
#include "uwbpos/filter/factored_covariance.hpp"
#include "uwbpos/filter/motion/planar_arc.hpp"
#include "uwbpos/filter/motion/propagation.hpp"
#include "uwbpos/model/lever_arm.hpp"

namespace uwbpos {

/// Where a planar robot is, and how it moves.
template <class S>
struct RobotPose {
  std::int64_t time;     ///< [µs]
  Pose2<S> pose;         ///< position [m], heading [rad], their covariance
  S speed;               ///< forward [m/s]
  S turn_rate;           ///< counter-clockwise [rad/s]
  Mat<S, 5> covariance;  ///< of (x, y, ψ, v, ω)
};

/// The planar robot. Odometry and gyro are measurements of v and ω, both optional.
template <class S>
struct PlanarRobot {
  using Scalar = S;                          ///< float or double
  using State = Vec<S, 5>;                   ///< x, y [m], ψ [rad], v [m/s], ω [rad/s]
  using Input = NoInput;                     ///< measurements drive it
  using Pose = RobotPose<S>;                 ///< what a tracker tells
  static constexpr int kDof = 5;             ///< of the state's error
  static constexpr int kDimension = 2;       ///< of the position
  static constexpr int kPoseDof = 3;         ///< what a tag's place depends on
  static constexpr int kVelocityDof = 4;     ///< what the velocity depends on
  static constexpr bool kHasHeading = true;  ///< it looks somewhere
  static constexpr bool kLooksAhead = true;  ///< and moves there
  static constexpr int kHeading = 2;         ///< where ψ is in the error
  static constexpr int kSpeed = 3;           ///< where v is
  static constexpr int kTurnRate = 4;        ///< where ω is

  S acceleration = S(1);       ///< forward [m/s²/√Hz]
  S turn_acceleration = S(2);  ///< angular [rad/s²/√Hz]
  S slip = S(0.01);            ///< sideways [m/√s]
  S height = S(0);             ///< of the body's origin [m]
  S gyro_sigma = S(0.02);      ///< of a gyro's turn rate, its bias included, > 1e-9 [rad/s]

  /// Whether all of these lie in their domain.
  [[nodiscard]] bool is_valid() const {
    return is_noise(acceleration) && is_noise(turn_acceleration) && is_noise(slip) &&
           is_height(height) && is_noise(gyro_sigma) && gyro_sigma > S(1e-9);
  }

  /// Moves the state by `t` [s]. No allocation.
  [[nodiscard]] Propagation<S, 5, 5> propagate(State& state, const Input&, S t) const {
    const S speed = state[3];
    const PlanarArc<S> arc = planar_arc<S>(state[2], state[4] * t / S(2));
    const S c = arc.c;
    const S s = arc.s;
    const S chord = t * speed * arc.sinc;
    state[0] += chord * c;
    state[1] += chord * s;
    state[2] = wrap_angle(state[2] + state[4] * t);

    Propagation<S, 5, 5> step;
    step.f(0, 2) = -chord * s;
    step.f(1, 2) = chord * c;
    step.f(0, 3) = t * arc.sinc * c;
    step.f(1, 3) = t * arc.sinc * s;
    step.f(0, 4) = t / S(2) * (t * speed * arc.bend * c - chord * s);
    step.f(1, 4) = t / S(2) * (t * speed * arc.bend * s + chord * c);
    step.f(2, 4) = t;

    const S along = acceleration * acceleration * t;
    const S turning = turn_acceleration * turn_acceleration * t;
    step.g.col(0) << step.f(0, 3) / S(2), step.f(1, 3) / S(2), S(0), S(1), S(0);
    step.q[0] = along;
    step.g.col(1) << c, s, S(0), S(0), S(0);
    step.q[1] = along * t * t / S(12);
    step.g.col(2) << step.f(0, 4) / S(2), step.f(1, 4) / S(2), t / S(2), S(0), S(1);
    step.q[2] = turning;
    step.g(2, 3) = S(1);
    step.q[3] = turning * t * t / S(12);
    step.g.col(4) << -s, c, S(0), S(0), S(0);
    step.q[4] = slip * slip * t;
    return step;
  }

  /// Adds an error.
  void correct(State& state, const Vec<S, 5>& step) const {
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
    return {state[3] * cosine(state[2]), state[3] * sine(state[2]), S(0)};
  }

  /// The gradient of its component `axis`.
  [[nodiscard]] Vec<S, 4> velocity_row(const State& state, int axis) const {
    const S c = cosine(state[2]);
    const S s = sine(state[2]);
    return {S(0), S(0), axis == 0 ? -state[3] * s : state[3] * c, axis == 0 ? c : s};
  }

  /// ψ [rad].
  [[nodiscard]] S heading(const State& state) const { return state[2]; }
  /// Its gradient.
  [[nodiscard]] Vec<S, 3> heading_row(const State&) const { return {S(0), S(0), S(1)}; }

  /// The state to begin with, at rest; `variances` gets those of speed and turn rate.
  [[nodiscard]] State begin(const Beginning<S>& from, Vec<S, 5>& variances) const {
    variances[3] = from.speed_variance;
    variances[4] = S(1);
    return {from.position[0], from.position[1], wrap_angle(from.heading), S(0), S(0)};
  }

  /// What a tracker tells of it.
  template <int N>
  [[nodiscard]] Pose pose(std::int64_t time, const State& state,
                          const FactoredCovariance<S, N>& covariance) const {
    const Mat<S, 5> p = covariance.template matrix<5>();
    return {time,
            {state.template head<2>(), state[2], p.template topLeftCorner<3, 3>()},
            state[3],
            state[4],
            p};
  }
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
