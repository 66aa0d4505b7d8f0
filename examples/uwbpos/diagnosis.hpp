// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Which anchor is the worst, and why.

#include <string>
#include <vector>

#include "replay.hpp"

namespace uwbpos::host {

/// What the ranges of one anchor, to all tags, are like.
struct AnchorQuality {
  Id anchor = 0;
  std::size_t readings = 0;
  double bias = 0;                ///< median residual [m]
  double spread = 0;              ///< robust [m]
  double rms = 0;                 ///< [m]
  double outlier_share = 0;       ///< farther than four spreads, and 0.2 m, from the median
  std::vector<double> quantiles;  ///< 5, 25, 50, 75 and 95 % of the residuals [m]
};

/// One entry per anchor that was heard, worst (largest rms) first.
[[nodiscard]] std::vector<AnchorQuality> anchor_qualities(const Replay& replay);

/// Sentences that name the worst anchor and whether it is bias, noise, outliers or too few
/// readings that make it so; or that none stands out.
[[nodiscard]] std::vector<std::string> diagnose(const Replay& replay,
                                                const std::vector<AnchorQuality>& worst_first);

}  // namespace uwbpos::host
