// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Trackers that differ in what they take for granted, fed side by side, and judged by how well
/// each foretold what came: multiple-model estimation (Magill, IEEE Trans. AC 10(4), 1965). How
/// fast the body changes its velocity, how noisy the radio is and where the body looked when an
/// inertial unit was switched on need not be told that way. The score of hypothesis k is
///   (1) \f$ s_k \leftarrow s_k e^{-\Delta t/T} + \ln p_k(z),\quad
///       p_k(z) = (1 - \varepsilon) N(\nu; 0, S) + \varepsilon / w \f$
/// over all measurements z; one that its gate refuses is an outlier, worth ε/w. Causal: nothing is
/// known before its time. For each anchor some do without it, as one that lies from the start can
/// mislead all that begin with it. Some hold a radio's errors to be white, others to be mostly
/// biases of the links that change as the body moves, which they estimate: only these know how well
/// they know. Where these lead, each family says half of where the body is, as they err differently
/// (Bates, Granger, Operational Research Quarterly 20(4), 1969), and these how well that is known.

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "uwbpos/core/result.hpp"
#include "uwbpos/filter/track.hpp"

#include "formats.hpp"
#include "replay.hpp"
#include "settings.hpp"

namespace uwbpos::host {

/// What a hypothesis is fed: a range of `tag` to `anchor_b`, or the difference b − a.
struct TimedMeasurement {
  std::int64_t time;  ///< since the log began [µs]
  Id tag;
  Id anchor_a;
  Id anchor_b;
  double value;  ///< [m]
  double sigma;  ///< [m]
  bool is_difference;
  bool shared;  ///< with others of its time, one arrival at anchor a
};

/// What a hypothesis says of the body.
struct Estimate {
  Vec3 position;  ///< of the body's origin; of the tag, where there is no attitude [m]
  Mat<double, 3> covariance = Mat<double, 3>::Zero();      ///< [m²]
  std::optional<Measured<double>> heading = std::nullopt;  ///< [rad]
  std::optional<Rotation> attitude = std::nullopt;         ///< with an inertial unit
};

/// What became of a measurement.
struct Verdict {
  bool met_track = false;  ///< there was one to judge it by
  std::optional<Innovation<double>> used = std::nullopt;
  std::optional<Error> refused = std::nullopt;
  bool began = false;     ///< a track began
  bool reopened = false;  ///< the gate had locked the filter out
};

/// One of them.
class Hypothesis {
 public:
  Hypothesis() = default;
  Hypothesis(const Hypothesis&) = delete;
  Hypothesis& operator=(const Hypothesis&) = delete;
  virtual ~Hypothesis() = default;

  virtual Verdict take(const TimedMeasurement& m) = 0;
  virtual void take(std::int64_t time, const InertialReading& sample) = 0;
  /// Now moved on to `time`, not before the last measurement.
  virtual Result<Estimate> at(std::int64_t time) = 0;
  /// Where a tag is as of the last measurement.
  [[nodiscard]] virtual std::optional<Vec3> place(Id tag) const = 0;
  [[nodiscard]] virtual bool tracking() const = 0;
  /// Whether it needs an inertial unit.
  [[nodiscard]] virtual bool inertial() const = 0;
  /// Whether it estimates biases of the links.
  [[nodiscard]] virtual bool estimates_biases() const = 0;

  std::set<Id> ignored;     ///< anchors that it does not listen to
  bool suspicious = false;  ///< holds one anchor, or none, to lie, whatever the others hold
  double score = 0;         ///< (1)
  double handicap = 0;      ///< how much less it is believed beforehand than the first
};

/// How the body moves.
enum class BodyMotion { kPointInPlane, kPointInSpace, kPlanarBody, kInertial };

/// All that hypotheses share.
struct BankOptions {
  BodyMotion motion;
  Points anchors;                              ///< heights zero where they are left out
  Points tags;                                 ///< lever arms; empty: tags are the body's origin
  double sigma = 0.1;                          ///< of a range, typically [m]
  double height = 0;                           ///< of the body's origin in the plane [m]
  std::optional<Vec3> side = std::nullopt;     ///< where the tags are, of coplanar anchors
  std::optional<Vec3> prior = std::nullopt;    ///< [m]
  std::shared_ptr<const LinkNetwork> network;  ///< of the links' biases
};

/// Hypotheses of one body.
class HypothesisBank {
 public:
  explicit HypothesisBank(BankOptions options);
  HypothesisBank(const HypothesisBank&) = delete;
  HypothesisBank& operator=(const HypothesisBank&) = delete;
  ~HypothesisBank() = default;

  /// Feeds all; what became of it with the best of them.
  Verdict take(const TimedMeasurement& m);
  void take(std::int64_t time, const InertialReading& sample);

  /// All of them weighed, moments matched, at `time` [µs]. Errors: NotYetLocated, TrackLost.
  [[nodiscard]] Result<Estimate> at(std::int64_t time);

  /// As the best of them has it.
  [[nodiscard]] std::optional<Vec3> place(Id tag) const;

  /// Whether the best of them uses the inertial unit.
  [[nodiscard]] bool best_is_inertial() const { return best_ && best_->inertial(); }
  /// How often hypotheses on the inertial unit, all worse than one without it, were begun anew.
  [[nodiscard]] std::size_t restarts() const { return restarts_; }

 private:
  void add_bodies();
  void add_points(int dimension);
  void add_inertial();
  void add_suspicious();
  void add_all();
  void judge_anchors(std::int64_t time);
  void ignore_liars();
  void note_of_listener(const TimedMeasurement& m, const Verdict& verdict);
  [[nodiscard]] bool disputed(std::int64_t time);
  void weed(std::int64_t time);
  void choose();

  // What the suspicious hypothesis that listens to all anchors makes of one.
  struct AnchorRecord {
    std::size_t count = 0;
    double refused = 0;  // share of late
  };

  BankOptions options_;
  std::vector<std::unique_ptr<Hypothesis>> all_;
  Hypothesis* best_ = nullptr;
  Hypothesis* listener_ = nullptr;
  std::map<Id, AnchorRecord> records_;
  std::size_t met_ = 0;  // measurements since there was a track
  std::int64_t last_ = 0;
  std::int64_t weeded_ = 0;
  std::int64_t restarted_ = 0;
  std::int64_t begun_ = -1;  // when there was a best one
  std::int64_t judged_ = 0;
  std::set<Id> ignored_;  // anchors that all but suspicious ones ignore
  std::size_t restarts_ = 0;
  bool fed_by_unit_ = false;
};

}  // namespace uwbpos::host
