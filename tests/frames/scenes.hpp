// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Random transforms and covariances, and errors drawn from them, for the tests of frames.

#include <cmath>

#include "uwbpos/frames/make_transform.hpp"

#include "support/random_geometry.hpp"

namespace uwbpos::test {

/// A vector of normals with covariance `p` (positive definite), by its Cholesky factor.
template <int N>
Vec<double, N> draw(sim::Random& random, const Mat<double, N>& p) {
  Mat<double, N> l = Mat<double, N>::Zero();
  for (int j = 0; j < N; ++j) {
    for (int i = j; i < N; ++i) {
      double sum = p(i, j);
      for (int k = 0; k < j; ++k) sum -= l(i, k) * l(j, k);
      l(i, j) = i == j ? std::sqrt(sum) : sum / l(j, j);
    }
  }
  return l * random_normal<double, N>(random);
}

/// A covariance with standard deviations from `low` to `high` along random directions.
template <class S, int N>
Mat<S, N> random_covariance(sim::Random& random, double low, double high) {
  Mat<double, N> p;
  for (int i = 0; i < N * N; ++i) p(i) = i % (N + 1) == 0 ? low * low : 0;
  for (int k = 0; k < N; ++k) {
    const Vec<double, N> v = random_direction<double, N>(random);
    const double length = random.uniform(0, high);
    for (int j = 0; j < N; ++j) {
      for (int i = 0; i < N; ++i) p(i, j) += v[i] * v[j] * length * length / N;
    }
  }
  Mat<S, N> covariance;
  for (int i = 0; i < N * N; ++i) covariance(i) = static_cast<S>(p(i));
  return covariance;
}

/// Any rotation, a translation within ±50 m, and errors up to 0.1 m and 0.1 rad.
template <class S, int D>
Transform<S, D> random_transform(sim::Random& random) {
  return {.rotation = orthonormalised<S, D>(random_rotation<S, D>(random)),
          .translation = random_in_cube<S, D>(random, S(50)),
          .covariance = random_covariance<S, kTransformDof<D>>(random, 0.001, 0.1)};
}

/// The true motion when the transform's error is `xi` = (δt, θ): Exp(θ)R and t + δt, exactly.
template <int D>
Transform<double, D> perturbed(const Transform<double, D>& a_T_b,
                               const Vec<double, kTransformDof<D>>& xi) {
  Mat<double, D> turn;
  if constexpr (D == 2) {
    turn << std::cos(xi[2]), -std::sin(xi[2]), std::sin(xi[2]), std::cos(xi[2]);
  } else {
    const Vec<double, 3> theta = xi.template tail<3>();
    const double angle = theta.norm();
    Mat<double, 3> k;
    k << 0, -theta[2], theta[1], theta[2], 0, -theta[0], -theta[1], theta[0], 0;
    const double a = angle > 1e-9 ? std::sin(angle) / angle : 1;
    const double b = angle > 1e-9 ? (1 - std::cos(angle)) / (angle * angle) : 0.5;
    turn = Mat<double, 3>::Identity() + a * k + b * k * k;  // Rodrigues
  }
  return {.rotation = turn * a_T_b.rotation,
          .translation = a_T_b.translation + xi.template head<D>()};
}

/// ξ such that `perturbed(estimate, ξ)` is `truth`, for small errors.
template <int D>
Vec<double, kTransformDof<D>> error_of(const Transform<double, D>& truth,
                                       const Transform<double, D>& estimate) {
  Vec<double, kTransformDof<D>> xi;
  xi.template head<D>() = truth.translation - estimate.translation;
  const Mat<double, D> turn = truth.rotation * estimate.rotation.transpose();
  if constexpr (D == 2) {
    xi[2] = std::atan2(turn(1, 0), turn(0, 0));
  } else {
    xi.template tail<3>() << (turn(2, 1) - turn(1, 2)) / 2, (turn(0, 2) - turn(2, 0)) / 2,
        (turn(1, 0) - turn(0, 1)) / 2;
  }
  return xi;
}

/// A transform in double.
template <class S, int D>
Transform<double, D> in_double(const Transform<S, D>& a_T_b) {
  return {.rotation = a_T_b.rotation.template cast<double>(),
          .translation = a_T_b.translation.template cast<double>(),
          .covariance = a_T_b.covariance.template cast<double>()};
}

/// How far R is from orthonormal and det +1, the largest departure of any entry.
template <class S, int D>
double rotation_defect(const Mat<S, D>& r) {
  const Mat<double, D> d = r.template cast<double>();
  const double gram = (d.transpose() * d - Mat<double, D>::Identity()).cwiseAbs().maxCoeff();
  return std::max(gram, std::abs(signed_volume<double, D>(d) - 1));
}

}  // namespace uwbpos::test
