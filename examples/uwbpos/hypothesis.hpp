// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// One hypothesis of how a body moves and a radio errs: a tracker that takes it for granted.

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "uwbpos/core/result.hpp"
#include "uwbpos/filter/motion/constant_velocity.hpp"
#include "uwbpos/filter/motion/inertial.hpp"
#include "uwbpos/filter/motion/planar_body.hpp"
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
  /// The anchor of it that is not believed as it stands; what was used is the rest.
  std::optional<Id> disbelieved = std::nullopt;
  bool began = false;     ///< a track began
  bool reopened = false;  ///< the gate had locked the filter out

  /// Whether the same was heard before.
  [[nodiscard]] bool is_repeat() const { return refused == Error::TimeNotIncreasing; }
};

/// A hypothesis.
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
  /// By how much the `liar` lies [m]; nothing while nobody knows.
  [[nodiscard]] virtual std::optional<Measured<double>> lie() const = 0;
  /// The same hypothesis before it heard anything.
  [[nodiscard]] virtual std::unique_ptr<Hypothesis> anew() const = 0;

  /// Whether it does not believe an anchor, this one or any, as it stands.
  [[nodiscard]] bool doubts(Id anchor) const { return ignored.contains(anchor) || liar == anchor; }
  [[nodiscard]] bool doubts() const { return liar || !ignored.empty(); }

  std::optional<Id> liar;   ///< an anchor that lies by a length that it estimates
  std::set<Id> ignored;     ///< anchors that it does not listen to
  bool suspicious = false;  ///< holds one anchor, or none, to lie, whatever the others hold
  double score = 0;         ///< (1) of hypotheses.hpp
  std::size_t met = 0;      ///< measurements since it began, without repeats
  std::size_t refused = 0;  ///< of these, by it
  double late = 0;          ///< what `score` is lower for having begun later than others
  double handicap = 0;      ///< how much less it is believed beforehand than the first
  /// Nothing is told to it before it is begun anew at this time [µs]; it was hopeless.
  std::optional<std::int64_t> asleep = std::nullopt;
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
  double period = 0;                           ///< from epoch to epoch, typically [s]
};

/// What a radio's errors are taken for.
struct RadioNoise {
  double white = 1;      ///< times the sigmas of what a tracker is fed
  double bias = 0;       ///< of links, times the typical sigma
  double bias_time = 0;  ///< in which they change [s]
  /// In which an anchor's lie changes [s]: the default, by a centimetre in a second.
  double lie_time = 200'000;
};

/// Hypotheses of a motion. `bank` must outlive them. With a `liar` the noise has no biases.
[[nodiscard]] std::unique_ptr<Hypothesis> follower(const BankOptions& bank,
                                                   const ConstantVelocity<double, 2>& motion,
                                                   const RadioNoise& noise,
                                                   std::optional<Id> liar = std::nullopt);
[[nodiscard]] std::unique_ptr<Hypothesis> follower(const BankOptions& bank,
                                                   const ConstantVelocity<double, 3>& motion,
                                                   const RadioNoise& noise,
                                                   std::optional<Id> liar = std::nullopt);
/// With the heading at the start.
[[nodiscard]] std::unique_ptr<Hypothesis> follower(const BankOptions& bank,
                                                   const Inertial<double>& motion,
                                                   const RadioNoise& noise,
                                                   const Measured<double>& heading,
                                                   std::optional<Id> liar = std::nullopt);
/// With the gate's width.
[[nodiscard]] std::unique_ptr<Hypothesis> follower(const BankOptions& bank,
                                                   const PlanarBody<double>& motion,
                                                   const RadioNoise& noise, double gate_sigmas);

}  // namespace uwbpos::host
