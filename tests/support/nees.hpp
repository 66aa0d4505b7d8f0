// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The normalised squared error of an estimate with a covariance.

#include <Eigen/Core>
#include <Eigen/LU>

#include "uwbpos/core/types.hpp"

namespace uwbpos::test {

/// eᵀ P⁻¹ e in double, for e = estimate − truth; its mean is D when P is right.
template <class S, int D>
double normalised_squared_error(const Vec<S, D>& estimate, const Mat<S, D>& covariance,
                                const Vec<double, D>& truth) {
  const Vec<double, D> error = estimate.template cast<double>() - truth;
  const Mat<double, D> p = covariance.template cast<double>();
  const Vec<double, D> scaled = p.inverse() * error;
  return error.dot(scaled);
}

}  // namespace uwbpos::test
