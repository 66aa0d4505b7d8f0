// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Position from the fewest range differences, D of them to D + 1 anchors, in closed form (Fang,
/// IEEE Trans. AES 26(5), 1990, freed of his coordinate axes): the line and quadratic of
/// pseudorange_roots.hpp, both of whose roots may be positions.

#include "uwbpos/solve/pseudorange_roots.hpp"

namespace uwbpos {

namespace detail {

/// `tdoa_fang` for one scalar and dimension.
template <class S, int D>
Result<Mirror<S, D>> tdoa_fang(const Vec<S, D>& reference, DifferenceSpan<S, D> span) {
  if (span.size() > static_cast<std::size_t>(D)) return std::unexpected(Error::TooManyMeasurements);
  // Fang's differences have no sigma: a ten-thousandth of the longest baseline stands for it.
  S longest = S(0);
  for (const DifferenceTo<S, D>& d : span) {
    const Vec<S, D> baseline = d.anchor - reference;
    if (all_finite(baseline)) longest = std::max(longest, norm(baseline));
  }
  const S sigma = std::max(S(1e-4) * longest, kSmallestSigma<S>);
  if (const auto error = check_differences<S, D>(reference, span, sigma, D)) {
    return std::unexpected(*error);
  }
  const DifferenceView<S, D> view{reference, span, sigma};
  const Result<PseudorangeRoots<S, D>> roots = pseudorange_roots<S, D>(view);
  if (!roots) return std::unexpected(roots.error());
  if (roots->count == 0) return std::unexpected(Error::InconsistentRanges);
  return Mirror<S, D>{roots->at(0).position, roots->at(roots->count - 1).position};
}

}  // namespace detail

/// The two positions [m] that exactly D differences |p − aᵢ| − |p − reference| [m] allow, equal
/// where there is one. Exact on exact differences. O(D³), no allocation.
/// Errors: Error::TooFewMeasurements, Error::TooManyMeasurements, other than D differences;
/// Error::NotFinite; Error::ImpossibleDifference, a difference beyond its baseline by more than
/// a thousandth of it; Error::DegenerateGeometry, anchors that do not determine a line;
/// Error::InconsistentRanges, no position with positive ranges; Error::NumericOverflow.
template <DifferenceSet R>
[[nodiscard]] auto tdoa_fang(
    const std::type_identity_t<Vec<DifferenceScalar<R>, kDifferenceDimension<R>>>& reference,
    const R& differences) -> Result<Mirror<DifferenceScalar<R>, kDifferenceDimension<R>>> {
  return detail::tdoa_fang<DifferenceScalar<R>, kDifferenceDimension<R>>(
      reference, as_difference_span(differences));
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
