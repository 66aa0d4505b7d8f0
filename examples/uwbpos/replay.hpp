// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Solves every epoch of a recording with `locate` and scores the positions against truth.

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "epochs.hpp"
#include "filtering.hpp"
#include "formats.hpp"
#include "link_network.hpp"
#include "poses.hpp"
#include "reasons.hpp"
#include "scoring.hpp"
#include "settings.hpp"
#include "subnets.hpp"

namespace uwbpos::host {

/// One solved epoch.
struct Position {
  double t;  ///< [s]
  Id tag;
  Vec3 position;  ///< [m]; z is the given height, or 0, in 2-D
  double chi_squared;
  int degrees_of_freedom;
  int readings;               ///< how many it was solved from
  bool chosen_by_prior;       ///< two mirror images; the one nearer to the last position
  std::optional<Vec3> truth;  ///< where the tag was [m]
};

/// What happened to one tag, or to all of them.
struct Outcome {
  std::size_t epochs = 0;
  std::size_t solved = 0;
  std::size_t scored = 0;
  Counts rejected;  ///< epochs, by reason
  ErrorSummary error;
};

/// Measured minus expected range of one reading [m]; of a difference, seen as each of its anchors'
/// own error.
struct Residual {
  double t;
  double value;
};

struct Replay {
  int dim = 2;
  bool of_differences = false;  ///< readings are range differences
  EpochRule rule{};
  std::vector<Position> track;  ///< by time
  Outcome all;
  std::map<Id, Outcome> of_tag;
  std::map<std::pair<Id, Id>, std::vector<Residual>> residuals;  ///< of each (tag, anchor)
  bool residuals_to_truth = false;  ///< expected range from truth; else from the solved position
  std::map<Id, std::size_t> unknown_anchors;
  std::map<Id, std::size_t> unknown_tags;  ///< not in tags.csv: solved, not scored
  Counts refused_readings;                 ///< by reason; the epoch goes on without them
  std::size_t duplicates = 0;
  std::size_t without_bias = 0;  ///< readings whose link the bias table lacks
  std::size_t outside_truth = 0;
  std::size_t in_truth_gaps = 0;  ///< scored although truth pauses for over a second around them
  std::size_t chosen_by_prior = 0;
  std::size_t excluded = 0;  ///< readings of solved epochs that the others contradict
  std::map<Id, std::size_t> excluded_of_anchor;  ///< a difference counts for both of its anchors
  std::size_t fused = 0;              ///< epochs whose position several subnets agreed on
  std::size_t inconsistent = 0;       ///< solved epochs that contradict themselves all the same
  std::optional<double> found_sigma;  ///< of a difference, found from the log [m]
  std::optional<Filtering> filtering = std::nullopt;  ///< with `--filter`
  std::optional<Body> body;                           ///< with two tags or more
  bool never_together = false;  ///< several tags, and no epoch that gave a pose
  double solve_seconds = 0;     ///< inside `locate`
  std::size_t solve_calls = 0;
};

/// What is known about the place.
struct Site {
  Points anchors;
  Points tags;  ///< lever arms; empty: each tag is the body's origin
  BiasTable bias;
  Trajectory truth;                            ///< of the body; empty: unknown
  std::shared_ptr<const LinkNetwork> network;  ///< of the links' biases, with poses
  SubnetTable subnets = {};  ///< of anchors whose differences are solved subnet by subnet
  Trajectory attitude;       ///< of the body, its rotations; empty: unknown
};

/// 2 or 3: as the settings say; else 2 when the tags' height is given or all anchors are equally
/// high, else 3.
[[nodiscard]] int choose_dim(const Settings& settings, const Points& anchors);

/// On which side of the anchors a height lies.
[[nodiscard]] Side side_of(double height, const Points& anchors);

/// Epochs between two calls of a progress function.
inline constexpr std::size_t kProgressStep = 64;

/// Readings must ascend in time. In space a given height tells the side. `progress(done, of)` is
/// called now and then.
[[nodiscard]] Replay replay(Settings settings, const Site& site,
                            const std::vector<Reading>& readings,
                            const std::function<void(std::size_t, std::size_t)>& progress = {});

/// The readings that can be used, less their links' biases; counts the others.
[[nodiscard]] std::vector<Reading> usable_readings(const Settings& settings, const Site& site,
                                                   const std::vector<Reading>& readings,
                                                   Replay& result);

/// Notes measured minus true ranges; those of a flat world leave heights out.
void residuals_against_truth(const Site& site, const Settings& settings, bool flat,
                             const std::vector<Reading>& readings, Replay& result);

/// Positions against truth, by tag and in all.
void score(const Site& site, Replay& result);

/// Where the tag was at time t, if that is known.
[[nodiscard]] std::optional<Vec3> true_position(const Site& site, Id tag, double t);

/// The same as measurements of `dim` dimensions have it: in the plane at the given height, if any.
[[nodiscard]] std::optional<Vec3> expected_position(const Site& site, const Settings& settings,
                                                    int dim, Id tag, double t);

/// Measured minus true range of every reading, and the counts of readings, without solving.
/// `settings.height`, where given, takes the place of the truth's height.
[[nodiscard]] Replay compare_with_truth(const Settings& settings, const Site& site,
                                        const std::vector<Reading>& readings);

/// Height of the body's origin [m] when its tags' antennas are `mean_height` high on average.
[[nodiscard]] double body_height(double mean_height, const Points& tags);

/// Height of a tag's antenna [m]: the given one, which with several tags is their mean; the lever
/// arms tell how each differs from it.
[[nodiscard]] double tag_height(double mean_height, const Points& tags, Id tag);

}  // namespace uwbpos::host
