// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Errors of positions against truth.

#include <cstddef>
#include <vector>

#include "trajectory.hpp"

namespace uwbpos::host {

/// Errors of positions [m]; all but `rmse_xy` are of the distance in 3-D or in the plane,
/// whichever was solved. NaN where `count` is 0.
struct ErrorSummary {
  std::size_t count = 0;
  double rmse = 0;
  double mean = 0;
  double median = 0;
  double p95 = 0;
  double max = 0;
  double rmse_xy = 0;
};

/// Estimate minus truth of every scored position [m] in brief. With `dim` 2 heights do not count.
[[nodiscard]] ErrorSummary summarize_errors(const std::vector<Vec3>& errors, int dim);

/// Length of an error in the plane or in space [m].
[[nodiscard]] double error_length(const Vec3& error, int dim);

}  // namespace uwbpos::host
