// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What is asked of a planar pose before anything is computed from it.

#include <cmath>
#include <optional>

#include "uwbpos/core/covariance.hpp"
#include "uwbpos/core/result.hpp"

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

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
