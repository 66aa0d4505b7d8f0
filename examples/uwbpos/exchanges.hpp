// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// From raw counter readings to ranges. Three messages: asymmetric double-sided. Two: single-sided
/// with the logged clock offset, or with the responder's rate tracked over the successive
/// exchanges of the link.

#include <optional>
#include <vector>

#include "formats.hpp"
#include "reasons.hpp"
#include "settings.hpp"
#include "statistics.hpp"

namespace uwbpos::host {

/// A range whose truth is known, for scoring.
struct ScoredRange {
  double t;
  Id tag;
  Id anchor;
  double truth;                       ///< [m]
  double range;                       ///< [m]
  std::optional<double> logged;       ///< the module's own [m]
  std::optional<double> uncorrected;  ///< single-sided as if both clocks agreed [m]
};

struct Ranging {
  std::vector<Reading> readings;  ///< by time
  Counts refused;                 ///< exchanges, by reason
  std::size_t exchanges = 0;
  std::size_t double_sided = 0;
  std::size_t single_sided_logged = 0;  ///< with `clock_offset_ppm`
  std::size_t single_sided_tracked = 0;
  unsigned counter_bits = 40;
  std::vector<ScoredRange> scored;  ///< those with `true_range_m`
};

/// How many bits the log's counter has: 32 if no reading needs more, else 40.
[[nodiscard]] unsigned find_counter_bits(const std::vector<Exchange>& exchanges);

/// Exchanges must ascend in time. Antenna delays are taken as calibrated in the modules.
[[nodiscard]] Ranging ranges_from_exchanges(const std::vector<Exchange>& exchanges,
                                            const Settings& settings,
                                            const std::optional<RangeBias<double>>& power_bias);

/// Errors of ranges farther than this from zero count as outliers [m].
inline constexpr double kRangeOutlier = 0.6;

/// Errors of the scored ranges of one method.
struct RangeScore {
  SampleSummary ours;
  /// Mean over links and distances, each with five ranges or more, of the robust spread there [m]:
  /// the noise alone, without what changes from place to place. Of the module's ranges likewise.
  std::optional<double> spread_at_one_distance;
  std::optional<double> logged_spread_at_one_distance;
  std::optional<SampleSummary> logged;
  std::optional<SampleSummary> uncorrected;
};

[[nodiscard]] RangeScore score_ranges(const std::vector<ScoredRange>& ranges);

}  // namespace uwbpos::host
