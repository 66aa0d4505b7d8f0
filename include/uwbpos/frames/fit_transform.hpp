// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The rigid motion between two frames from points known in both: weighted least squares without
/// scale (Umeyama, IEEE Trans. PAMI 13(4), 1991; Kabsch 1976). With weights
/// \f$ w_i = 1/\sigma_i^2 \f$ and offsets \f$ x_i, y_i \f$ of the points from their weighted
/// centroids in frame b and a,
/// \f[ H = \sum_i w_i\, y_i x_i^T = U\,\mathrm{diag}(s)\,V^T, \quad
///     R = U\,\mathrm{diag}(1, 1, \det UV^T)\,V^T, \quad t = \bar y - R \bar x \tag{1} \f]
/// and in the plane \f$ R = (c, -s; s, c) \f$ with \f$ (c, s) \propto (H_{xx} + H_{yy},\,
/// H_{yx} - H_{xy}) \f$. Covariance of the rotation and of the centroid, which are independent,
/// from which that of (δt, θ) follows, with \f$ d_i = R x_i \f$ and J of frames/transform.hpp:
/// \f[ C_\theta = \Bigl(\sum_i w_i (|d_i|^2 I - d_i d_i^T)\Bigr)^{-1}, \quad
///     C_c = I / \sum_i w_i, \quad \delta t = \delta c - \theta \times R \bar x \tag{2} \f]

#include <cmath>
#include <limits>
#include <ranges>
#include <span>
#include <type_traits>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/frames/best_rotation.hpp"

