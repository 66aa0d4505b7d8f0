// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// One position from several subnets' fixes, and what their differences tell about the subnets'
/// transforms. A fix brought to the map is
/// \f[ x_i = p - J_i \xi_i + n_i, \qquad n_i \sim N(0, R_i), \tag{1} \f]
/// with \f$ \xi_i \f$ the error of its subnet's transform (frames/transform.hpp), which all fixes
/// of the subnet share for good, and \f$ n_i \f$ its own. Nothing is known of p beforehand; the
/// \f$ \xi \f$ have the joint covariance P. The first fix gives p with error
/// \f$ e = J_1 \xi_1 - n_1 \f$; each further one is a Kalman update of (p, ξ):
/// \f[ y = x_i - \hat p + J_i \hat\xi_i, \quad A = \operatorname{cov}(e, y), \quad
///     B = \operatorname{cov}(\xi, y), \quad S = \operatorname{cov}(y), \tag{2} \f]
/// \f[ \hat p \mathrel{+}= A S^{-1} y, \quad \hat\xi \mathrel{+}= B S^{-1} y, \quad
///     P \mathrel{-}= B S^{-1} B^T, \quad \chi^2 \mathrel{+}= y^T S^{-1} y. \tag{3} \f]
/// With independent transforms that is the mean weighted by inverse covariances; once the
/// differences between subnets are known it no longer counts them as errors. The covariance of p is
/// that of \f$ (I - K)\,e + K\,(J_i \xi_i - n_i),\ K = A S^{-1} \f$: in A S⁻¹ Aᵀ subtracted, a
/// good fix that follows a bad one would vanish in rounding.

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "uwbpos/core/chi_squared.hpp"
#include "uwbpos/core/covariance.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/frames/transform.hpp"

namespace uwbpos {

/// A fix of one subnet, brought to the map.
template <class S, int D>
struct Sighting {
  Vec<S, D> position;                              ///< x_i [m]
  Mat<S, D> noise;                                 ///< R_i: the fix's own covariance [m²]
  Eigen::Matrix<S, D, kTransformDof<D>> jacobian;  ///< J_i
  int slot;                                        ///< which of the transforms ξ_i is
};

/// Errors of `Slots` transforms: estimate and joint covariance.
template <class S, int D, int Slots>
struct TransformErrors {
  static constexpr int kSize = Slots * kTransformDof<D>;  ///< unknowns
  Vec<S, kSize> mean = Vec<S, kSize>::Zero();             ///< [m, rad]
  Mat<S, kSize> covariance = Mat<S, kSize>::Zero();       ///< P
};

/// A position that several sightings agree on, or not.
template <class S, int D>
struct JointFix {
  Vec<S, D> position;      ///< [m]
  Mat<S, D> covariance;    ///< transforms' errors included [m²]
  S chi_squared;           ///< of the sightings against each other
  int degrees_of_freedom;  ///< D for each sighting after the first
};

/// Equations (2) and (3) over all sightings, at least one, in the order given; `errors`, of mean
/// zero beforehand, becomes what is known after them. O(n·(Slots·D)²), no allocation.
/// Error::InvalidCovariance, an S that is not positive definite; then `errors` is in no defined
/// state.
template <class S, int D, int Slots>
[[nodiscard]] Result<JointFix<S, D>> joint_fix(std::span<const Sighting<S, D>> sightings,
                                               TransformErrors<S, D, Slots>& errors) {
  constexpr int K = kTransformDof<D>;
  constexpr int N = TransformErrors<S, D, Slots>::kSize;
  using Across = Eigen::Matrix<S, D, N>;
  Mat<S, N>& P = errors.covariance;
  // J_i times the rows of P that belong to ξ_i: cov(J_i ξ_i, ξ).
  const auto cov_with_all = [&P](const Sighting<S, D>& s) {
    return product(s.jacobian, Eigen::Matrix<S, K, N>{P.template middleRows<K>(s.slot * K)});
  };
  // The columns of `across` that belong to ξ_i, times J_iᵀ.
  const auto cov_with_own = [](const Across& across, const Sighting<S, D>& s) {
    return product(Eigen::Matrix<S, D, K>{across.template middleCols<K>(s.slot * K)},
                   transposed(s.jacobian));
  };

  const Sighting<S, D>& first = sightings.front();
  Across across = cov_with_all(first);  // cov(e, ξ)
  JointFix<S, D> joint{.position = first.position,
                       .covariance = cov_with_own(across, first) + first.noise,
                       .chi_squared = S(0),
                       .degrees_of_freedom = 0};
  for (const Sighting<S, D>& s : sightings.subspan(1)) {
    const Across own = cov_with_all(s);
    const Mat<S, D> mixed = cov_with_own(across, s);
    const Mat<S, D> a = joint.covariance - mixed;
    const Mat<S, D> of_transform = cov_with_own(own, s);
    // What rounding takes of the difference is noise where both have a large part in common, which
    // the difference has not. Of the rest S alone needs as much: a good fix beside a bad one must
    // not suffer from it.
    const S lost = S(32) * std::numeric_limits<S>::epsilon();
    const S common = lost * (S(2) * mixed.diagonal().cwiseAbs().sum());
    const S all = lost * (joint.covariance.trace() + of_transform.trace());
    Mat<S, D> noise = s.noise;
    noise.diagonal().array() += common;
    Mat<S, D> innovation = a - transposed(mixed) + of_transform + noise;
    innovation.diagonal().array() += std::max(all - common, S(0));
    const Ldlt<S, D> factor{innovation};
    if (!factor.positive_definite()) return std::unexpected(Error::InvalidCovariance);
    const Mat<S, D> inverse = factor.inverse();
    const Across bt = across - own;  // Bᵀ
    const Vec<S, D> y =
        (s.position - joint.position) +
        product<S, D, K, 1>(s.jacobian, errors.mean.template segment<K>(s.slot * K));
    const Vec<S, D> scaled = product(inverse, y);
    joint.position += product(a, scaled);
    const Mat<S, D> gain = product(a, inverse);
    const Mat<S, D> rest = Mat<S, D>::Identity() - gain;
    const Mat<S, D> shared = product(product(rest, mixed), transposed(gain));
    joint.covariance = congruence(rest, joint.covariance) + (shared + transposed(shared)) +
                       congruence(gain, Mat<S, D>{of_transform + noise});
    joint.chi_squared += std::max(dot(y, scaled), S(0));  // rounding apart
    joint.degrees_of_freedom += D;
    const Across weighted = product(inverse, bt);
    across -= product(a, weighted);
    for (int j = 0; j < N; ++j) {
      for (int k = 0; k < D; ++k) errors.mean[j] += bt(k, j) * scaled[k];
      for (int i = j; i < N; ++i) {
        for (int k = 0; k < D; ++k) P(i, j) -= bt(k, i) * weighted(k, j);
        P(j, i) = P(i, j);
      }
    }
  }
  remove_rounding<S, D>(joint.covariance);
  return joint;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
