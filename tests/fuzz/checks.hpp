// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What every fix must be, whatever it was made from, and options out of bytes.

#include <cmath>
#include <cstdint>
#include <limits>

#include "uwbpos/solve/mirror_choice.hpp"

#include "bytes.hpp"

namespace uwbpos::fuzz {

template <class S, int D>
void check_covariance(const Mat<S, D>& covariance) {
  // A few roundings of the two variances that bound the covariance.
  constexpr S kRounding = 64 * std::numeric_limits<S>::epsilon();
  for (int i = 0; i < D; ++i) {
    require(std::isfinite(covariance(i, i)) && covariance(i, i) >= 0, "variances are not negative");
    for (int j = 0; j < i; ++j) {
      const S mean = std::sqrt(covariance(i, i)) * std::sqrt(covariance(j, j));
      require(std::abs(covariance(i, j)) <= mean * (1 + kRounding), "correlations are within one");
      require(std::abs(covariance(i, j) - covariance(j, i)) <= mean * kRounding,
              "the covariance is symmetric");
    }
  }
}

template <class S, int D>
void check(const Result<Fix<S, D>>& fix, std::size_t ranges) {
  if (!fix) {
    require(!describe(fix.error()).empty(), "every error has a description");
    return;
  }
  for (const S coordinate : fix->position) require(std::isfinite(coordinate), "finite position");
  require(fix->chi_squared >= 0, "chi squared is not negative");
  require(fix->degrees_of_freedom == static_cast<int>(ranges) - D, "degrees of freedom");
  check_covariance<S, D>(fix->covariance);
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