namespace uwbpos {

/// A point known in two frames, such as an anchor in its subnet and in the map.
template <class S, int D>
struct SharedPoint {
  Vec<S, D> in_b;     ///< in the frame that the transform comes from [m]
  Vec<S, D> in_a;     ///< the same point in the frame that it goes to [m]
  S sigma = S(0.05);  ///< of the two positions against each other, on each axis [m]
};

/// The smallest standard deviation of a shared point that is believed [m].
template <class S>
inline constexpr S kSmallestSharedSigma = S(1e-9);

/// When a fit is believed.
template <class S>
struct FitTransformOptions {
  /// The largest standard deviation of the rotation [rad] that is accepted (root of the trace of
  /// C_θ). Points that lie in line but for their noise fail it; first-order covariances need it.
  S max_turn_sigma = S(0.1);
};

/// A transform and how well it explains the points that it was fitted to.
template <class S, int D>
struct FittedTransform {
  Transform<S, D> a_T_b;   ///< with covariance (2)
  S rms;                   ///< root mean square distance between points as mapped and given [m]
  S worst;                 ///< the largest of those distances [m]
  int worst_point;         ///< whose it is, counted from zero
  S chi_squared;           ///< sum of the squared distances over sigma²
  int degrees_of_freedom;  ///< n·D − 3 or − 6, what `chi_squared` should be near
};

namespace detail {

/// `fit_transform` for one scalar and dimension.
template <class S, int D>
Result<FittedTransform<S, D>> fit_transform(std::span<const SharedPoint<S, D>> shared,
                                            const FitTransformOptions<S>& options) {
  const int count = static_cast<int>(shared.size());
  if (shared.size() < D) return std::unexpected(Error::TooFewMeasurements);
  if (shared.size() > kMaxMeasurements) return std::unexpected(Error::TooManyMeasurements);
  if (!(options.max_turn_sigma > S(0))) return std::unexpected(Error::InvalidOption);

  S weight_sum = S(0);
  for (const SharedPoint<S, D>& p : shared) {
    if (!all_finite(p.in_a) || !all_finite(p.in_b) || !std::isfinite(p.sigma)) {
      return std::unexpected(Error::NotFinite);
    }
    if (!(p.sigma >= kSmallestSharedSigma<S>)) return std::unexpected(Error::NonPositiveSigma);
    weight_sum += S(1) / (p.sigma * p.sigma);
  }
  // Relative to the first point: a float would spend its digits on the map's coordinates.
  Vec<S, D> centroid_a = Vec<S, D>::Zero();
  Vec<S, D> centroid_b = Vec<S, D>::Zero();
  for (const SharedPoint<S, D>& p : shared) {
    const S share = S(1) / (p.sigma * p.sigma * weight_sum);
    centroid_a += share * (p.in_a - shared[0].in_a);
    centroid_b += share * (p.in_b - shared[0].in_b);
  }
  centroid_a += shared[0].in_a;
  centroid_b += shared[0].in_b;

  Mat<S, D> h = Mat<S, D>::Zero();
  for (const SharedPoint<S, D>& p : shared) {
    const Vec<S, D> y = (p.in_a - centroid_a) / (p.sigma * p.sigma * weight_sum);
    const Vec<S, D> x = p.in_b - centroid_b;
    for (int j = 0; j < D; ++j) h.col(j) += y * x[j];
  }
  if (!all_finite(h)) return std::unexpected(Error::NumericOverflow);
  const Result<Mat<S, D>> rotation = best_rotation<S, D>(h);
  if (!rotation) return std::unexpected(rotation.error());

  FittedTransform<S, D> fit{};
  fit.a_T_b.rotation = *rotation;
  const Vec<S, D> arm = product(*rotation, centroid_b);
  fit.a_T_b.translation = centroid_a - arm;

  constexpr int K = kTurnDof<D>;
  Mat<S, K> turn_information = Mat<S, K>::Zero();
  for (int i = 0; i < count; ++i) {
    const SharedPoint<S, D>& p = shared[static_cast<std::size_t>(i)];
    const S weight = S(1) / (p.sigma * p.sigma);
    const Vec<S, D> d = product<S, D, D, 1>(*rotation, p.in_b - centroid_b);
    const Eigen::Matrix<S, D, K> lever = turn_jacobian<S, D>(d);
    for (int j = 0; j < D; ++j) {
      add_outer<S, K>(turn_information, transposed<S, 1, K>(lever.row(j)), weight);
    }
    const Vec<S, D> residual = (p.in_a - centroid_a) - d;
    const S square = squared_norm(residual);
    fit.chi_squared += square * weight;
    fit.rms += square;
    if (square > fit.worst) {
      fit.worst = square;
      fit.worst_point = i;
    }
  }
  fit.rms = std::sqrt(fit.rms / static_cast<S>(count));
  fit.worst = std::sqrt(fit.worst);
  fit.degrees_of_freedom = count * D - kTransformDof<D>;

  const Ldlt<S, K> factor{turn_information};
  if (!factor.positive_definite()) return std::unexpected(Error::RotationUndetermined);
  const Mat<S, K> turn = factor.inverse();
  if (!(turn.trace() <= options.max_turn_sigma * options.max_turn_sigma)) {
    return std::unexpected(Error::RotationUndetermined);
  }
  const Eigen::Matrix<S, D, K> swing = -turn_jacobian<S, D>(arm);
  const Eigen::Matrix<S, D, K> mixed = product(swing, turn);
  Mat<S, kTransformDof<D>>& c = fit.a_T_b.covariance;
  c.template topLeftCorner<D, D>() =
      congruence(swing, turn) + Mat<S, D>{Mat<S, D>::Identity() / weight_sum};
  c.template topRightCorner<D, K>() = mixed;
  c.template bottomLeftCorner<K, D>() = transposed(mixed);
  c.template bottomRightCorner<K, K>() = turn;
  if (!all_finite(c) || !std::isfinite(fit.chi_squared) || !all_finite(fit.a_T_b.translation)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return fit;
}

}  // namespace detail

/// The transform `a_T_b` from points known in both frames: any contiguous range of
/// `SharedPoint<S, D>`, from D to `kMaxMeasurements` of them. Mirrored or mismatched points show
/// in `rms`, `worst` and `chi_squared`, and are not refused (in space, points of one plane fit
/// their mirror image as well as themselves). O(n·D²), no allocation.
/// Errors: Error::TooFewMeasurements; Error::TooManyMeasurements; Error::NotFinite;
/// Error::NonPositiveSigma; Error::InvalidOption; Error::NumericOverflow;
/// Error::RotationUndetermined, points that coincide, lie in line (in space; in the plane a line
/// will do), are too noisy for their extent, or a mirror image that no rotation comes nearest to.
template <std::ranges::contiguous_range P,
          class S = typename decltype(std::ranges::range_value_t<P>::in_a)::Scalar,
          int D = decltype(std::ranges::range_value_t<P>::in_a)::RowsAtCompileTime>
[[nodiscard]] Result<FittedTransform<S, D>> fit_transform(
    const P& points, const FitTransformOptions<std::type_identity_t<S>>& options = {}) {
  return detail::fit_transform<S, D>(
      std::span<const SharedPoint<S, D>>{std::ranges::data(points), std::ranges::size(points)},
      options);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
