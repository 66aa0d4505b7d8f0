// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The normalised squared error of an estimate with a covariance.

#include <array>
#include <cstddef>
#include <limits>

#include "uwbpos/core/types.hpp"

namespace uwbpos::test {

/// eᵀ P⁻¹ e for an n × n symmetric P, stored densely, by its LDLᵀ factors; NaN unless P is positive
/// definite. One function for all sizes, or each test would spend its seconds on compiling another.
inline double quadratic_form(const double* p, const double* e, std::size_t n) {
  constexpr std::size_t kMost = 32;
  std::array<std::array<double, kMost>, kMost> l{};
  std::array<double, kMost> d{};
  std::array<double, kMost> y{};
  double sum = 0;
  for (std::size_t j = 0; j < n; ++j) {
    d[j] = p[j * n + j];
    y[j] = e[j];
    for (std::size_t k = 0; k < j; ++k) {
      d[j] -= l[j][k] * l[j][k] * d[k];
      y[j] -= l[j][k] * y[k];
    }
    if (!(d[j] > 0)) return std::numeric_limits<double>::quiet_NaN();
    sum += y[j] * y[j] / d[j];
    for (std::size_t i = j + 1; i < n; ++i) {
      l[i][j] = p[j * n + i];
      for (std::size_t k = 0; k < j; ++k) l[i][j] -= l[i][k] * l[j][k] * d[k];
      l[i][j] /= d[j];
    }
  }
  return sum;
}

/// eᵀ P⁻¹ e in double, for e = estimate − truth; its mean is D when P is right.
template <class S, int D>
double normalised_squared_error(const Vec<S, D>& estimate, const Mat<S, D>& covariance,
                                const Vec<double, D>& truth) {
  static_assert(D <= 32);
  const Vec<double, D> error = estimate.template cast<double>() - truth;
  const Mat<double, D> p = covariance.template cast<double>();
  return quadratic_form(p.data(), error.data(), static_cast<std::size_t>(D));
}

}  // namespace uwbpos::test
