// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Summaries of samples.

#include <cstddef>
#include <functional>
#include <span>
#include <utility>
#include <vector>

namespace uwbpos::host {

/// The quantile of ascending values, linear between neighbours; NaN of none. 0 ≤ fraction ≤ 1.
[[nodiscard]] double quantile_of_sorted(std::span<const double> ascending, double fraction);

[[nodiscard]] double quantile(std::vector<double> values, double fraction);
[[nodiscard]] double median(std::vector<double> values);
[[nodiscard]] double mean(std::span<const double> values);
[[nodiscard]] double root_mean_square(std::span<const double> values);

/// 1.4826 × the median absolute deviation: the standard deviation of a normal sample, whatever its
/// few outliers are.
[[nodiscard]] double robust_spread(std::vector<double> values);

/// From each row to the next by `projection`, a number; steps of zero and back are left out.
template <class Rows, class Projection>
[[nodiscard]] std::vector<double> steps_forward(const Rows& rows, const Projection& projection) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const auto from = std::invoke(projection, rows[i - 1]);
    const auto to = std::invoke(projection, rows[i]);
    if (to > from) steps.push_back(static_cast<double>(to - from));
  }
  return steps;
}

/// The median of those; zero of a single row.
template <class Rows, class Projection>
[[nodiscard]] double usual_step(const Rows& rows, const Projection& projection) {
  std::vector<double> steps = steps_forward(rows, projection);
  return steps.empty() ? 0 : median(std::move(steps));
}

/// A sample of signed errors in brief.
struct SampleSummary {
  std::size_t count = 0;
  double mean = 0;
  double median = 0;
  double spread = 0;  ///< robust
  double rms = 0;
  double outlier_share = 0;  ///< fraction farther than the limit from zero
};

/// Outliers lie farther than `limit` from zero.
[[nodiscard]] SampleSummary summarize(std::vector<double> values, double limit);

}  // namespace uwbpos::host
