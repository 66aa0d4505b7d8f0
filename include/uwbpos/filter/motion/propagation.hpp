// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a motion model tells the filter about one step of time, and what a filter asks of one.

#include <concepts>

#include "uwbpos/core/types.hpp"

namespace uwbpos {

/// The linear part of one step: P becomes F P Fᵀ + G diag(q) Gᵀ.
template <class S, int N, int Q>
struct Propagation {
  Mat<S, N> f = Mat<S, N>::Identity();                        ///< F
  Eigen::Matrix<S, N, Q> g = Eigen::Matrix<S, N, Q>::Zero();  ///< G
  Vec<S, Q> q = Vec<S, Q>::Zero();                            ///< variances of the noises
};

/// Whether a noise or a deviation of a motion lies in its domain, 0 … 10⁶ of its unit: float holds
/// what becomes of its square.
template <class S>
[[nodiscard]] constexpr bool is_noise(S sigma) {
  return sigma >= S(0) && sigma <= S(1e6);
}

/// Whether a height lies in its domain, within 10⁶ m of zero.
template <class S>
[[nodiscard]] constexpr bool is_height(S height) {
  return height >= S(-1e6) && height <= S(1e6);
}

/// For a model that nothing drives.
struct NoInput {};

/// What is known of a body when a filter begins, beside the variances of its pose.
template <class S>
struct Beginning {
  Vec<S, 3> position;       ///< [m]
  S heading = S(0);         ///< [rad], of a body that has one
  S speed_variance = S(1);  ///< of each component of its velocity, which is taken as zero
  /// Mean reading of an accelerometer [m/s²] in the body's frame; zero when there is none.
  Vec<S, 3> specific_force = Vec<S, 3>::Zero();
};

/// A motion model: parameters, and what they make of a `State` whose error has `kDof` components,
/// the first `kPoseDof` of which are those that a tag's place depends on, position first.
template <class M>
concept MotionModel =
    requires(const M& model, typename M::State state, typename M::Input input, typename M::Scalar s,
             const Vec<typename M::Scalar, 3>& v, Vec<typename M::Scalar, M::kDof> step) {
      { model.is_valid() } -> std::same_as<bool>;
      { model.propagate(state, input, s) };
      { model.correct(state, step) };
      { model.place(state, v) } -> std::same_as<Vec<typename M::Scalar, 3>>;
      { model.place_row(state, v, v) } -> std::same_as<Vec<typename M::Scalar, M::kPoseDof>>;
      { model.velocity(state) } -> std::same_as<Vec<typename M::Scalar, 3>>;
      { model.begin(Beginning<typename M::Scalar>{}, step) } -> std::same_as<typename M::State>;
    };

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
