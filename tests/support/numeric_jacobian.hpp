// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Derivatives by central differences, to hold written-out Jacobians to account.

#include <cmath>
#include <limits>

#include "uwbpos/core/eigen.hpp"
#include "uwbpos/core/types.hpp"

namespace uwbpos::test {

/// The step that balances rounding against truncation for arguments near one: ε^(1/3).
template <class S>
S difference_step() {
  return std::cbrt(std::numeric_limits<S>::epsilon());
}

/// Gradient (D × 1) of a scalar function of a D-vector. Error about ε^(2/3) of the function's
/// size (4e-11 in double, 2e-5 in float) for functions of unit scale.
template <class S, int D, class Function>
Vec<S, D> numeric_gradient(Function&& f, const Vec<S, D>& x, S step = difference_step<S>()) {
  Vec<S, D> gradient;
  for (int i = 0; i < D; ++i) {
    Vec<S, D> high = x;
    Vec<S, D> low = x;
    high(i) += step;
    low(i) -= step;
    gradient(i) = (f(high) - f(low)) / (high(i) - low(i));  // the step as it was rounded
  }
  return gradient;
}

/// Jacobian (M × D) of an M-vector function of a D-vector: row per output, column per argument.
template <int M, class S, int D, class Function>
Eigen::Matrix<S, M, D> numeric_jacobian(Function&& f, const Vec<S, D>& x,
                                        S step = difference_step<S>()) {
  Eigen::Matrix<S, M, D> jacobian;
  for (int i = 0; i < D; ++i) {
    Vec<S, D> high = x;
    Vec<S, D> low = x;
    high(i) += step;
    low(i) -= step;
    const Vec<S, M> change = f(high) - f(low);
    jacobian.col(i) = change / (high(i) - low(i));
  }
  return jacobian;
}

}  // namespace uwbpos::test
