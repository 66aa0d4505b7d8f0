// SPDX-License-Identifier: MIT
#include "scoring.hpp"

#include <algorithm>
#include <cmath>

#include "statistics.hpp"

namespace uwbpos::host {

double error_length(const Vec3& error, int dim) {
  const double plane = std::hypot(error.x(), error.y());
  return dim == 2 ? plane : std::hypot(plane, error.z());
}

ErrorSummary summarize_errors(const std::vector<Vec3>& errors, int dim) {
  std::vector<double> lengths;
  std::vector<double> in_plane;
  for (const Vec3& error : errors) {
    lengths.push_back(error_length(error, dim));
    in_plane.push_back(error_length(error, 2));
  }
  std::ranges::sort(lengths);
  return {errors.size(),
          root_mean_square(lengths),
          mean(lengths),
          quantile_of_sorted(lengths, 0.5),
          quantile_of_sorted(lengths, 0.95),
          quantile_of_sorted(lengths, 1),
          root_mean_square(in_plane)};
}

}  // namespace uwbpos::host
