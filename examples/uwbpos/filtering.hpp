// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A recording through trackers: all that its files hold in order of time, causally, one pose at
/// the end of each epoch.

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "formats.hpp"
#include "reasons.hpp"

namespace uwbpos::host {

struct Recording;
struct Replay;
struct Settings;

/// What a filter was told, one after the other.
struct Innovated {
  double t;           ///< [s]
  double normalised;  ///< ν²/S, 1 on average when all is right
};

/// A measurement that the gate refused.
struct RefusedMeasurement {
  double t;   ///< [s]
  Id anchor;  ///< of a difference, b
  Error reason;
};

/// How well a position was thought to be known.
struct PositionSpread {
  double t;               ///< [s]
  std::optional<Id> tag;  ///< whose; nothing: the body's
  Vec2 position;
  Mat<double, 2> covariance;  ///< [m²]
};

/// A time without a track that could be relied on.
struct Interruption {
  double t;           ///< when the track went on, or began anew [s]
  Id tag;             ///< of a body, the one heard first
  std::string cause;  ///< in words
  double silent;      ///< since something was last used [s]
  /// From `t` until the position was known half as well again as usual, or better [s]; nothing if
  /// it never was.
  std::optional<double> recovery = std::nullopt;
  /// Half of all errors against truth at other times are smaller [m]; nothing without truth.
  std::optional<double> usual_error = std::nullopt;
  /// From `t` until this and four more errors were, by their median, at most twice `usual_error`
  /// [s]; nothing if they never were.
  std::optional<double> true_recovery = std::nullopt;
};

/// Measurements of one anchor; a difference counts for both.
struct AnchorTally {
  std::size_t used = 0;
  std::size_t refused = 0;
};

/// What filtering was like.
struct Filtering {
  std::string motion;  ///< what was filtered with, in words
  double period = 0;   ///< from epoch to epoch, typically, of the slowest tag [s]
  std::size_t used = 0;
  Counts refused;  ///< measurements, by reason
  std::vector<Innovated> innovations;
  std::vector<RefusedMeasurement> refusals;
  std::vector<PositionSpread> spreads;      ///< with each pose
  std::vector<Interruption> interruptions;  ///< by time
  /// RMSE of positions outside interruptions and the recoveries from them [m].
  std::optional<double> settled_rmse;
  std::optional<double> first_pose_after;  ///< from the first measurement [s]; the latest of tags
  /// Mean of eᵀP⁻¹e / 2 of positions in plan against truth, 1 when the covariance is honest.
  std::optional<double> mean_nees;
  std::map<Id, AnchorTally> of_anchor;
  std::size_t begun = 0;            ///< tracks, also after they were lost
  std::size_t reopened = 0;         ///< filters that their own gate had locked out
  std::size_t inertial_epochs = 0;  ///< whose pose used the inertial unit
  std::size_t unit_restarts = 0;    ///< of hypotheses on the unit, all of them beaten
  std::size_t samples = 0;          ///< of the inertial unit, as used
  bool apart = false;               ///< several tags, each followed by itself
  bool apart_in_space = false;      ///< although the tags file has them on one body
  std::string unused_unit;          ///< why the inertial unit was not used; or empty
};

/// The longest recovery [s]; zero without an interruption, infinite if one never ended.
[[nodiscard]] double slowest_recovery(const Filtering& filtering);

/// The same as truth has it; nothing where it does not tell.
[[nodiscard]] std::optional<double> slowest_true_recovery(const Filtering& filtering);

/// `at 12.00 s: nothing was received, 3.00 s without …; recovered 0.25 s later, by …`.
[[nodiscard]] std::string words_of(const Interruption& interruption, bool several);

/// The share of an anchor's measurements that was refused, 0 … 1.
[[nodiscard]] double refused_share(const AnchorTally& tally);

/// Anchors most of whose measurements were refused, several times as many as a typical anchor's.
[[nodiscard]] std::vector<Id> guilty_anchors(const Filtering& filtering);

/// Filters and scores. Several tags with lever arms apart are one body, several without a tags file
/// are followed one by one.
[[nodiscard]] Replay replay_filtered(
    Settings settings, const Recording& recording,
    const std::function<void(std::size_t, std::size_t)>& progress = {});

}  // namespace uwbpos::host
