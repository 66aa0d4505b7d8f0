// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Rigid motions between frames, with the covariance of their own error. `a_T_b` takes coordinates
/// in frame b to coordinates in frame a; names are chained so that equal frames meet:
/// `compose(a_T_b, b_T_c)` is `a_T_c`.
/// \f[ p_a = R\,p_b + t \tag{1} \f]
/// The error is \f$ \xi = (\delta t, \theta) \f$, both in axes of frame a: the true motion is
/// \f$ \mathrm{Exp}(\theta) R \f$ and \f$ t + \delta t \f$. In the plane \f$ \theta \f$ is the yaw
/// and \f$ \xi \f$ that of a `Pose2`. To first order a point is off by
/// \f[ \delta p_a = \delta t + \theta \times (R\,p_b) = J(p_b)\,\xi \tag{2} \f]
/// so that one error of a transform moves all its points together, and turns it into more metres
/// the farther they lie from the origin of b.

#include <type_traits>

#include "uwbpos/core/linalg.hpp"

namespace uwbpos {

/// Angles of a rotation in D dimensions.
template <int D>
inline constexpr int kTurnDof = D == 2 ? 1 : 3;

/// Unknowns of a rigid motion in D dimensions: translation, then rotation.
template <int D>
inline constexpr int kTransformDof = D + kTurnDof<D>;

/// A rigid motion `a_T_b` in D = 2 or 3 dimensions. Invariant: `rotation` is orthonormal with
/// determinant +1 to the scalar's precision; the makers of frames/make_transform.hpp and
/// frames/fit_transform.hpp see to it, and all functions here keep it. By default the identity,
/// without error.
template <class S, int D>
struct Transform {
  static_assert(D == 2 || D == 3);
  Mat<S, D> rotation = Mat<S, D>::Identity();  ///< R: axes of b, as columns, in frame a
  Vec<S, D> translation = Vec<S, D>::Zero();   ///< t: origin of b in frame a [m]
  /// Of (δt, θ), equation (2) [m², m·rad, rad²].
  Mat<S, kTransformDof<D>> covariance = Mat<S, kTransformDof<D>>::Zero();
};

/// Derivative of θ × r by θ.
template <class S, int D>
[[nodiscard]] Eigen::Matrix<S, D, kTurnDof<D>> turn_jacobian(const Vec<S, D>& r) {
  Eigen::Matrix<S, D, kTurnDof<D>> jacobian;
  if constexpr (D == 2) {
    jacobian << -r[1], r[0];
  } else {
    jacobian << S(0), r[2], -r[1],  //
        -r[2], S(0), r[0],          //
        r[1], -r[0], S(0);
  }
  return jacobian;
}

/// J(p) of equation (2) for a point `p_b` [m].
template <class S, int D>
[[nodiscard]] Eigen::Matrix<S, D, kTransformDof<D>> point_jacobian(
    const Transform<S, D>& a_T_b, const std::type_identity_t<Vec<S, D>>& p_b) {
  Eigen::Matrix<S, D, kTransformDof<D>> jacobian;
  jacobian.template leftCols<D>().setIdentity();
  jacobian.template rightCols<kTurnDof<D>>() = turn_jacobian<S, D>(product(a_T_b.rotation, p_b));
  return jacobian;
}

/// The same motion, believed without error. Where two results share a transform, its error is not
/// to be counted for their difference.
template <class S, int D>
[[nodiscard]] Transform<S, D> exact(const Transform<S, D>& a_T_b) {
  return {.rotation = a_T_b.rotation, .translation = a_T_b.translation};
}

/// Equation (1): the point `p_b` [m] in frame a.
template <class S, int D>
[[nodiscard]] Vec<S, D> apply(const Transform<S, D>& a_T_b,
                              const std::type_identity_t<Vec<S, D>>& p_b) {
  return product(a_T_b.rotation, p_b) + a_T_b.translation;
}

/// A fix in frame a: position by (1), covariance \f$ R P R^T + J \Sigma J^T \f$ of independent
/// errors of fix and transform; `exact(a_T_b)` leaves the transform's out. χ² and its degrees of
/// freedom stay. O(D³), no allocation, inputs are not checked.
template <class S, int D>
[[nodiscard]] Fix<S, D> apply(const Transform<S, D>& a_T_b, const Fix<S, D>& fix_b) {
  Fix<S, D> fix_a = fix_b;
  fix_a.position = apply(a_T_b, fix_b.position);
  fix_a.covariance = congruence(a_T_b.rotation, fix_b.covariance) +
                     congruence(point_jacobian(a_T_b, fix_b.position), a_T_b.covariance);
  return fix_a;
}

/// `a_T_c` from independent `a_T_b` and `b_T_c`, with covariance to first order:
/// \f$ \delta t = \delta t_1 + \theta_1 \times R_1 t_2 + R_1 \delta t_2,\;
/// \theta = \theta_1 + R_1 \theta_2 \f$. O(D³), no allocation, inputs are not checked.
template <class S, int D>
[[nodiscard]] Transform<S, D> compose(const Transform<S, D>& a_T_b, const Transform<S, D>& b_T_c) {
  using Jacobian = Mat<S, kTransformDof<D>>;
  Jacobian first = Jacobian::Identity();
  first.template topRightCorner<D, kTurnDof<D>>() =
      turn_jacobian<S, D>(product(a_T_b.rotation, b_T_c.translation));
  Jacobian second = Jacobian::Identity();
  second.template topLeftCorner<D, D>() = a_T_b.rotation;
  if constexpr (D == 3) second.template bottomRightCorner<3, 3>() = a_T_b.rotation;
  return {.rotation = product(a_T_b.rotation, b_T_c.rotation),
          .translation = apply(a_T_b, b_T_c.translation),
          .covariance = congruence(first, a_T_b.covariance) + congruence(second, b_T_c.covariance)};
}

/// `b_T_a`, with covariance to first order: \f$ \delta t' = -R^T (\delta t - \theta \times t),\;
/// \theta' = -R^T \theta \f$. O(D³), no allocation, inputs are not checked.
template <class S, int D>
[[nodiscard]] Transform<S, D> inverse(const Transform<S, D>& a_T_b) {
  using Jacobian = Mat<S, kTransformDof<D>>;
  const Mat<S, D> b_R_a = transposed(a_T_b.rotation);
  Jacobian jacobian = -Jacobian::Identity();
  jacobian.template topLeftCorner<D, D>() = -b_R_a;
  jacobian.template topRightCorner<D, kTurnDof<D>>() =
      product(b_R_a, turn_jacobian<S, D>(a_T_b.translation));
  if constexpr (D == 3) jacobian.template bottomRightCorner<3, 3>() = -b_R_a;
  return {.rotation = b_R_a,
          .translation = -product(b_R_a, a_T_b.translation),
          .covariance = congruence(jacobian, a_T_b.covariance)};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
