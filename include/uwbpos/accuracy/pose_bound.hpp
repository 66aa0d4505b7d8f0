// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The least variance that any unbiased estimate of a pose can have. With rows
/// \f$ (g^T, \partial h/\partial\psi) \f$ of model/tag_range.hpp,
/// \f[ J = \sum_i \begin{pmatrix} g_i \\ h_{\psi,i} \end{pmatrix}
///     \begin{pmatrix} g_i^T & h_{\psi,i} \end{pmatrix} / \sigma_i^2, \qquad
///     \operatorname{cov}(\hat p, \hat\psi) \succeq J^{-1}. \f]

#include <cmath>
#include <type_traits>

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/model/tag_range.hpp"
#include "uwbpos/model/tag_range_set.hpp"

namespace uwbpos {

namespace detail {

template <class S, int D>
Mat<S, D + 1> pose_information(TagRangeSpan<S, D> ranges, const Vec<S, D>& position, S heading) {
  const Turn<S> turn = turn_of(heading);
  Mat<S, D + 1> information = Mat<S, D + 1>::Zero();
  for (const TagRange<S, D>& r : ranges) {
    const auto predicted = predict_tag_range<S, D>(position, turn, r.lever_arm, r.anchor);
    Vec<S, D + 1> row;
    for (int k = 0; k < D; ++k) row[k] = predicted.gradient[k];
    row[D] = predicted.heading_gradient;
    add_outer(information, row, S(1) / (r.sigma * r.sigma));
  }
  return symmetric_from_lower(information);
}

template <class S, int D>
Result<Mat<S, D + 1>> pose_bound(TagRangeSpan<S, D> ranges, const Vec<S, D>& position, S heading) {
  if (ranges.empty()) return std::unexpected(Error::TooFewMeasurements);
  if (!all_finite(position) || !std::isfinite(heading)) return std::unexpected(Error::NotFinite);
  if (const auto error = check_tag_links<S, D>(ranges)) return std::unexpected(*error);
  return bound_of<S, D + 1>(pose_information<S, D>(ranges, position, heading));
}

}  // namespace detail

/// Fisher information J of (position, heading) [1/m², 1/(m·rad), 1/rad²] that ranges with the given
/// arms, anchors and sigmas hold at a pose (their measured values are not used); any n ≥ 0, inputs
/// are not checked. O(n·D²), no allocation.
template <TagRangeSet R>
[[nodiscard]] auto pose_information(
    const R& ranges,
    const std::type_identity_t<Vec<TagRangeScalar<R>, kTagRangeDimension<R>>>& position,
    std::type_identity_t<TagRangeScalar<R>> heading)
    -> Mat<TagRangeScalar<R>, kTagRangeDimension<R> + 1> {
  return detail::pose_information<TagRangeScalar<R>, kTagRangeDimension<R>>(
      as_tag_range_span(ranges), position, heading);
}

/// Cramér-Rao bound of (x, y, heading) [m², m·rad, rad²] from ranges of two tags or more in the
/// plane, or of (x, y, z, heading) in space, at the pose given by `position` [m] and `heading`
/// [rad]. O(n·D²), no allocation. Errors: Error::TooFewMeasurements, none at all;
/// Error::NotFinite; Error::NonPositiveSigma; Error::DegenerateGeometry, an unknown is not
/// determined.
template <TagRangeSet R>
[[nodiscard]] auto pose_bound(
    const R& ranges,
    const std::type_identity_t<Vec<TagRangeScalar<R>, kTagRangeDimension<R>>>& position,
    std::type_identity_t<TagRangeScalar<R>> heading)
    -> Result<Mat<TagRangeScalar<R>, kTagRangeDimension<R> + 1>> {
  return detail::pose_bound<TagRangeScalar<R>, kTagRangeDimension<R>>(as_tag_range_span(ranges),
                                                                      position, heading);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
