// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Dilution of precision: how geometry alone turns one metre of range error into metres of position
/// error. With G the rows of unit vectors from the anchors to the position, Q = (GᵀG)⁻¹:
/// \f[ \mathrm{PDOP} = \sqrt{\operatorname{tr} Q}, \quad \mathrm{HDOP} = \sqrt{Q_{xx} + Q_{yy}},
///     \quad \mathrm{VDOP} = \sqrt{Q_{zz}}. \f]

#include <cmath>

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/model/pseudorange.hpp"

namespace uwbpos {

/// Dilutions of precision, without unit. `gdop` counts every unknown; ranges have no unknown but
/// the position, so theirs equals `pdop` and `tdop` = 0. In the plane `hdop` = `pdop`, `vdop` = 0.
template <class S>
struct Dop {
  S gdop;  ///< of everything that is solved for
  S pdop;  ///< of the position
  S hdop;  ///< of x and y
  S vdop;  ///< of z
  S tdop;  ///< of the common bias
};

/// The dilutions by GᵀG of N unknowns, the position first and a bias, if N > D, last. O(N³).
/// Error::DegenerateGeometry, an unknown is not determined.
template <class S, int D, int N>
[[nodiscard]] Result<Dop<S>> dilutions_of(const Mat<S, N>& information) {
  const Result<Mat<S, N>> q = bound_of(information);
  if (!q) return std::unexpected(q.error());
  const S horizontal = (*q)(0, 0) + (*q)(1, 1);
  const S vertical = D == 3 ? (*q)(D - 1, D - 1) : S(0);
  const S bias = N > D ? (*q)(N - 1, N - 1) : S(0);
  const S all = horizontal + vertical + bias;
  if (!std::isfinite(all)) return std::unexpected(Error::DegenerateGeometry);
  return Dop<S>{std::sqrt(all), std::sqrt(horizontal + vertical), std::sqrt(horizontal),
                std::sqrt(vertical), std::sqrt(bias)};
}

/// Dilutions for ranges to `anchors`, any contiguous range of Vec<S, D> [m], seen from `position`
/// [m]. An anchor at the position itself has no direction and adds nothing. O(n·D²), no allocation.
/// Errors: Error::TooFewMeasurements below D anchors; Error::NotFinite; Error::DegenerateGeometry,
/// a direction of the position is not determined.
template <std::ranges::contiguous_range A, class S = typename std::ranges::range_value_t<A>::Scalar,
          int D = std::ranges::range_value_t<A>::RowsAtCompileTime>
  requires(D == 2 || D == 3)
[[nodiscard]] Result<Dop<S>> range_dop(const A& anchors,
                                       const std::type_identity_t<Vec<S, D>>& position) {
  if (std::ranges::size(anchors) < static_cast<std::size_t>(D)) {
    return std::unexpected(Error::TooFewMeasurements);
  }
  if (!all_finite(position)) return std::unexpected(Error::NotFinite);
  Mat<S, D> information = Mat<S, D>::Zero();
  for (const Vec<S, D>& anchor : anchors) {
    if (!all_finite(anchor)) return std::unexpected(Error::NotFinite);
    add_outer(information, predict_range<S, D>(position, anchor).gradient, S(1));
  }
  return dilutions_of<S, D, D>(information);
}

/// Dilutions for pseudoranges to `anchors`, or for differences between them: σ of one arrival times
/// `pdop` is the least rms error. As `range_dop`, with the common bias as one more unknown and
/// D + 1 anchors at least.
template <std::ranges::contiguous_range A, class S = typename std::ranges::range_value_t<A>::Scalar,
          int D = std::ranges::range_value_t<A>::RowsAtCompileTime>
  requires(D == 2 || D == 3)
[[nodiscard]] Result<Dop<S>> pseudorange_dop(const A& anchors,
                                             const std::type_identity_t<Vec<S, D>>& position) {
  if (std::ranges::size(anchors) < static_cast<std::size_t>(D + 1)) {
    return std::unexpected(Error::TooFewMeasurements);
  }
  if (!all_finite(position)) return std::unexpected(Error::NotFinite);
  Mat<S, D + 1> information = Mat<S, D + 1>::Zero();
  for (const Vec<S, D>& anchor : anchors) {
    if (!all_finite(anchor)) return std::unexpected(Error::NotFinite);
    add_outer(information, predict_pseudorange<S, D>(position, S(0), anchor).gradient, S(1));
  }
  return dilutions_of<S, D, D + 1>(information);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
