// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Transforms from a yaw or from a matrix that someone typed, checked, and the nearest rotation to
/// a matrix that almost is one, by Newton's iteration for the polar factor:
/// \f[ R \leftarrow R\,(3I - R^T R)/2 \tag{1} \f]
/// (Higham, SIAM J. Sci. Stat. Comput. 7(4), 1986, its inverse-free kin: Björck, Bowie 1971).

#include <cmath>
#include <type_traits>

#include "uwbpos/core/covariance.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/core/trigonometry.hpp"
#include "uwbpos/frames/transform.hpp"

namespace uwbpos {

/// How far an entry of RᵀR may lie from the identity's for R to be taken for a rotation that was
/// written down with few digits.
template <class S>
inline constexpr S kRotationTolerance = S(5e-3);

/// Equation (1), run until it rests at the scalar's precision: the nearest orthonormal matrix to
/// one whose RᵀR lies within 0.1 of the identity. Additions and products only; no allocation.
template <class S, int D>
[[nodiscard]] Mat<S, D> orthonormalised(Mat<S, D> rotation) {
  for (int pass = 0; pass < 5; ++pass) {  // 0.1 → 8e-3 → 4e-5 → 2e-9 → 3e-18, and one for rounding
    const Mat<S, D> gram = product(transposed(rotation), rotation);
    rotation = product<S, D, D, D>(rotation, (S(3) * Mat<S, D>::Identity() - gram) * S(0.5));
  }
  return rotation;
}

/// Determinant: the signed area or volume that the columns span. Fixed order, no allocation.
template <class S, int D>
[[nodiscard]] S signed_volume(const Mat<S, D>& m) {
  if constexpr (D == 2) {
    return m(0, 0) * m(1, 1) - m(1, 0) * m(0, 1);
  } else {
    return m(0, 0) * (m(1, 1) * m(2, 2) - m(2, 1) * m(1, 2)) -
           m(0, 1) * (m(1, 0) * m(2, 2) - m(2, 0) * m(1, 2)) +
           m(0, 2) * (m(1, 0) * m(2, 1) - m(2, 0) * m(1, 1));
  }
}

/// The motion whose error was found to be `xi` = (δt, θ), corrected: θ by Cayley's map, which
/// departs from Exp by θ³/12. The covariance stays. Additions, products and divisions; no
/// allocation.
template <class S, int D>
[[nodiscard]] Transform<S, D> corrected(Transform<S, D> a_T_b,
                                        const std::type_identity_t<Vec<S, kTransformDof<D>>>& xi) {
  const Vec<S, kTurnDof<D>> half = S(0.5) * xi.template tail<kTurnDof<D>>();
  Mat<S, D> k;
  if constexpr (D == 2) {
    k << S(0), -half[0], half[0], S(0);
  } else {
    k << S(0), -half[2], half[1], half[2], S(0), -half[0], -half[1], half[0], S(0);
  }
  const S scale = S(2) / (S(1) + squared_norm(half));
  const Mat<S, D> turn = Mat<S, D>::Identity() + scale * (k + product(k, k));
  a_T_b.rotation = orthonormalised<S, D>(product(turn, a_T_b.rotation));
  a_T_b.translation += xi.template head<D>();
  return a_T_b;
}

/// The transform of a rotation matrix, a translation [m] and a covariance of (δt, θ), see
/// frames/transform.hpp. A matrix within `kRotationTolerance` is replaced by the nearest rotation,
/// correlations above one for want of digits by one. O(D³), no allocation.
/// Errors: Error::NotFinite; Error::NotARotation, axes not orthonormal, or mirrored;
/// Error::InvalidCovariance.
template <class S, int D>
[[nodiscard]] Result<Transform<S, D>> transform_from_rotation(
    const Mat<S, D>& rotation, const std::type_identity_t<Vec<S, D>>& translation,
    const std::type_identity_t<Mat<S, kTransformDof<D>>>& covariance =
        Mat<S, kTransformDof<D>>::Zero()) {
  if (!all_finite(rotation) || !all_finite(translation) || !all_finite(covariance)) {
    return std::unexpected(Error::NotFinite);
  }
  for (int j = 0; j < D; ++j) {
    for (int i = j; i < D; ++i) {
      const S product_of_axes = dot<S, D>(rotation.col(i), rotation.col(j));
      if (!(std::abs(product_of_axes - S(i == j)) <= kRotationTolerance<S>)) {
        return std::unexpected(Error::NotARotation);
      }
    }
  }
  if (!(signed_volume<S, D>(rotation) > S(0))) return std::unexpected(Error::NotARotation);
  if (!looks_like_covariance<S, kTransformDof<D>>(covariance)) {
    return std::unexpected(Error::InvalidCovariance);
  }
  return Transform<S, D>{.rotation = orthonormalised<S, D>(rotation),
                         .translation = translation,
                         .covariance = without_rounding<S, kTransformDof<D>>(covariance)};
}

/// A turn by `yaw` [rad] about z, counter-clockwise seen from above, then a translation [m]; in
/// the plane or, level, in space. Takes a sine and a cosine, whose last bits differ by C library.
/// O(1), no allocation. Errors: Error::NotFinite; Error::InvalidCovariance.
template <class S, int D>
[[nodiscard]] Result<Transform<S, D>> transform_from_yaw(
    std::type_identity_t<S> yaw, const Vec<S, D>& translation,
    const std::type_identity_t<Mat<S, kTransformDof<D>>>& covariance =
        Mat<S, kTransformDof<D>>::Zero()) {
  if (!std::isfinite(yaw)) return std::unexpected(Error::NotFinite);
  Mat<S, D> rotation = Mat<S, D>::Identity();
  rotation(0, 0) = rotation(1, 1) = cosine(yaw);
  rotation(1, 0) = sine(yaw);
  rotation(0, 1) = -rotation(1, 0);
  return transform_from_rotation<S, D>(rotation, translation, covariance);
}

/// Yaw [rad] in (−π, π]: where frame b's x axis points, seen from above in frame a.
template <class S, int D>
[[nodiscard]] S yaw(const Transform<S, D>& a_T_b) {
  return arctangent(a_T_b.rotation(1, 0), a_T_b.rotation(0, 0));
}

/// A planar transform as a level one in space: frame b's floor lies `height` [m, m²] above frame
/// a's, exactly level. The planar covariance goes to x, y and yaw. O(1), no allocation.
template <class S>
[[nodiscard]] Transform<S, 3> in_space(const Transform<S, 2>& a_T_b,
                                       std::type_identity_t<Measured<S>> height) {
  constexpr int place[] = {0, 1, 5};  // x, y and the turn about z among (x, y, z, θx, θy, θz)
  Transform<S, 3> result;
  result.rotation.template topLeftCorner<2, 2>() = a_T_b.rotation;
  result.translation << a_T_b.translation, height.value;
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) result.covariance(place[i], place[j]) = a_T_b.covariance(i, j);
  }
  result.covariance(2, 2) = height.variance;
  return result;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
