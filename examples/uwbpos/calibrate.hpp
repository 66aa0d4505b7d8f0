// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The bias of each link, from ranges and truth.

#include <filesystem>
#include <string>
#include <vector>

#include "formats.hpp"
#include "replay.hpp"

namespace uwbpos::host {

/// Estimate minus truth of one link.
struct LinkBias {
  Id tag;
  Id anchor;
  double bias;            ///< [m]
  double standard_error;  ///< of `bias` [m]; NaN when there is too little to tell
  double spread;          ///< robust standard deviation of one reading about the bias [m]
  std::size_t readings;
  std::size_t stretches;  ///< of at most 2 s, that the standard error is judged from
};

/// The bias of each link: Huber's estimate of location, tuned to 1.5 robust spreads.
///
/// Positions are solved by least squares, which passes on the *mean* error of a link, and a link's
/// error is a mixture of offsets that change from place to place (multipath): the median of such
/// a mixture settles in one of its lumps and generalises worse than the mean. A mean, on the other
/// hand, follows every reflection. Huber's estimate is the mean for what is within the spread and
/// bounds the pull of what is not. On a recording of 15 places applied to a drive, positions had
/// 5.66 cm rmse with the mean, 5.69 with Huber's, 5.75 with the mid-half mean, 5.85 with the
/// median.
///
/// Successive readings share their place's offset, so they count as one when it comes to how sure
/// the bias is: the standard error is the standard deviation of the means of stretches of at most
/// 2 s, over the root of their number.
[[nodiscard]] std::vector<LinkBias> calibrate(const Replay& against_truth);

/// The table as bias.csv, with columns beyond the format's for how sure each value is.
[[nodiscard]] std::string bias_csv(const std::vector<LinkBias>& biases);

/// The table in words, for the terminal.
[[nodiscard]] std::string calibration_table(const std::vector<LinkBias>& biases);

/// Huber's M-estimate of location with the given tuning in robust spreads.
[[nodiscard]] double huber_location(const std::vector<double>& values, double tuning);

}  // namespace uwbpos::host
