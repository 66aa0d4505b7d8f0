// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The report's plots: what each shows, thinned out so that a long recording stays a small page.

#include <optional>
#include <string>
#include <vector>

#include "diagnosis.hpp"
#include "exchanges.hpp"
#include "replay.hpp"

namespace uwbpos::host {

/// A plot and what to say below it. `svg` is missing when gnuplot is.
struct Figure {
  std::string title;
  std::optional<std::string> svg;
  std::string caption;
};

/// Plan view to scale: anchors, truth and track.
[[nodiscard]] Figure map_figure(const Replay& replay, const Points& anchors,
                                const std::optional<Vec<double, 2>>& target = {});
/// The same replay as figures draw it: with a body, its origin in place of the tags.
[[nodiscard]] Replay drawn(const Replay& replay);
/// Error of each heading over time.
[[nodiscard]] Figure heading_figure(const Body& body);
/// Speed forward and turn rate over time.
[[nodiscard]] Figure twist_figure(const std::vector<BodyTwist>& twists);
/// Distance and bearing of the target over time.
[[nodiscard]] Figure target_figure(const std::vector<SeenTarget>& seen);
/// Error of each position over time.
[[nodiscard]] Figure time_figure(const Replay& replay);
/// How well each measurement was foretold, over time, against what chance allows.
[[nodiscard]] Figure nis_figure(const Replay& replay);
/// Share of positions with no more than an error, 50, 90 and 95 % marked.
[[nodiscard]] Figure distribution_figure(const Replay& replay);
/// Height over time; for positions in space.
[[nodiscard]] Figure height_figure(const Replay& replay);
/// Box per anchor.
[[nodiscard]] Figure residual_figure(const Replay& replay,
                                     const std::vector<AnchorQuality>& worst_first);
/// Error of ranges over the true distance, of each method.
[[nodiscard]] Figure range_error_figure(const std::vector<ScoredRange>& ranges);

/// A quantity of each shot over time, in centimetres; shots that others might explain stand out.
struct ShotDot {
  double t;      ///< [s]
  double value;  ///< [m]
  bool ambiguous;
};
[[nodiscard]] Figure lag_figure(const std::vector<ShotDot>& lags, double max_lag);
/// Bar per repair, by how often.
[[nodiscard]] Figure repair_figure(const std::vector<std::pair<std::string, std::size_t>>& repairs);

}  // namespace uwbpos::host
