// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A tracker: fed with whatever arrives in whatever order, asked for a pose at any time.
///
/// \code
/// Tracker<PlanarRobot<float>> tracker{{.model = {.motion = {.height = 0.4f}}}};
/// static_cast<void>(tracker.add_anchor(7, {0, 0, 2.5f}));   // and the others
/// static_cast<void>(tracker.update(TimedRange<float>{.time = t, .anchor = 7, .range = 3.2f}));
/// if (const auto robot = tracker.pose()) steer(robot->pose);
/// \endcode
///
/// It knows anchors and tags by ids and checks what it is fed; the rest is track_keeper.hpp's.

#include <cmath>
#include <optional>

#include "uwbpos/filter/heard_anchors.hpp"
#include "uwbpos/filter/track_keeper.hpp"
#include "uwbpos/geometry/anchors.hpp"

namespace uwbpos {

/// Follows one body. `Motion` is a `MotionModel`: ConstantVelocity, PlanarRobot, Inertial.
/// Fixed size, see `TrackerSize`; nothing allocates.
template <class Motion, TrackerSize Size = TrackerSize{}>
class Tracker {
 public:
  using S = typename Motion::Scalar;                     ///< float or double
  static constexpr int kDimension = Motion::kDimension;  ///< of the position
  using Track = uwbpos::Track<Motion, Size.biases>;      ///< state, biases and their covariance
  using Pose = typename Motion::Pose;                    ///< what it tells
  using Told = Result<TrackUpdate<S>>;                   ///< about a measurement

  /// With options, which every update checks.
  explicit Tracker(const TrackerOptions<Motion>& options = {}) : keeper_{options} {}

  /// Adds an anchor. Position in the map [m]. Errors as for `Anchors::add`.
  [[nodiscard]] Result<void> add_anchor(std::uint32_t id, const Vec<S, 3>& position) {
    return anchors_.add(id, position);
  }

  /// Adds a tag with its lever arm [m], body frame: x forward, y left, z up. Without any tag all
  /// ids mean the body's origin. Errors as for `Anchors::add`; InvalidOption, an arm on a motion
  /// that has no heading.
  [[nodiscard]] Result<void> add_tag(std::uint32_t id, const Vec<S, 3>& lever) {
    if (!Motion::kHasHeading && squared_norm<S, 3>(lever) > S(0)) {
      return std::unexpected(Error::InvalidOption);
    }
    return tags_.add(id, lever);
  }

  /// Expects an anchor, or with `Size.bias_by_link` its link to a tag, to be biased, even beyond
  /// what is reachable. To be said before any measurement. Errors: CapacityExceeded.
  [[nodiscard]] Result<void> expect_bias(std::uint32_t anchor, std::uint32_t tag = 0) {
    if (!biased_.expect(anchor, tag)) return std::unexpected(Error::CapacityExceeded);
    return {};
  }

  /// A measurement of any kind. Errors after which nothing has changed: UnknownAnchor, UnknownTag,
  /// NotFinite, NonPositiveSigma, NumericOverflow (a sigma whose square is), NegativeRange,
  /// ImpossibleDifference, DuplicateAnchor (a difference of an anchor to itself),
  /// InvalidCovariance, InvalidOption (the options, or a kind that the motion has no use for).
  /// TimeNotIncreasing: a remembered one told again, number for number. TooOld: from before what is
  /// remembered. GapTooLong: later than `max_gap` after the last. ClockJump: the eighth in a row of
  /// either; what was known is forgotten, the next measurements give a first fix. Unreachable,
  /// OutlierRejected: refused by the gate. The newest costs O(N³), a late one as much once more for
  /// each measurement after it.
  [[nodiscard]] Told update(const TimedRange<S>& m) {
    return arrival(m.time, m.tag, m.anchor, m.range, m.sigma, std::nullopt, false);
  }
  /// A difference.
  [[nodiscard]] Told update(const TimedDifference<S>& m) {
    return arrival(m.time, m.tag, m.anchor_b, m.difference, m.sigma, m.anchor_a, m.shared);
  }
  /// A sample of an inertial unit. Unreachable: not `is_bearable`.
  [[nodiscard]] Told update(const ImuSample<S>& m) {
    if (!all_finite(m.gyro) || !all_finite(m.accelerometer)) return refuse(Error::NotFinite);
    if (!is_bearable(m)) return refuse(Error::Unreachable);
    return push({m.time, m});
  }
  /// A height; of a motion in space.
  [[nodiscard]] Told update(const TimedHeight<S>& m) {
    return scalar(m.time, ScalarEvent<S>::Kind::Height, m.height, m.sigma, kDimension == 3);
  }
  /// A heading; of a motion that has one.
  [[nodiscard]] Told update(const TimedHeading<S>& m) {
    return scalar(m.time, ScalarEvent<S>::Kind::Heading, m.heading, m.sigma, Motion::kHasHeading);
  }
  /// A forward speed; of a planar robot.
  [[nodiscard]] Told update(const TimedSpeed<S>& m) {
    return scalar(m.time, ScalarEvent<S>::Kind::Speed, m.speed, m.sigma, kRobot);
  }
  /// A turn rate; of a planar robot.
  [[nodiscard]] Told update(const TimedTurnRate<S>& m) {
    return scalar(m.time, ScalarEvent<S>::Kind::TurnRate, m.rate, m.sigma, kRobot);
  }
  /// A position.
  [[nodiscard]] Told update(const TimedPosition<S>& m) {
    const auto read = checked<kDimension>(m);
    return read ? push({m.time, *read}) : refuse(read.error());
  }
  /// A velocity.
  [[nodiscard]] Told update(const TimedVelocity<S>& m) {
    const auto read = checked<kDimension>(m);
    return read ? push({m.time, *read}) : refuse(read.error());
  }

