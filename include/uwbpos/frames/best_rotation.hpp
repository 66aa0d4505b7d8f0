// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The rotation that brings one set of directions nearest to another (Kabsch 1976; Umeyama, IEEE
/// Trans. PAMI 13(4), 1991): of \f$ H = U\,\mathrm{diag}(s)\,V^T \f$
/// \f[ R = U\,\mathrm{diag}(1, 1, \det UV^T)\,V^T. \tag{1} \f]
/// In space the singular values and vectors come from one-sided Jacobi rotations of H's columns
/// (Hestenes 1958), which know small ones as well as large ones; sums and rotations have one order,
/// so that every processor finds the same bits.

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "uwbpos/frames/make_transform.hpp"

namespace uwbpos {

namespace detail {

/// a × b.
template <class S>
Vec<S, 3> cross(const Vec<S, 3>& a, const Vec<S, 3>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Rotates columns i and j of both, so that those of `h` become orthogonal: \f$ H V \f$.
template <class S>
bool orthogonalise(Mat<S, 3>& h, Mat<S, 3>& v, int i, int j) {
  const Vec<S, 3> x = h.col(i);
  const Vec<S, 3> y = h.col(j);
  const S xx = squared_norm(x);
  const S yy = squared_norm(y);
  const S xy = dot(x, y);
  if (!(std::abs(xy) > std::numeric_limits<S>::epsilon() * std::sqrt(xx * yy))) return false;
  const S ratio = (yy - xx) / (S(2) * xy);
  const S size = std::abs(ratio);
  // Beyond what can be squared the root is the ratio itself.
  const S root =
      size < S(1) / std::numeric_limits<S>::epsilon() ? std::sqrt(S(1) + size * size) : size;
  const S tangent = std::copysign(S(1), ratio) / (size + root);
  const S c = S(1) / std::sqrt(S(1) + tangent * tangent);
  const S s = c * tangent;
  for (Mat<S, 3>* m : {&h, &v}) {
    for (int k = 0; k < 3; ++k) {
      const S first = (*m)(k, i);
      const S second = (*m)(k, j);
      (*m)(k, i) = c * first - s * second;
      (*m)(k, j) = s * first + c * second;
    }
  }
  return true;
}

}  // namespace detail

/// R of equation (1) from a finite H. Error::RotationUndetermined where another rotation fits as
/// well: the best is only as sharp as the second singular value plus the signed third. O(1), no
/// allocation.
template <class S, int D>
[[nodiscard]] Result<Mat<S, D>> best_rotation(const Mat<S, D>& h) {
  const S tolerance = S(16) * std::numeric_limits<S>::epsilon();
  if constexpr (D == 2) {
    const S c = h(0, 0) + h(1, 1);
    const S s = h(1, 0) - h(0, 1);
    const S length = std::sqrt(c * c + s * s);
    const S size = std::abs(h(0, 0)) + std::abs(h(1, 1)) + std::abs(h(1, 0)) + std::abs(h(0, 1));
    if (!(length > tolerance * size)) return std::unexpected(Error::RotationUndetermined);
    Mat<S, 2> rotation;
    rotation << c / length, -s / length, s / length, c / length;
    return orthonormalised<S, 2>(rotation);
  } else {
    // Squares must neither overflow nor vanish.
    S largest = S(0);
    for (int j = 0; j < 3; ++j) {
      for (int i = 0; i < 3; ++i) largest = std::max(largest, std::abs(h(i, j)));
    }
    if (!(largest > S(0))) return std::unexpected(Error::RotationUndetermined);
    Mat<S, 3> turned = h / largest;  // H V, whose columns become s_k u_k
    Mat<S, 3> v = Mat<S, 3>::Identity();
    constexpr int kSweeps = 12;  // five or six are needed
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      const bool first = detail::orthogonalise<S>(turned, v, 0, 1);
      const bool second = detail::orthogonalise<S>(turned, v, 0, 2);
      const bool third = detail::orthogonalise<S>(turned, v, 1, 2);
      if (!first && !second && !third) break;
    }
    // The two largest; the third axes follow, with the sign that makes rotations of both.
    Vec<S, 3> s;
    for (int k = 0; k < 3; ++k) s[k] = norm<S, 3>(turned.col(k));
    int order[3] = {0, 1, 2};
    if (s[order[0]] < s[order[1]]) std::swap(order[0], order[1]);
    if (s[order[1]] < s[order[2]]) std::swap(order[1], order[2]);
    if (s[order[0]] < s[order[1]]) std::swap(order[0], order[1]);
    const Vec<S, 3> v1 = v.col(order[0]);
    const Vec<S, 3> v2 = v.col(order[1]);
    const Vec<S, 3> v3 = detail::cross<S>(v1, v2);
    if (!(s[order[1]] > tolerance * s[order[0]])) {
      return std::unexpected(Error::RotationUndetermined);
    }
    const Vec<S, 3> u1 = turned.col(order[0]) / s[order[0]];
    const Vec<S, 3> u2 = turned.col(order[1]) / s[order[1]];
    const Vec<S, 3> u3 = detail::cross<S>(u1, u2);
    const S last = dot<S, 3>(u3, turned.col(order[2])) * dot<S, 3>(v3, v.col(order[2]));
    if (!(s[order[1]] + last > tolerance * s[order[0]])) {
      return std::unexpected(Error::RotationUndetermined);
    }
    Mat<S, 3> rotation;
    for (int j = 0; j < 3; ++j) {
      for (int i = 0; i < 3; ++i) rotation(i, j) = u1[i] * v1[j] + u2[i] * v2[j] + u3[i] * v3[j];
    }
    return orthonormalised<S, 3>(rotation);
  }
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
