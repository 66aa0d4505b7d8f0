// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Rotations as unit quaternions (w, x, y, z), Hamilton's product: `a_q_b` takes vectors in frame b
/// to vectors in frame a, like the matrix that `rotation_matrix` makes of it.

#include <algorithm>
#include <cmath>

#include "uwbpos/core/linalg.hpp"
#include "uwbpos/core/trigonometry.hpp"

namespace uwbpos {

/// (w, x, y, z).
template <class S>
using Quaternion = Vec<S, 4>;

/// No rotation.
template <class S>
[[nodiscard]] Quaternion<S> identity_quaternion() {
  return {S(1), S(0), S(0), S(0)};
}

/// p · q: first q, then p. No allocation.
template <class S>
[[nodiscard]] Quaternion<S> multiply(const Quaternion<S>& p, const Quaternion<S>& q) {
  return {p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
          p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
          p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
          p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]};
}

/// The rotation back, of a unit quaternion. No allocation.
template <class S>
[[nodiscard]] Quaternion<S> conjugate(const Quaternion<S>& q) {
  return {q[0], -q[1], -q[2], -q[3]};
}

/// The same rotation with length one; the identity in place of zero.
template <class S>
[[nodiscard]] Quaternion<S> normalised(const Quaternion<S>& q) {
  const S length = norm(q);
  return length > S(0) ? Quaternion<S>{q / length} : identity_quaternion<S>();
}

/// The rotation by |`turn`| [rad] about `turn`. One sine, one cosine, one root; no allocation.
template <class S>
[[nodiscard]] Quaternion<S> quaternion_from_turn(const Vec<S, 3>& turn) {
  const S half = norm(turn) / S(2);
  // sin(x)/x to rounding below a twentieth of a radian: 1 − x²/6 + x⁴/120, next term 3e-12.
  const S square = half * half;
  const S ratio =
      half < S(0.05) ? S(1) - square / S(6) * (S(1) - square / S(20)) : sine(half) / half;
  const S scale = ratio / S(2);
  return normalised<S>({cosine(half), scale * turn[0], scale * turn[1], scale * turn[2]});
}

/// Yaw about z, then nothing else.
template <class S>
[[nodiscard]] Quaternion<S> quaternion_from_yaw(S yaw) {
  return {cosine(yaw / S(2)), S(0), S(0), sine(yaw / S(2))};
}

/// The matrix of a unit quaternion. No allocation.
template <class S>
[[nodiscard]] Mat<S, 3> rotation_matrix(const Quaternion<S>& q) {
  const S w = q[0];
  const S x = q[1];
  const S y = q[2];
  const S z = q[3];
  Mat<S, 3> r;
  r << S(1) - S(2) * (y * y + z * z), S(2) * (x * y - w * z), S(2) * (x * z + w * y),  //
      S(2) * (x * y + w * z), S(1) - S(2) * (x * x + z * z), S(2) * (y * z - w * x),   //
      S(2) * (x * z - w * y), S(2) * (y * z + w * x), S(1) - S(2) * (x * x + y * y);
  return r;
}

/// q v q⁻¹: a vector of frame b in frame a. No allocation.
template <class S>
[[nodiscard]] Vec<S, 3> rotate(const Quaternion<S>& a_q_b, const Vec<S, 3>& v) {
  const Mat<S, 3> r = rotation_matrix(a_q_b);
  Vec<S, 3> result;
  for (int i = 0; i < 3; ++i) result[i] = r(i, 0) * v[0] + r(i, 1) * v[1] + r(i, 2) * v[2];
  return result;
}

/// The shortest rotation that takes the direction of `from` to that of `to`; any of those by half a
/// turn when they are opposite, none when one of them is zero or not finite. No allocation.
template <class S>
[[nodiscard]] Quaternion<S> quaternion_between(Vec<S, 3> from, Vec<S, 3> to) {
  for (Vec<S, 3>* v : {&from, &to}) {  // squares neither vanish nor overflow
    const S largest = std::max({std::abs((*v)[0]), std::abs((*v)[1]), std::abs((*v)[2])});
    if (largest > S(0)) *v /= largest;
  }
  const S scale = norm(from) * norm(to);
  const S cosine = dot(from, to);
  if (!(scale > S(0))) return identity_quaternion<S>();
  if (cosine < S(-0.999999) * scale) {
    const bool along_x = std::abs(from[0]) > S(0.9) * norm(from);
    const Vec<S, 3> other{along_x ? S(0) : S(1), along_x ? S(1) : S(0), S(0)};
    return normalised<S>({S(0), from[1] * other[2] - from[2] * other[1],
                          from[2] * other[0] - from[0] * other[2],
                          from[0] * other[1] - from[1] * other[0]});
  }
  return normalised<S>({scale + cosine, from[1] * to[2] - from[2] * to[1],
                        from[2] * to[0] - from[0] * to[2], from[0] * to[1] - from[1] * to[0]});
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
