// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Inertial navigation: position p, orientation R, velocity v, biases b_a, b_g of an accelerometer
/// and a gyro, whose readings a, ω drive it, held from one sample to the next:
/// \f[ \dot p = v, \quad \dot v = R (a - b_a) + g, \quad \dot R = R\,[\omega - b_g]_\times \tag{1}
/// \f]
/// The filter's state is the error (δp, θ, δv, δb_g, δb_a) with the true orientation Exp(θ) R,
/// θ in axes of the map (Solà, Quaternion kinematics for the error-state Kalman filter, 2017, 7.):
/// \f[ \dot{\delta p} = \delta v,\quad \dot\theta = -R\,\delta b_g - R\,n_g,\quad
///     \dot{\delta v} = \theta \times R(a - b_a) - R\,\delta b_a - R\,n_a \tag{2} \f]
/// with white noises n; the biases wander. Both to second order in the step. When samples stop for
/// longer than `max_silence`, the body is taken to go straight on, with acceleration and turn
/// unknown to `blind_acceleration` and `blind_turn`.

#include <cmath>
#include <cstdint>

#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/filter/factored_covariance.hpp"
#include "uwbpos/filter/motion/propagation.hpp"
#include "uwbpos/model/heading.hpp"
#include "uwbpos/model/lever_arm.hpp"

namespace uwbpos {

/// The nominal state of (1).
template <class S>
struct InertialState {
  Vec<S, 3> position = Vec<S, 3>::Zero();                ///< p [m]
  Quaternion<S> orientation = identity_quaternion<S>();  ///< map_q_body
  Vec<S, 3> velocity = Vec<S, 3>::Zero();                ///< v [m/s]
  Vec<S, 3> gyro_bias = Vec<S, 3>::Zero();               ///< b_g [rad/s]
  Vec<S, 3> accelerometer_bias = Vec<S, 3>::Zero();      ///< b_a [m/s²]
};

/// The last sample of an IMU, in the body's frame.
template <class S>
struct InertialInput {
  Vec<S, 3> gyro = Vec<S, 3>::Zero();           ///< ω [rad/s]
  Vec<S, 3> accelerometer = Vec<S, 3>::Zero();  ///< a, specific force [m/s²]
  S age = S(1e9);                               ///< since it was taken [s]
};

/// Where a body is, how it is turned and moves.
template <class S>
struct InertialPose {
  std::int64_t time;      ///< [µs]
  InertialState<S> body;  ///< all of it
  S heading;              ///< of its x axis, in (−π, π] [rad]
  S heading_variance;     ///< [rad²]
  Mat<S, 9> covariance;   ///< of (δp, θ, δv)
};

/// The inertial model.
template <class S>
struct Inertial {
  using Scalar = S;                          ///< float or double
  using State = InertialState<S>;            ///< nominal
  using Input = InertialInput<S>;            ///< an IMU drives it
  using Pose = InertialPose<S>;              ///< what a tracker tells
  static constexpr int kDof = 15;            ///< of the state's error
  static constexpr int kDimension = 3;       ///< of the position
  static constexpr int kPoseDof = 6;         ///< what a tag's place depends on
  static constexpr int kVelocityDof = 9;     ///< what the velocity depends on
  static constexpr bool kHasHeading = true;  ///< it looks somewhere
  static constexpr int kHeading = 5;         ///< where the turn about z is in the error

  S accelerometer_noise = S(0.05);      ///< density of n_a, vibration included [m/s²/√Hz]
  S gyro_noise = S(0.005);              ///< density of n_g [rad/s/√Hz]
  S accelerometer_wander = S(0.002);    ///< of b_a [m/s²/√s]
  S gyro_wander = S(1e-4);              ///< of b_g [rad/s/√s]
  S accelerometer_bias_sigma = S(0.2);  ///< of b_a at first [m/s²]
  S gyro_bias_sigma = S(0.02);          ///< of b_g at first [rad/s]
  S tilt_sigma = S(0.1);                ///< of roll and pitch at first [rad]
  S gravity = S(9.80665);               ///< |g|, down the map's −z [m/s²]
  S max_silence = S(0.1);               ///< longest time that a sample is held [s]
  S blind_acceleration = S(3);          ///< density of the unknown acceleration [m/s²/√Hz]
  S blind_turn = S(1);                  ///< density of the unknown turn rate [rad/s/√Hz]

  /// Whether all of these lie in their domain; gravity within 1000 m/s².
  [[nodiscard]] bool is_valid() const {
    return is_noise(accelerometer_noise) && is_noise(gyro_noise) &&
           is_noise(accelerometer_wander) && is_noise(gyro_wander) &&
           is_noise(accelerometer_bias_sigma) && is_noise(gyro_bias_sigma) &&
           is_noise(tilt_sigma) && is_noise(blind_acceleration) && is_noise(blind_turn) &&
           is_noise(max_silence) && gravity >= S(-1000) && gravity <= S(1000);
  }

