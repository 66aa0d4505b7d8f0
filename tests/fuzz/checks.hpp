// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What every fix must be, whatever it was made from, and options out of bytes.

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>

#include "uwbpos/solve/exclude_outliers.hpp"

#include "bytes.hpp"

namespace uwbpos::fuzz {

/// Whether a symmetric matrix of n rows has a Cholesky factor, which takes the place of its lower
/// triangle.
inline bool has_root(std::span<double> matrix, std::size_t n) {
  for (std::size_t j = 0; j < n; ++j) {
    for (std::size_t i = j; i < n; ++i) {
      double sum = matrix[i * n + j];
      for (std::size_t k = 0; k < j; ++k) sum -= matrix[i * n + k] * matrix[j * n + k];
      if (i == j && !(sum > 0)) return false;
      matrix[i * n + j] = i == j ? std::sqrt(sum) : sum / matrix[j * n + j];
    }
  }
  return true;
}

/// A few roundings of the two variances that bound a covariance.
template <class S>
inline constexpr S kRounding = S(64) * std::numeric_limits<S>::epsilon();

/// Finite and symmetric; no variance is negative, no correlation above one.
template <class S, int D>
void check_correlations(const Mat<S, D>& covariance) {
  for (int i = 0; i < D; ++i) {
    require(std::isfinite(covariance(i, i)) && covariance(i, i) >= 0, "variances are not negative");
    for (int j = 0; j < i; ++j) {
      const S mean = std::sqrt(covariance(i, i)) * std::sqrt(covariance(j, j));
      require(std::abs(covariance(i, j)) <= mean * (1 + kRounding<S>),
              "correlations are within one");
      require(std::abs(covariance(i, j) - covariance(j, i)) <= mean * kRounding<S>,
              "the covariance is symmetric");
    }
  }
}

/// The same, and no direction has a negative variance.
template <class S, int D>
void check_covariance(const Mat<S, D>& covariance) {
  check_correlations<S, D>(covariance);
  // Correlations, and on the diagonal as much more as rounding may have taken.
  std::array<double, std::size_t{D * D}> correlation{};
  for (int i = 0; i < D; ++i) {
    for (int j = 0; j <= i; ++j) {
      const double mean = std::sqrt(double(covariance(i, i))) * std::sqrt(double(covariance(j, j)));
      double& entry = correlation[static_cast<std::size_t>(i * D + j)];
      if (mean > 0) entry = double(covariance(i, j)) / mean;
      if (i == j) entry = 1 + D * double(kRounding<S>);
    }
  }
  require(has_root(correlation, D), "no direction has a negative variance");
}

template <class S>
void check_heading(S heading) {
  require(heading > -std::numbers::pi_v<S> && heading <= std::numbers::pi_v<S>, "heading wraps");
}

template <class S, int D>
void check(const Result<Fix<S, D>>& fix, std::size_t ranges) {
  if (!fix) {
    require(!describe(fix.error()).empty(), "every error has a description");
    return;
  }
  for (const S coordinate : fix->position) require(std::isfinite(coordinate), "finite position");
  require(fix->chi_squared >= 0 && std::isfinite(fix->chi_squared), "chi squared");
  require(fix->degrees_of_freedom == static_cast<int>(ranges) - D, "degrees of freedom");
  check_covariance<S, D>(fix->covariance);
}

/// A fix without the outliers among `count` measurements.
template <class S, int D>
void check_kept(const ExclusionFix<S, D>& kept, std::size_t count) {
  require(std::popcount(kept.excluded) == kept.excluded_count, "those left out are counted");
  require(count >= 64 || (kept.excluded >> count) == 0, "only those given are left out");
  check<S, D>(kept.fix, count - static_cast<std::size_t>(kept.excluded_count));
}

template <class S, int D>
LocateOptions<S, D> take_options(Bytes& bytes, std::uint8_t flags) {
  LocateOptions<S, D> options;
  if ((flags & 1) != 0) {
    for (S& coordinate : options.side) coordinate = bytes.number(S(1));
  }
  if ((flags & 2) != 0) {
    options.prior.emplace();
    for (S& coordinate : *options.prior) coordinate = bytes.number(S(0.01));
  }
  return options;
}

}  // namespace uwbpos::fuzz
