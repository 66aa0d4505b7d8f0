// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The least variance that any unbiased position estimate can have. Fisher information of ranges
/// with independent Gaussian noise, g the unit vectors of model/range.hpp, and the Cramér-Rao
/// bound:
/// \f[ J = \sum_i g_i g_i^T / \sigma_i^2, \qquad \operatorname{cov}(\hat p) \succeq J^{-1}. \f]

#include "uwbpos/model/range.hpp"
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
  const Ldlt<S, D> information{range_information(span, at)};
  if (!information.positive_definite()) return std::unexpected(Error::DegenerateGeometry);
  const Mat<S, D> bound = information.inverse();
  if (!all_finite(bound)) return std::unexpected(Error::DegenerateGeometry);
  return bound;
}

}  // namespace uwbpos
