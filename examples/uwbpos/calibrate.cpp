// SPDX-License-Identifier: MIT
#include "calibrate.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "statistics.hpp"

namespace uwbpos::host {
namespace {

constexpr double kStretch = 2;  // [s]
constexpr double kTuning = 1.5;

// Means of stretches of successive residuals.
std::vector<double> stretch_means(const std::vector<Residual>& residuals) {
  std::vector<double> means;
  std::vector<double> stretch;
  double start = 0;
  for (const Residual& residual : residuals) {
    if (!stretch.empty() && residual.t - start > kStretch) {
      means.push_back(mean(stretch));
      stretch.clear();
    }
    if (stretch.empty()) start = residual.t;
    stretch.push_back(residual.value);
  }
  if (!stretch.empty()) means.push_back(mean(stretch));
  return means;
}

double standard_error(const std::vector<double>& means) {
  if (means.size() < 2) return std::numeric_limits<double>::quiet_NaN();
  const double centre = mean(means);
  double sum = 0;
  for (const double value : means) sum += (value - centre) * (value - centre);
  const auto n = static_cast<double>(means.size());
  return std::sqrt(sum / (n - 1) / n);
}

}  // namespace

double huber_location(const std::vector<double>& values, double tuning) {
  constexpr int most_rounds = 50;
  constexpr double settled = 1e-7;  // [m]
  const double limit = tuning * robust_spread(values);
  double centre = median(values);
  if (!(limit > 0)) return centre;
  for (int round = 0; round < most_rounds; ++round) {
    double weights = 0;
    double sum = 0;
    for (const double value : values) {
      const double weight = std::min(1.0, limit / std::max(std::abs(value - centre), limit));
      weights += weight;
      sum += weight * value;
    }
    const double moved = sum / weights - centre;
    centre += moved;
    if (std::abs(moved) < settled) break;
  }
  return centre;
}

std::vector<LinkBias> calibrate(const Replay& against_truth) {
  std::vector<LinkBias> biases;
  for (const auto& [link, residuals] : against_truth.residuals) {
    std::vector<double> values;
    values.reserve(residuals.size());
    for (const Residual& residual : residuals) values.push_back(residual.value);
    const std::vector<double> means = stretch_means(residuals);
    biases.push_back({link.first, link.second, huber_location(values, kTuning),
                      standard_error(means), robust_spread(values), values.size(), means.size()});
  }
  return biases;
}

std::string bias_csv(const std::vector<LinkBias>& biases) {
  std::string text =
      "# range minus true distance of each link, to be subtracted; standard errors count\n"
      "# stretches of at most 2 s as one observation\n"
      "tag_id,anchor_id,bias_m,standard_error_m,spread_m,readings,stretches\n";
  for (const LinkBias& b : biases) {
    const std::string error =
        std::isfinite(b.standard_error) ? fmt::format("{:.5f}", b.standard_error) : "";
    text += fmt::format("{},{},{:.5f},{},{:.5f},{},{}\n", b.tag, b.anchor, b.bias, error, b.spread,
                        b.readings, b.stretches);
  }
  return text;
}

std::string calibration_table(const std::vector<LinkBias>& biases) {
  std::string text = fmt::format("{:>6}{:>8}{:>10}{:>10}{:>10}{:>10}{:>11}\n", "tag", "anchor",
                                 "bias", "± (1σ)", "spread", "readings", "stretches");
  bool doubtful = false;
  for (const LinkBias& b : biases) {
    // Fewer stretches than this cannot tell a place's reflections from the link's own bias.
    constexpr std::size_t enough = 5;
    const bool few = b.stretches < enough;
    doubtful = doubtful || few;
    const std::string error =
        std::isfinite(b.standard_error) ? fmt::format("{:.3f}", b.standard_error) : "?";
    text += fmt::format("{:>6}{:>8}{:>10.3f}{:>10}{:>10.3f}{:>10}{:>11}{}\n", b.tag, b.anchor,
                        b.bias, error, b.spread, b.readings, b.stretches, few ? "  few" : "");
  }
  text += "bias, its standard error and the spread of one reading in metres\n";
  if (doubtful) {
    text += "few: less than five stretches of 2 s; drive, or stand in more places, to be sure\n";
  }
  return text;
}

}  // namespace uwbpos::host
