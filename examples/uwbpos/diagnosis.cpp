// SPDX-License-Identifier: MIT
#include "diagnosis.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "recording.hpp"
#include "statistics.hpp"

namespace uwbpos::host {
namespace {

constexpr double kStandsOut = 1.25;         // times the typical anchor's rms
constexpr std::size_t kEnoughToJudge = 20;  // readings of an anchor

AnchorQuality quality_of(Id anchor, std::vector<double> residuals) {
  AnchorQuality quality;
  quality.anchor = anchor;
  quality.readings = residuals.size();
  quality.rms = root_mean_square(residuals);
  quality.spread = robust_spread(residuals);
  std::ranges::sort(residuals);
  for (const double fraction : {0.05, 0.25, 0.5, 0.75, 0.95}) {
    quality.quantiles.push_back(quantile_of_sorted(residuals, fraction));
  }
  quality.bias = quality.quantiles[2];
  const double limit = std::max(4 * quality.spread, 0.2);
  const auto outliers = std::ranges::count_if(
      residuals, [&](double residual) { return std::abs(residual - quality.bias) > limit; });
  quality.outlier_share = static_cast<double>(outliers) / static_cast<double>(residuals.size());
  return quality;
}

// The sentence that says what makes an anchor bad: the largest part of its mean square.
std::string cause(const AnchorQuality& worst, const Replay& replay) {
  const double bias = worst.bias * worst.bias;
  const double noise = worst.spread * worst.spread;
  const double outliers = std::max(worst.rms * worst.rms - bias - noise, 0.0);
  const std::string numbers = fmt::format(
      "its median is {:+.3f} m, its spread {:.3f} m, and {:.1f} % of its readings are outliers",
      worst.bias, worst.spread, 100 * worst.outlier_share);
  if (bias >= noise && bias >= outliers) {
    return replay.residuals_to_truth && !replay.of_differences
               ? fmt::format(
                     "It is mostly bias: {}. A constant bias can be measured and taken off "
                     "with `uwbpos calibrate`.",
                     numbers)
               : fmt::format(
                     "It is mostly bias: {}. Its surveyed position may be wrong, or its "
                     "ranges are constantly off.",
                     numbers);
  }
  if (outliers > noise && worst.outlier_share > 0) {
    return fmt::format("It is mostly outliers: {}. Look for what blocks or reflects its signal.",
                       numbers);
  }
  return fmt::format(
      "It is mostly noise: {}. A clearer line of sight or a better antenna place "
      "would help; calibration would not.",
      numbers);
}

}  // namespace

std::vector<AnchorQuality> anchor_qualities(const Replay& replay) {
  std::map<Id, std::vector<double>> of_anchor;
  for (const auto& [link, residuals] : replay.residuals) {
    std::vector<double>& values = of_anchor[link.second];
    for (const Residual& residual : residuals) values.push_back(residual.value);
  }
  std::vector<AnchorQuality> qualities;
  for (auto& [anchor, residuals] : of_anchor) {
    qualities.push_back(quality_of(anchor, std::move(residuals)));
  }
  std::ranges::stable_sort(qualities, [](const auto& a, const auto& b) { return a.rms > b.rms; });
  return qualities;
}

std::vector<std::string> diagnose(const Replay& replay,
                                  const std::vector<AnchorQuality>& worst_first) {
  std::vector<std::string> said;
  std::vector<Id> guilty;
  if (replay.filtering) {
    guilty = guilty_anchors(*replay.filtering);
    for (const Id anchor : guilty) {
      const AnchorTally& tally = replay.filtering->of_anchor.at(anchor);
      const auto quality = std::ranges::find(worst_first, anchor, &AnchorQuality::anchor);
      said.push_back(fmt::format(
          "Anchor {} is guilty: the filter refused {:.0f} % of its {}, which the other anchors "
          "contradict{}.",
          anchor, 100 * refused_share(tally), count_of(tally.used + tally.refused, "measurement"),
          quality == worst_first.end()
              ? std::string{}
              : fmt::format("; they are off by {:+.2f} m at the median", quality->bias)));
    }
  }
  if (worst_first.size() < 2) return said;
  const auto few = std::ranges::count_if(
      worst_first, [](const AnchorQuality& q) { return q.readings < kEnoughToJudge; });
  if (2 * static_cast<std::size_t>(few) > worst_first.size()) {
    said.push_back(fmt::format("Too few readings to judge anchors by: {} of {} have fewer than {}.",
                               few, worst_first.size(), kEnoughToJudge));
    return said;
  }
  const auto judged = std::ranges::find_if(
      worst_first, [](const AnchorQuality& q) { return q.readings >= kEnoughToJudge; });
  const AnchorQuality& worst = *judged;
  const double typical = worst_first[worst_first.size() / 2].rms;
  const std::string_view against =
      replay.residuals_to_truth ? "against the truth" : "against the solved positions";
  const std::string_view what = replay.of_differences ? "differences" : "ranges";
  const bool stands_out = worst.rms > kStandsOut * typical;
  if (stands_out) {
    said.push_back(
        fmt::format("Anchor {} is the worst: its {} are off by {:.3f} m rms {}, a "
                    "typical anchor's by {:.3f} m.",
                    worst.anchor, what, worst.rms, against, typical));
  } else if (guilty.empty()) {
    said.push_back(
        fmt::format("No anchor stands out: {} of the worst, anchor {}, are off by "
                    "{:.3f} m rms {}, a typical anchor's by {:.3f} m.",
                    what, worst.anchor, worst.rms, against, typical));
  }
  const bool calibration_helps =
      replay.residuals_to_truth && std::abs(worst.bias) > std::max(worst.spread, 0.01);
  // What a control anchor does, all differences show.
  if (stands_out || (calibration_helps && guilty.empty())) said.push_back(cause(worst, replay));

  // A control anchor takes part in all differences: no measure for the others.
  std::vector<std::size_t> heard;
  for (const AnchorQuality& quality : worst_first) heard.push_back(quality.readings);
  std::ranges::sort(heard);
  const std::size_t most = replay.of_differences ? heard[heard.size() / 2] : heard.back();
  for (const AnchorQuality& quality : worst_first) {
    if (2 * quality.readings < most) {
      said.push_back(fmt::format("Anchor {} is seldom heard: {}, {} anchor has {}.", quality.anchor,
                                 count_of(quality.readings, "reading"),
                                 replay.of_differences ? "a typical" : "the best-heard", most));
    }
  }
  if (!replay.residuals_to_truth) {
    said.emplace_back(
        "Without truth these are what is left over after solving, which hides part of each "
        "anchor's error among the others.");
  }
  return said;
}

}  // namespace uwbpos::host
