// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Motion of constant velocity, disturbed by white acceleration of spectral density σ_a²:
/// \f[ p' = p + t v, \quad v' = v; \qquad
///     Q = \sigma_a^2 \begin{pmatrix} t^3/3 & t^2/2 \\ t^2/2 & t \end{pmatrix}
///       = \sigma_a^2 t \left[ \binom{t/2}{1} \binom{t/2}{1}^T +
///         \tfrac{t^2}{12} \binom{1}{0} \binom{1}{0}^T \right] \f]
/// on every axis (Bar-Shalom, Li, Kirubarajan 2001, 6.2.2). In the plane the body stays at a known
/// height.

#include <cstdint>

#include "uwbpos/filter/factored_covariance.hpp"
#include "uwbpos/filter/motion/propagation.hpp"

namespace uwbpos {

/// A point that moves, and how well it is known.
template <class S, int D>
struct MovingPoint {
  std::int64_t time;         ///< [µs]
  Vec<S, D> position;        ///< [m]
  Vec<S, D> velocity;        ///< [m/s]
  Mat<S, 2 * D> covariance;  ///< of (position, velocity)
};

/// Constant velocity in D = 2 or 3 dimensions; state (position, velocity). Tags sit in the point
/// itself: without an attitude a lever arm means nothing.
template <class S, int D>
struct ConstantVelocity {
  static_assert(D == 2 || D == 3);
  using Scalar = S;                           ///< float or double
  using State = Vec<S, 2 * D>;                ///< position [m], velocity [m/s]
  using Input = NoInput;                      ///< nothing drives it
  using Pose = MovingPoint<S, D>;             ///< what a tracker tells
  static constexpr int kDof = 2 * D;          ///< of the state's error
  static constexpr int kDimension = D;        ///< of the position
  static constexpr int kPoseDof = D;          ///< what a tag's place depends on
  static constexpr int kVelocityDof = 2 * D;  ///< what the velocity depends on
  static constexpr bool kHasHeading = false;  ///< it looks nowhere

  S acceleration = S(1);  ///< σ_a [m/s²/√Hz]: the velocity wanders by this in a second
  S height = S(0);        ///< of the body in the plane, D = 2 [m]

  /// Whether all of these lie in their domain.
  [[nodiscard]] bool is_valid() const { return is_noise(acceleration) && is_height(height); }

  /// Moves the state by `t` [s]. No allocation.
  [[nodiscard]] Propagation<S, kDof, kDof> propagate(State& state, const Input&, S t) const {
    Propagation<S, kDof, kDof> step;
    const S variance = acceleration * acceleration * t;
    for (int k = 0; k < D; ++k) {
      state[k] += t * state[D + k];
      step.f(k, D + k) = t;
      step.g(k, k) = t / S(2);
      step.g(D + k, k) = S(1);
      step.q[k] = variance;
      step.g(k, D + k) = S(1);
      step.q[D + k] = variance * t * t / S(12);
    }
    return step;
  }

  /// Adds an error.
  void correct(State& state, const Vec<S, kDof>& step) const { state += step; }

  /// Where the tag is [m].
  [[nodiscard]] Vec<S, 3> place(const State& state, const Vec<S, 3>&) const {
    if constexpr (D == 3) {
      return state.template head<3>();
    } else {
      return {state[0], state[1], height};
    }
  }

  /// The gradient of something that has gradient `g` with respect to the tag's place.
  [[nodiscard]] Vec<S, D> place_row(const State&, const Vec<S, 3>&, const Vec<S, 3>& g) const {
    return g.template head<D>();
  }

  /// In axes of the map [m/s].
  [[nodiscard]] Vec<S, 3> velocity(const State& state) const {
    Vec<S, 3> result = Vec<S, 3>::Zero();
    for (int k = 0; k < D; ++k) result[k] = state[D + k];
    return result;
  }

  /// The gradient of its component `axis`.
  [[nodiscard]] Vec<S, kVelocityDof> velocity_row(const State&, int axis) const {
    Vec<S, kVelocityDof> row = Vec<S, kVelocityDof>::Zero();
    row[D + axis] = S(1);
    return row;
  }

  /// The state to begin with, at rest; `variances` gets those of the velocity.
  [[nodiscard]] State begin(const Beginning<S>& from, Vec<S, kDof>& variances) const {
    State state = State::Zero();
    for (int k = 0; k < D; ++k) {
      state[k] = from.position[k];
      variances[D + k] = from.speed_variance;
    }
    return state;
  }

  /// What a tracker tells of it.
  template <int N>
  [[nodiscard]] Pose pose(std::int64_t time, const State& state,
                          const FactoredCovariance<S, N>& covariance) const {
    return {time, state.template head<D>(), state.template tail<D>(),
            covariance.template matrix<kDof>()};
  }
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
