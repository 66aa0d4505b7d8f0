// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The least variance that any unbiased position estimate can have. Fisher information of ranges
/// with independent Gaussian noise, g the unit vectors of model/range.hpp, and the Cramér-Rao
/// bound:
/// \f[ J = \sum_i g_i g_i^T / \sigma_i^2, \qquad \operatorname{cov}(\hat p) \succeq J^{-1}. \f]

#include "uwbpos/model/difference_set.hpp"
#include "uwbpos/model/range.hpp"
#include "uwbpos/model/range_difference.hpp"
#include "uwbpos/model/range_set.hpp"

namespace uwbpos {

/// Fisher information J [1/m²] that ranges with the given anchors and sigmas hold about `position`
/// (their measured values are not used). An anchor at the position itself has no direction and
/// adds nothing. O(n·D²), no allocation, any n ≥ 0; inputs are not checked.
template <RangeSet R, class Derived>
[[nodiscard]] auto range_information(const R& ranges, const Eigen::MatrixBase<Derived>& position)
    -> Mat<RangeSetScalar<R>, kRangeSetDimension<R>> {
  using S = RangeSetScalar<R>;
  constexpr int D = kRangeSetDimension<R>;
  const Vec<S, D> at = position;
  Mat<S, D> information = Mat<S, D>::Zero();
  for (const RangeTo<S, D>& r : as_range_span(ranges)) {
    add_outer(information, predict_range<S, D>(at, r.anchor).gradient, S(1) / (r.sigma * r.sigma));
  }
  return symmetric_from_lower(information);
}

/// The inverse of a Fisher information, lower triangle read. Error::DegenerateGeometry where a
/// direction is not determined.
template <class S, int D>
[[nodiscard]] Result<Mat<S, D>> bound_of(const Mat<S, D>& information) {
  const Ldlt<S, D> factor{information};
  if (!factor.positive_definite()) return std::unexpected(Error::DegenerateGeometry);
  Mat<S, D> bound = factor.inverse();
  if (!all_finite(bound)) return std::unexpected(Error::DegenerateGeometry);
  return bound;
}

/// Cramér-Rao bound [m²] of a position found from such ranges. O(n·D²), no allocation; any n ≥ 1.
/// Errors: Error::TooFewMeasurements, none at all; Error::NotFinite; Error::NonPositiveSigma;
/// Error::DegenerateGeometry, the anchors leave a direction of the position undetermined.
template <RangeSet R, class Derived>
[[nodiscard]] auto cramer_rao_bound(const R& ranges, const Eigen::MatrixBase<Derived>& position)
    -> Result<Mat<RangeSetScalar<R>, kRangeSetDimension<R>>> {
  using S = RangeSetScalar<R>;
  constexpr int D = kRangeSetDimension<R>;
  const RangeSpan<S, D> span = as_range_span(ranges);
  const Vec<S, D> at = position;
  if (span.empty()) return std::unexpected(Error::TooFewMeasurements);
  if (!all_finite(at)) return std::unexpected(Error::NotFinite);
  for (const RangeTo<S, D>& r : span) {
    if (!all_finite(r.anchor) || !std::isfinite(r.sigma)) return std::unexpected(Error::NotFinite);
    if (!(r.sigma >= kSmallestSigma<S>)) return std::unexpected(Error::NonPositiveSigma);
  }
  return bound_of(range_information(span, at));
}

/// Cramér-Rao bound [m²] of a position found from differences against `reference`, each of two
/// arrivals of standard deviation `sigma` [m] (their measured values are not used):
/// \f$ J = G^T Q^{-1} G = \sum (g_i - \bar g)(g_i - \bar g)^T / \sigma^2 \f$ over all anchors.
/// O(n·D²), no allocation. Errors: Error::TooFewMeasurements; Error::NotFinite;
/// Error::NonPositiveSigma; Error::DegenerateGeometry.
template <DifferenceSet R, class Derived>
[[nodiscard]] auto cramer_rao_bound(
    const std::type_identity_t<Vec<DifferenceScalar<R>, kDifferenceDimension<R>>>& reference,
    const R& differences, std::type_identity_t<DifferenceScalar<R>> sigma,
    const Eigen::MatrixBase<Derived>& position)
    -> Result<Mat<DifferenceScalar<R>, kDifferenceDimension<R>>> {
  using S = DifferenceScalar<R>;
  constexpr int D = kDifferenceDimension<R>;
  const Vec<S, D> at = position;
  if (std::ranges::empty(differences)) return std::unexpected(Error::TooFewMeasurements);
  if (!all_finite(at) || !all_finite(reference) || !std::isfinite(sigma)) {
    return std::unexpected(Error::NotFinite);
  }
  if (!(sigma >= kSmallestSigma<S>)) return std::unexpected(Error::NonPositiveSigma);
  Vec<S, D> mean = predict_range<S, D>(at, reference).gradient;
  for (const DifferenceTo<S, D>& d : differences) {
    if (!all_finite(d.anchor)) return std::unexpected(Error::NotFinite);
    mean += predict_range<S, D>(at, d.anchor).gradient;
  }
  mean /= static_cast<S>(std::ranges::size(differences) + 1);
  const S weight = S(1) / (sigma * sigma);
  Mat<S, D> information = Mat<S, D>::Zero();
  const auto add = [&](const Vec<S, D>& anchor) {
    const Vec<S, D> off = predict_range<S, D>(at, anchor).gradient - mean;
    add_outer(information, off, weight);
  };
  add(reference);
  for (const DifferenceTo<S, D>& d : differences) add(d.anchor);
  return bound_of(information);
}

/// Cramér-Rao bound [m²] of a position found from differences between pairs of anchors with
/// independent noise of their own sigmas: J = Σ (g_b − g_a)(g_b − g_a)ᵀ/σ². O(n·D²), no allocation.
/// Errors: Error::TooFewMeasurements; Error::NotFinite; Error::NonPositiveSigma;
/// Error::DegenerateGeometry.
template <PairDifferenceSet R, class Derived>
[[nodiscard]] auto cramer_rao_bound(const R& differences,
                                    const Eigen::MatrixBase<Derived>& position)
    -> Result<Mat<DifferenceScalar<R>, kDifferenceDimension<R>>> {
  using S = DifferenceScalar<R>;
  constexpr int D = kDifferenceDimension<R>;
  const Vec<S, D> at = position;
  if (std::ranges::empty(differences)) return std::unexpected(Error::TooFewMeasurements);
  if (!all_finite(at)) return std::unexpected(Error::NotFinite);
  Mat<S, D> information = Mat<S, D>::Zero();
  for (const PairDifference<S, D>& d : differences) {
    if (!all_finite(d.anchor_a) || !all_finite(d.anchor_b) || !std::isfinite(d.sigma)) {
      return std::unexpected(Error::NotFinite);
    }
    if (!(d.sigma >= kSmallestSigma<S>)) return std::unexpected(Error::NonPositiveSigma);
    const auto predicted = predict_range_difference<S, D>(at, d.anchor_a, d.anchor_b);
    add_outer(information, predicted.gradient, S(1) / (d.sigma * d.sigma));
  }
  return bound_of(information);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
