// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Dilution of precision: how geometry alone turns one metre of range error into metres of position
/// error. With G the rows of unit vectors from the anchors to the position, Q = (GᵀG)⁻¹:
/// \f[ \mathrm{PDOP} = \sqrt{\operatorname{tr} Q}, \quad \mathrm{HDOP} = \sqrt{Q_{xx} + Q_{yy}},
///     \quad \mathrm{VDOP} = \sqrt{Q_{zz}}. \f]

#include <cmath>

#include "uwbpos/accuracy/cramer_rao.hpp"

namespace uwbpos {

/// Dilutions of precision, without unit. In the plane `hdop` = `pdop` and `vdop` = 0.
template <class S>
struct Dop {
  S gdop;  ///< of every unknown; ranges have none but the position, so theirs equals `pdop`
  S pdop;  ///< of the position
  S hdop;  ///< of x and y
  S vdop;  ///< of z
};

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
  const Ldlt<S, D> factor{information};
  if (!factor.positive_definite()) return std::unexpected(Error::DegenerateGeometry);
  const Mat<S, D> q = factor.inverse();
  const S horizontal = q(0, 0) + q(1, 1);
  const S vertical = D == 3 ? q(D - 1, D - 1) : S(0);
  const S position_dilution = std::sqrt(horizontal + vertical);
  if (!std::isfinite(position_dilution)) return std::unexpected(Error::DegenerateGeometry);
  return Dop<S>{position_dilution, position_dilution, std::sqrt(horizontal), std::sqrt(vertical)};
}

}  // namespace uwbpos