  /// Moves the state by `t` [s], (1) and (2). No allocation.
  [[nodiscard]] Propagation<S, 15, 15> propagate(State& state, const Input& input, S t) const {
    Propagation<S, 15, 15> step;
    const bool blind = !(input.age <= max_silence);
    const Mat<S, 3> r = rotation_matrix(state.orientation);
    Vec<S, 3> force = Vec<S, 3>::Zero();  // R (a − b_a)
    Vec<S, 3> acceleration = Vec<S, 3>::Zero();
    if (!blind) {
      force = rotate<S>(state.orientation, input.accelerometer - state.accelerometer_bias);
      // The mean orientation of the step turns the force; to second order that is half a turn on.
      const Vec<S, 3> half = rotate<S>(state.orientation, input.gyro - state.gyro_bias) * (t / 2);
      force += turn_gradient<S>(half, force);  // half × force
      acceleration = force;
      acceleration[2] -= gravity;
      state.orientation = normalised<S>(multiply<S>(
          state.orientation, quaternion_from_turn<S>((input.gyro - state.gyro_bias) * t)));
    }
    state.position += t * state.velocity + (t * t / S(2)) * acceleration;
    state.velocity += t * acceleration;

    for (int k = 0; k < 3; ++k) {
      step.f(k, 6 + k) = t;
      for (int m = 0; m < 3 && !blind; ++m) {
        step.f(3 + k, 9 + m) = -t * r(k, m);
        step.f(6 + k, 12 + m) = -t * r(k, m);
        step.f(k, 12 + m) = -(t * t / S(2)) * r(k, m);
      }
    }
    // θ × force, as a matrix of θ.
    const S cross[3][3] = {
        {S(0), force[2], -force[1]}, {-force[2], S(0), force[0]}, {force[1], -force[0], S(0)}};
    for (int k = 0; k < 3; ++k) {
      for (int m = 0; m < 3; ++m) {
        step.f(6 + k, 3 + m) = t * cross[k][m];
        step.f(k, 3 + m) = (t * t / S(2)) * cross[k][m];
      }
    }
    const S pushed = blind ? blind_acceleration : accelerometer_noise;
    const S turned = blind ? blind_turn : gyro_noise;
    for (int k = 0; k < 3; ++k) {
      step.g(k, k) = t / S(2);
      step.g(6 + k, k) = S(1);
      step.q[k] = pushed * pushed * t;
      step.g(k, 3 + k) = S(1);
      step.q[3 + k] = pushed * pushed * t * t * t / S(12);
      step.g(3 + k, 6 + k) = S(1);
      step.q[6 + k] = turned * turned * t;
      step.g(9 + k, 9 + k) = S(1);
      step.q[9 + k] = gyro_wander * gyro_wander * t;
      step.g(12 + k, 12 + k) = S(1);
      step.q[12 + k] = accelerometer_wander * accelerometer_wander * t;
    }
    return step;
  }

  /// Adds an error: the orientation turns by Exp(θ).
  void correct(State& state, const Vec<S, 15>& step) const {
    state.position += step.template segment<3>(0);
    state.orientation = normalised<S>(
        multiply<S>(quaternion_from_turn<S>(step.template segment<3>(3)), state.orientation));
    state.velocity += step.template segment<3>(6);
    state.gyro_bias += step.template segment<3>(9);
    state.accelerometer_bias += step.template segment<3>(12);
  }

  /// Where the tag at `lever` [m], in the body's frame, is [m].
  [[nodiscard]] Vec<S, 3> place(const State& state, const Vec<S, 3>& lever) const {
    return state.position + rotate<S>(state.orientation, lever);
  }

  /// The gradient of something that has gradient `g` with respect to the tag's place.
  [[nodiscard]] Vec<S, 6> place_row(const State& state, const Vec<S, 3>& lever,
                                    const Vec<S, 3>& g) const {
    const Vec<S, 3> turn = turn_gradient<S>(rotate<S>(state.orientation, lever), g);
    return {g[0], g[1], g[2], turn[0], turn[1], turn[2]};
  }

  /// In axes of the map [m/s].
  [[nodiscard]] Vec<S, 3> velocity(const State& state) const { return state.velocity; }

  /// The gradient of its component `axis`.
  [[nodiscard]] Vec<S, 9> velocity_row(const State&, int axis) const {
    Vec<S, 9> row = Vec<S, 9>::Zero();
    row[6 + axis] = S(1);
    return row;
  }

  /// Of the x axis in plan [rad].
  [[nodiscard]] S heading(const State& state) const { return looks(state).heading; }
  /// Its gradient.
  [[nodiscard]] Vec<S, 6> heading_row(const State& state) const {
    const Vec<S, 3> g = looks(state).gradient;
    return {S(0), S(0), S(0), g[0], g[1], g[2]};
  }

  /// The state to begin with, at rest, upright as the accelerometer says; `variances` gets all but
  /// those of position and heading.
  [[nodiscard]] State begin(const Beginning<S>& from, Vec<S, 15>& variances) const {
    State state;
    state.position = from.position;
    const Quaternion<S> level = quaternion_between<S>(from.specific_force, {S(0), S(0), S(1)});
    const HeadingPrediction<S> off = predict_heading<S>(rotate<S>(level, {S(1), S(0), S(0)}));
    state.orientation = multiply<S>(quaternion_from_yaw<S>(from.heading - off.heading), level);
    for (int k = 0; k < 3; ++k) {
      variances[3 + k] = tilt_sigma * tilt_sigma;
      variances[6 + k] = from.speed_variance;
      variances[9 + k] = gyro_bias_sigma * gyro_bias_sigma;
      variances[12 + k] = accelerometer_bias_sigma * accelerometer_bias_sigma;
    }
    return state;
  }

  /// What a tracker tells of it.
  template <int N>
  [[nodiscard]] Pose pose(std::int64_t time, const State& state,
                          const FactoredCovariance<S, N>& covariance) const {
    const HeadingPrediction<S> look = looks(state);
    Vec<S, 6> row = Vec<S, 6>::Zero();
    row.template tail<3>() = look.gradient;
    return {time, state, look.heading, covariance.template project<6>(row).variance,
            covariance.template matrix<9>()};
  }

 private:
  [[nodiscard]] static HeadingPrediction<S> looks(const State& state) {
    return predict_heading<S>(rotate<S>(state.orientation, {S(1), S(0), S(0)}));
  }
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
