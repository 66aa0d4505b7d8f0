// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Poses of a body that carries two tags or more: every epoch's ranges of all tags at once, scored
/// in position and heading, and what follows from poses: velocities, and a target's bearing.

#include <functional>
#include <optional>
#include <set>
#include <vector>

#include "uwbpos/pose/target.hpp"
#include "uwbpos/pose/twist.hpp"

#include "epochs.hpp"
#include "reasons.hpp"
#include "scoring.hpp"
#include "settings.hpp"

namespace uwbpos::host {

struct Outcome;
struct Site;

/// One solved epoch of the body.
struct SolvedPose {
  double t;                ///< [s]
  LevelPose<double> pose;  ///< of the lever arms' origin; z is given, or 0, in 2-D
  double chi_squared;
  int degrees_of_freedom;
  int readings;          ///< how many it was solved from
  bool chosen_by_prior;  ///< two poses; the one nearer to the last
  std::optional<StampedPose> truth;
  std::optional<Rotation> attitude = std::nullopt;  ///< roll and pitch too, with an inertial unit
  bool heading_known = true;                        ///< else it is a guess, and not scored
};

/// Motion between two poses.
struct BodyTwist {
  double t;  ///< midway [s]
  Twist2<double> twist;
  std::optional<Twist2<double>> truth;  ///< of the true poses at the same two times
};

/// A target as the body saw it.
struct SeenTarget {
  double t;
  Target<double> target;
};

/// Errors of velocities of the body's, root mean square.
struct TwistErrors {
  std::size_t count = 0;
  double velocity = 0;   ///< of the vector [m/s]
  double turn_rate = 0;  ///< [rad/s]
};

/// What was made of the body.
struct Body {
  EpochRule rule{};
  std::vector<SolvedPose> track;  ///< by time
  std::size_t epochs = 0;
  std::size_t scored = 0;
  std::size_t chosen_by_prior = 0;
  std::size_t outside_truth = 0;
  std::size_t without_bias = 0;  ///< readings whose link the network does not know
  Counts rejected;               ///< epochs, by reason
  ErrorSummary error;
  ErrorSummary heading_error;  ///< of absolute differences [rad]; `rmse_xy` as `rmse`
  double solve_seconds = 0;
  std::size_t solve_calls = 0;
};

/// The body's epochs and positions, as one more tag's.
[[nodiscard]] Outcome outcome_of(const Body& body);

/// Whether two of the tags heard, at least, have lever arms that are apart in plan.
[[nodiscard]] bool apart_in_plan(const Points& tags, const std::set<Id>& heard);

/// The same of the tags of some readings.
[[nodiscard]] bool has_pose(const Site& site, const std::vector<Reading>& readings);

/// The epochs of all tags of the body together; `links` tells the (tag, anchor) that each epoch's
/// readings have for an anchor, `rule` gets how they were grouped.
[[nodiscard]] std::vector<Epoch> body_epochs(const Site& site, const std::vector<Reading>& readings,
                                             std::optional<double> window,
                                             std::vector<std::pair<Id, Id>>& links,
                                             EpochRule& rule);

/// Poses against truth.
void score_body(const Site& site, int dim, Body& body);

/// Solves and scores. `readings` by time, less their biases, of known anchors. With `dim` 2 and a
/// height slant ranges are used as they are; in space a side or the last pose settles mirror
/// images.
[[nodiscard]] Body solve_poses(const Settings& settings, const Site& site, int dim,
                               const std::vector<Reading>& readings,
                               const std::function<void(std::size_t, std::size_t)>& progress);

/// Twists between each pose and the first that is `span` [s] or more later, at most twice as much.
[[nodiscard]] std::vector<BodyTwist> twists_of(const Body& body, double span);
[[nodiscard]] TwistErrors summarize_twists(const std::vector<BodyTwist>& twists);

/// The target from each pose but those in its place.
[[nodiscard]] std::vector<SeenTarget> targets_seen(const Body& body, const Vec<double, 2>& target);

/// Errors of headings, root mean square, as what changes from epoch to epoch and what does not.
struct HeadingParts {
  double noise;  ///< [rad]
  double slow;   ///< [rad]
};

/// Those of the scored poses; nothing of fewer than fifty.
[[nodiscard]] std::optional<HeadingParts> parts_of_heading_error(const Body& body);

/// Heading of a rotation: the direction of its x axis in plan [rad].
[[nodiscard]] double heading_of(const Rotation& rotation);

/// How a level body lies that looks that way [rad].
[[nodiscard]] Rotation level_rotation(double heading);

/// Files of these, with a header row.
[[nodiscard]] std::string poses_tum(const Body& body);
[[nodiscard]] std::string twists_csv(const std::vector<BodyTwist>& twists);
[[nodiscard]] std::string target_csv(const std::vector<SeenTarget>& seen);

/// The target along the track in some twenty rows, for the terminal.
[[nodiscard]] std::string target_table(const std::vector<SeenTarget>& seen,
                                       const Vec<double, 2>& target);

}  // namespace uwbpos::host
