// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Maximum-likelihood position from range differences against one shared reference, whose noise
/// the sharing correlates: \f$ Q = \sigma^2 (I + 1 1^T) \f$, σ of one arrival. The minimum of
/// \f$ e^T Q^{-1} e \f$ is that of pseudoranges with a common bias (model/pseudorange.hpp), so it
/// is found there, by the closed form's roots and Newton's descent.

#include "uwbpos/solve/pseudorange_least_squares.hpp"

namespace uwbpos {

/// The position part of a fix with bias.
template <class S, int D>
[[nodiscard]] Fix<S, D> position_of(const BiasedFix<S, D>& biased) {
  Fix<S, D> fix;
  fix.position = biased.position;
  for (int j = 0; j < D; ++j) {
    for (int i = 0; i < D; ++i) fix.covariance(i, j) = biased.covariance(i, j);
  }
  fix.chi_squared = biased.chi_squared;
  fix.degrees_of_freedom = biased.degrees_of_freedom;
  return fix;
}

namespace detail {

/// `tdoa_least_squares` for one scalar and dimension.
template <class S, int D>
Result<Fix<S, D>> tdoa_least_squares(const Vec<S, D>& reference, DifferenceSpan<S, D> span, S sigma,
                                     const LocateOptions<S, D>& options) {
  const DifferenceView<S, D> view{reference, span, sigma};
  if (is_range_count(span.size(), D) && !check_options(options)) {
    const auto direct = direct_pseudoranges<S, D, S>(view);
    if (is_answer<S, D>(direct, view)) return position_of<S, D>(direct, view);
  }
  if (const auto error = check_differences<S, D>(reference, span, sigma, D)) {
    return std::unexpected(*error);
  }
  if (const auto error = check_options(options)) return std::unexpected(*error);
  const Result<BiasedFix<S, D>> biased = solve_pseudoranges<S, D>(view, options);
  if (!biased) return std::unexpected(biased.error());
  return position_of(*biased);
}

}  // namespace detail

/// Position [m] from n ≥ D differences |p − aᵢ| − |p − reference| [m], each of two arrivals of
/// standard deviation `sigma` [m], in the anchors' frame, with its covariance, at the Cramér-Rao
/// bound. Where all differences are equal it is as good as elsewhere. Two positions that explain
/// the differences are settled by `options`. O(n·D²) an iteration, no allocation.
/// Errors: those of `check_differences`; Error::NotFinite in an option;
/// Error::DegenerateGeometry; Error::AmbiguousSolution; Error::InconsistentRanges, no position
/// with positive ranges; Error::NotConverged; Error::NumericOverflow.
template <DifferenceSet R>
[[nodiscard]] auto tdoa_least_squares(
    const std::type_identity_t<Vec<DifferenceScalar<R>, kDifferenceDimension<R>>>& reference,
    const R& differences, std::type_identity_t<DifferenceScalar<R>> sigma,
    const std::type_identity_t<LocateOptions<DifferenceScalar<R>, kDifferenceDimension<R>>>&
        options = {}) -> Result<Fix<DifferenceScalar<R>, kDifferenceDimension<R>>> {
  return detail::tdoa_least_squares<DifferenceScalar<R>, kDifferenceDimension<R>>(
      reference, as_difference_span(differences), sigma, options);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
