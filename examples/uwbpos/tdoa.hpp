// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Positions from a log of range differences between changing pairs of anchors: which of them are
/// solved together, and solving them.

#include <functional>
#include <optional>
#include <vector>

#include "formats.hpp"
#include "replay.hpp"
#include "settings.hpp"

namespace uwbpos::host {

/// The differences of one tag that are solved together.
struct DifferenceEpoch {
  Id tag;
  double t;  ///< mean time of the differences [s]
  std::vector<Difference> differences;
};

/// How differences are grouped: an epoch ends once it has `enough` differences that touch `anchors`
/// anchors, or before a difference more than `window` after its first.
struct DifferenceRule {
  double window;  ///< [s]
  std::size_t enough;
  std::size_t anchors;
};

/// With a window from the command line, an epoch lasts that long. Without one: if three
/// times in four come with enough differences for a position, the log stamps whole rounds, and an
/// epoch is one time. Otherwise the tag moves while they come one by one: an epoch ends with the
/// difference that makes 5·(dim + 1) of them, touching dim + 2 anchors, and lasts no longer than so
/// many usually take, within 0.2 … 0.5 s. (A simulated drone at 1 … 3 m/s, 50 … 400 differences a
/// second of σ 0.15 m, 7 % outliers: fewer differences let outliers through, more time blurs the
/// motion.)
[[nodiscard]] DifferenceRule difference_rule(const std::vector<Difference>& differences, int dim,
                                             std::optional<double> window);

/// Groups each tag's differences, which must ascend in time; by the time of the first of each.
[[nodiscard]] std::vector<DifferenceEpoch> group_differences(
    const std::vector<Difference>& differences, const DifferenceRule& rule);

/// The differences that can be used, less their links' biases; counts the others.
[[nodiscard]] std::vector<Difference> usable_differences(const Settings& settings, const Site& site,
                                                         bool flat,
                                                         const std::vector<Difference>& differences,
                                                         Replay& result);

/// Notes what a difference is off by, for both of its anchors.
void add_residual(Replay& result, const Difference& d, double residual);

/// Notes measured minus true differences.
void residuals_against_truth(const Site& site, const Settings& settings, bool flat,
                             const std::vector<Difference>& differences, Replay& result);

/// Solves every epoch without its outliers. Differences must ascend in time. `progress(done, of)`
/// is called now and then.
[[nodiscard]] Replay replay_differences(
    Settings settings, const Site& site, const std::vector<Difference>& differences,
    const std::function<void(std::size_t, std::size_t)>& progress = {});

}  // namespace uwbpos::host
