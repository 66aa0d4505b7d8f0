// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The bound that the χ² of consistent data stays below with a given confidence,
/// \f[ \nu \left( 1 - \tfrac{2}{9\nu} + z \sqrt{\tfrac{2}{9\nu}} \right)^3 \f]
/// (Wilson, Hilferty 1931; ν the degrees of freedom, z the normal quantile of the confidence).

#include <cmath>

namespace uwbpos {

/// The χ² that only as large a share of consistent data exceeds as lies `sigmas` above the mean of
/// a normal distribution. Within 6 % of the quantile for 1 … 9 degrees of freedom and up to
/// 4 sigmas. O(1).
template <class S>
[[nodiscard]] S chi_squared_gate(int degrees_of_freedom, S sigmas) {
  const S n = static_cast<S>(degrees_of_freedom);
  const S step = S(2) / (S(9) * n);
  const S root = S(1) - step + sigmas * std::sqrt(step);
  return n * root * root * root;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
