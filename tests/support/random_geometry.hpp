// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Random points, motions and orders, for laws such as "rotating everything rotates the answer".

#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/sim/noise.hpp"

namespace uwbpos::test {

/// A point uniform in the box between two corners.
template <class S, int D>
Vec<S, D> random_in_box(sim::Random& random, const Vec<S, D>& low, const Vec<S, D>& high) {
  Vec<S, D> point;
  for (int i = 0; i < D; ++i) {
    point(i) =
        static_cast<S>(random.uniform(static_cast<double>(low(i)), static_cast<double>(high(i))));
  }
  return point;
}

/// (x, y), or (x, y, z) in space.
template <class S, int D>
Vec<S, D> room_corner(double x, double y, double z) {
  Vec<S, D> point;
  point[0] = S(x);
  point[1] = S(y);
  if constexpr (D == 3) point[2] = S(z);
  return point;
}

/// A point uniform in the cube [−half, half]^D.
template <class S, int D>
Vec<S, D> random_in_cube(sim::Random& random, S half) {
  const Vec<S, D> corner = Vec<S, D>::Constant(half);
  return random_in_box<S, D>(random, -corner, corner);
}

/// A vector of independent normals of standard deviation `sigma`.
template <class S, int D>
Vec<S, D> random_normal(sim::Random& random, S sigma = S(1)) {
  Vec<S, D> vector;
  for (int i = 0; i < D; ++i) vector(i) = static_cast<S>(random.normal()) * sigma;
  return vector;
}

/// A direction uniform on the sphere (circle in 2-D).
template <class S, int D>
Vec<S, D> random_direction(sim::Random& random) {
  for (;;) {
    const Vec<double, D> v = random_normal<double, D>(random);
    const double length = v.norm();
    if (length > 1e-3) return (v / length).template cast<S>();
  }
}

/// A rotation (determinant +1) uniform over SO(2) or SO(3), orthogonal to S's precision.
template <class S, int D>
Mat<S, D> random_rotation(sim::Random& random) {
  static_assert(D == 2 || D == 3);
  Mat<double, D> r;
  if constexpr (D == 2) {
    const Vec<double, 2> u = random_direction<double, 2>(random);
    r << u(0), -u(1), u(1), u(0);
  } else {
    r = rotation_matrix<double>(random_direction<double, 4>(random));
  }
  return r.template cast<S>();
}

/// Puts a sequence into a random order, each as likely (Fisher, Yates).
template <class T>
void shuffle(sim::Random& random, std::vector<T>& items) {
  for (int i = static_cast<int>(items.size()) - 1; i > 0; --i) {
    using std::swap;
    swap(items[static_cast<std::size_t>(i)], items[static_cast<std::size_t>(random.integer(0, i))]);
  }
}

}  // namespace uwbpos::test
