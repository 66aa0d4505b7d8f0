// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What is asked of a planar pose before anything is computed from it.

#include <algorithm>
#include <cmath>
#include <optional>

#include "uwbpos/core/result.hpp"
#include "uwbpos/frames/make_transform.hpp"

namespace uwbpos {

/// The first thing wrong with a pose, or nothing; a covariance of zeros is exact knowledge and
/// passes. O(1), no allocation. Error::NotFinite; Error::InvalidCovariance.
template <class S>
[[nodiscard]] std::optional<Error> check_pose(const Pose2<S>& pose) {
  if (!all_finite(pose.position) || !std::isfinite(pose.heading) || !all_finite(pose.covariance)) {
    return Error::NotFinite;
  }
  if (!looks_like_covariance<S, 3>(pose.covariance)) return Error::InvalidCovariance;
  return std::nullopt;
}

/// A propagated covariance without what rounding may leave of singular ones: variances below zero,
/// correlations above one. O(1), no allocation.
template <class S, int N>
[[nodiscard]] Mat<S, N> without_rounding(Mat<S, N> p) {
  for (int i = 0; i < N; ++i) p(i, i) = std::max(p(i, i), S(0));
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < i; ++j) {
      const S bound = std::sqrt(p(i, i)) * std::sqrt(p(j, j));
      p(i, j) = p(j, i) = std::clamp(p(i, j), -bound, bound);
    }
  }
  return p;
}

}  // namespace uwbpos