  /// Moves "now", for which `pose` answers, on to `time` [µs]; measurements may still come from
  /// before it. O(1). Errors: those of `pose`; TimeNotIncreasing, before the last measurement;
  /// TrackLost, more than `max_gap` after the last that was used.
  [[nodiscard]] Result<void> predict_to(std::int64_t time) { return keeper_.predict_to(time); }

  /// The pose at the last measurement, or at `predict_to` if later. O(N³) each tenth of a second
  /// between. Errors: NotYetLocated; HeadingUndetermined, a place but no heading to begin with
  /// (`TrackerOptions::heading`); TrackLost.
  [[nodiscard]] Result<Pose> pose() const {
    const Result<Track> at = keeper_.now();
    if (!at) return std::unexpected(at.error());
    return keeper_.options().model.motion.pose(at->time, at->state, at->covariance);
  }

  /// The bias of an anchor's ranges [m], estimate minus truth; with `Size.bias_by_link`, to this
  /// tag. Errors: NotYetLocated; UnknownAnchor, one without an estimate; NotYetTracked, not
  /// observed: the measurements have not yet told half of its variance.
  [[nodiscard]] Result<Measured<S>> bias(std::uint32_t anchor, std::uint32_t tag = 0) const {
    if (!keeper_.tracking()) return std::unexpected(Error::NotYetLocated);
    const int slot = biased_.find(anchor, tag);
    if (slot < 0) return std::unexpected(Error::UnknownAnchor);
    const S variance = keeper_.head().covariance(Track::kBias + slot, Track::kBias + slot);
    const S sigma = keeper_.options().model.bias_sigma;
    if (!(S(2) * variance < sigma * sigma)) return std::unexpected(Error::NotYetTracked);
    return Measured<S>{keeper_.head().bias[slot], variance};
  }

  /// Verdicts on all measurements that met a track, by reason, each counted when it came.
  [[nodiscard]] const GateCounters& counters() const { return counters_; }

  /// Those on one anchor's ranges and differences. Zeros for one never heard.
  [[nodiscard]] AnchorCounters counters(std::uint32_t anchor) const {
    return heard_.counters(anchor);
  }

  /// State, biases and covariance after the last measurement, of no meaning before the first fix.
  [[nodiscard]] const Track& track() const { return keeper_.head(); }
  /// Whether there is a track.
  [[nodiscard]] bool tracking() const { return keeper_.tracking(); }

 private:
  static constexpr bool kRobot = requires { Motion::kSpeed; };
  [[nodiscard]] Told refuse(Error error) {
    counters_.count(error);
    return std::unexpected(error);
  }

  [[nodiscard]] Told arrival(std::int64_t time, std::uint32_t tag, std::uint32_t to, S value,
                             S sigma, std::optional<std::uint32_t> from, bool shared) {
    if (const auto error = check_measured(value, sigma)) return refuse(*error);
    const Result<Vec<S, 3>> b = anchors_.find(to);
    const Result<Vec<S, 3>> a = from ? anchors_.find(*from) : b;
    if (!a || !b) return refuse(Error::UnknownAnchor);
    if (from && *from == to) return refuse(Error::DuplicateAnchor);
    const Result<Vec<S, 3>> lever =
        tags_.empty() ? Result<Vec<S, 3>>{Vec<S, 3>::Zero()} : tags_.find(tag);
    if (!lever) return refuse(Error::UnknownTag);
    const Vec<S, 3> baseline = *b - *a;
    if (!from && value < -S(kNegativeRangeSigmas) * sigma) return refuse(Error::NegativeRange);
    if (from && std::abs(value) > norm<S, 3>(baseline) + S(kDifferenceSigmas) * sigma) {
      return refuse(Error::ImpossibleDifference);
    }
    ArrivalEvent<S> event{*a, *b, *lever, value, sigma * sigma, from.value_or(to), to, tag};
    event.bias_a = from ? biased_.place(*from, tag) : -1;
    event.bias_b = biased_.place(to, tag);
    event.is_difference = from.has_value();
    event.shared = shared;
    event.expected = biased_.is_expected(event.bias_a) || biased_.is_expected(event.bias_b);
    const bool tracked = keeper_.tracking();
    const Told told = push({time, event});
    const bool used = told && told->event == TrackEvent::Used;
    const bool refused = !told && told.error() != Error::TimeNotIncreasing;
    if (tracked && (used || refused)) {
      heard_.count(to, used);
      if (from) heard_.count(*from, used);
    }
    return told;
  }

  [[nodiscard]] Told scalar(std::int64_t time, typename ScalarEvent<S>::Kind kind, S value, S sigma,
                            bool has_use) {
    if (!has_use) return refuse(Error::InvalidOption);
    if (const auto error = check_measured(value, sigma)) return refuse(*error);
    return push({time, ScalarEvent<S>{kind, value, sigma * sigma}});
  }

  [[nodiscard]] Told push(const Event<S>& event) {
    if (!is_valid(keeper_.options())) return refuse(Error::InvalidOption);
    const Told told = keeper_.push(event);
    if (!told) return refuse(told.error());
    if (told->event == TrackEvent::Used) counters_.count_used();
    return told;
  }

  TrackKeeper<Motion, Size> keeper_;
  Anchors<S, 3, Size.anchors> anchors_;
  Anchors<S, 3, Size.tags> tags_;
  HeardAnchors<Size.anchors> heard_;
  BiasPlaces<Size.biases, Size.bias_by_link> biased_;
  GateCounters counters_;
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
