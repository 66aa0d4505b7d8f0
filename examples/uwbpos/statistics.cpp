// SPDX-License-Identifier: MIT
#include "statistics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace uwbpos::host {

double quantile_of_sorted(std::span<const double> ascending, double fraction) {
  if (ascending.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double place = fraction * static_cast<double>(ascending.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, ascending.size() - 1);
  return ascending[below] +
         (place - static_cast<double>(below)) * (ascending[above] - ascending[below]);
}

double quantile(std::vector<double> values, double fraction) {
  std::ranges::sort(values);
  return quantile_of_sorted(values, fraction);
}

double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

double mean(std::span<const double> values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double root_mean_square(std::span<const double> values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

double robust_spread(std::vector<double> values) {
  std::ranges::sort(values);
  const double centre = quantile_of_sorted(values, 0.5);
  for (double& value : values) value = std::abs(value - centre);
  constexpr double of_normal = 1.4826;
  return of_normal * median(std::move(values));
}

SampleSummary summarize(std::vector<double> values, double limit) {
  SampleSummary summary;
  summary.count = values.size();
  if (values.empty()) return summary;
  summary.mean = mean(values);
  summary.rms = root_mean_square(values);
  const auto outliers =
      std::ranges::count_if(values, [&](double value) { return std::abs(value) > limit; });
  summary.outlier_share = static_cast<double>(outliers) / static_cast<double>(values.size());
  summary.median = median(values);
  summary.spread = robust_spread(std::move(values));
  return summary;
}

}  // namespace uwbpos::host
