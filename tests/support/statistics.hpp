// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Statistics that tests judge samples by.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <vector>

namespace uwbpos::test {

/// Arithmetic mean; NaN of nothing.
inline double mean(const std::vector<double>& samples) {
  double sum = 0;
  for (const double x : samples) sum += x;
  return sum / static_cast<double>(samples.size());
}

/// Unbiased sample variance; NaN of fewer than two.
inline double variance(const std::vector<double>& samples) {
  const double m = mean(samples);
  double sum = 0;
  for (const double x : samples) sum += (x - m) * (x - m);
  return sum / (static_cast<double>(samples.size()) - 1);
}

inline double standard_deviation(const std::vector<double>& samples) {
  return std::sqrt(variance(samples));
}

/// Square root of the mean square.
inline double root_mean_square(const std::vector<double>& samples) {
  double sum = 0;
  for (const double x : samples) sum += x * x;
  return std::sqrt(sum / static_cast<double>(samples.size()));
}

/// The p-quantile, 0 ≤ p ≤ 1, interpolated linearly between order statistics; NaN of nothing.
inline double quantile(std::vector<double> samples, double p) {
  if (samples.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(samples.begin(), samples.end());
  const double place = p * static_cast<double>(samples.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, samples.size() - 1);
  return samples[below] + (place - static_cast<double>(below)) * (samples[above] - samples[below]);
}

inline double median(const std::vector<double>& samples) { return quantile(samples, 0.5); }

/// 1.4826 × median absolute deviation from the median: the standard deviation of the normal
/// part of a sample with outliers.
inline double robust_deviation(const std::vector<double>& samples) {
  const double centre = median(samples);
  std::vector<double> deviations;
  deviations.reserve(samples.size());
  for (const double x : samples) deviations.push_back(std::abs(x - centre));
  return 1.4826 * median(deviations);
}

/// Standard normal quantile, 0 < p < 1, by bisection of erfc: slow, good to 1e-12.
inline double normal_quantile(double p) {
  double low = -40;
  double high = 40;
  for (int i = 0; i < 100; ++i) {
    const double middle = (low + high) / 2;
    (std::erfc(-middle / std::numbers::sqrt2) / 2 < p ? low : high) = middle;
  }
  return (low + high) / 2;
}

/// Share of a χ² distribution below x: the regularised incomplete gamma function P(k/2, x/2) by
/// its power series, good to 1e-12 for x up to some ten deviations above k.
inline double chi_squared_cdf(double x, double degrees_of_freedom) {
  if (!(x > 0)) return 0;
  const double a = degrees_of_freedom / 2;
  const double half = x / 2;
  double term = 1 / a;
  double sum = term;
  for (double n = 1; term > 1e-16 * sum; ++n) {
    term *= half / (a + n);
    sum += term;
  }
  return sum * std::exp(a * std::log(half) - half - std::lgamma(a));
}

/// χ² quantile, 0 < p < 1, by bisection of `chi_squared_cdf`; good to 1e-9.
inline double chi_squared_quantile(double p, double degrees_of_freedom) {
  double low = 0;
  double high = degrees_of_freedom + 10 * std::sqrt(2 * degrees_of_freedom) + 50;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (chi_squared_cdf(middle, degrees_of_freedom) < p ? low : high) = middle;
  }
  return (low + high) / 2;
}

/// An interval, both ends included.
struct Interval {
  double low;
  double high;

  [[nodiscard]] bool contains(double x) const { return low <= x && x <= high; }
};

/// Where the mean of `count` independent normalised squared errors of `dimension` components
/// (NEES, NIS) lies with the given confidence when the covariances are right.
inline Interval mean_nees_interval(int dimension, std::size_t count, double confidence = 0.99) {
  const auto n = static_cast<double>(count);
  const double dof = n * dimension;
  const double tail = (1 - confidence) / 2;
  return {chi_squared_quantile(tail, dof) / n, chi_squared_quantile(1 - tail, dof) / n};
}

/// Where the mean of `count` independent samples of standard deviation `sigma` about `expected`
/// lies with the given confidence.
inline Interval mean_interval(double expected, double sigma, std::size_t count,
                              double confidence = 0.99) {
  const double half =
      normal_quantile((1 + confidence) / 2) * sigma / std::sqrt(static_cast<double>(count));
  return {expected - half, expected + half};
}

/// Where the sample variance of `count` independent normal samples lies, over the true variance.
inline Interval variance_ratio_interval(std::size_t count, double confidence = 0.99) {
  const double dof = static_cast<double>(count) - 1;
  const double tail = (1 - confidence) / 2;
  return {chi_squared_quantile(tail, dof) / dof, chi_squared_quantile(1 - tail, dof) / dof};
}

}  // namespace uwbpos::test
