// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The life of a track over a stream of events whose anchors are known by place: begun by
/// filter/track_begin.hpp where recent events agree, corrected by filter/apply_event.hpp, done over
/// from a snapshot of filter/replay_window.hpp when an event comes late, begun anew when its gate
/// has locked it out, when nothing was used for `max_gap`, or when the clock of the events was set.

#include <algorithm>
#include <limits>

#include "uwbpos/filter/apply_event.hpp"
#include "uwbpos/filter/replay_window.hpp"
#include "uwbpos/filter/track_begin.hpp"

namespace uwbpos {

/// Keeps one track. What `Tracker` is made of; nothing allocates.
template <class Motion, TrackerSize Size>
class TrackKeeper {
 public:
  using S = typename Motion::Scalar;                     ///< float or double
  static constexpr int kDimension = Motion::kDimension;  ///< of the position
  using Track = uwbpos::Track<Motion, Size.biases>;      ///< state, biases and their covariance
  using Told = Result<TrackUpdate<S>>;                   ///< about an event

  /// With options that are valid.
  explicit TrackKeeper(const TrackerOptions<Motion>& options) : options_{options} {}

  /// Another event. Errors: TooOld, GapTooLong, ClockJump, TimeNotIncreasing, Unreachable,
  /// OutlierRejected, NotFinite, as `Tracker::update` has them.
  [[nodiscard]] Told push(const Event<S>& event) {
    window_.make_room();
    if (const auto error = stray(event.time)) return std::unexpected(*error);
    if (window_.holds(event, is_repeat<S>)) return std::unexpected(Error::TimeNotIncreasing);
    const int place = window_.insert(event);
    if (tracking_ && beyond_gap(head_.used_at, event.time)) tracking_ = false;
    if (!tracking_) {
      return tries(event) && begin() ? TrackUpdate<S>{TrackEvent::Started}
                                     : TrackUpdate<S>{TrackEvent::Gathered};
    }
    const Result<Innovation<S>> result = replay_from(place);
    if (!result || result->dimension > 0) watch_.add(result.has_value(), event.time);
    if (result) return TrackUpdate<S>{TrackEvent::Used, *result};
    if (watch_.suspicious(event.time, options_.patience) && tries(event) && begin()) {
      return TrackUpdate<S>{TrackEvent::Reopened};
    }
    return std::unexpected(result.error());
  }

  /// As `Tracker::predict_to`.
  [[nodiscard]] Result<void> predict_to(std::int64_t time) {
    if (!tracking_) return std::unexpected(missing_);
    if (time < head_.time) return std::unexpected(Error::TimeNotIncreasing);
    if (beyond_gap(head_.used_at, time)) return std::unexpected(Error::TrackLost);
    now_ = time;
    return {};
  }

  /// The track at the last event, or at `predict_to` if later. Errors: those of `Tracker::pose`.
  [[nodiscard]] Result<Track> now() const {
    if (!tracking_) return std::unexpected(missing_);
    if (beyond_gap(head_.used_at, std::max(now_, head_.time))) {
      return std::unexpected(Error::TrackLost);
    }
    Track at = head_;
    advance(at, options_.model, now_);
    return at;
  }

  /// The track after the last event, of no meaning while not `tracking`.
  [[nodiscard]] const Track& head() const { return head_; }
  /// Whether there is one.
  [[nodiscard]] bool tracking() const { return tracking_; }
  /// As given.
  [[nodiscard]] const TrackerOptions<Motion>& options() const { return options_; }

 private:
  [[nodiscard]] bool beyond_gap(std::int64_t from, std::int64_t to) const {
    std::int64_t gap = 0;
    return __builtin_sub_overflow(to, from, &gap) || gap > options_.max_gap;
  }

  // Whether the rest of a blink would be done over whose first differences were dropped.
  [[nodiscard]] bool cuts_blink(std::int64_t time) {
    return window_.forgot() && is_shared(window_[0]) &&
           window_[0].time == window_.snapshot(0).time && time < window_[Size.stride - 1].time;
  }

  // Times that do not fit are refused until eight in a row fit each other.
  [[nodiscard]] std::optional<Error> stray(std::int64_t time) {
    std::optional<Error> error;
    if (const bool any = window_.size() > 0; any || tracking_) {
      const std::int64_t last = any ? window_.events().back().time : head_.time;
      const std::int64_t first = any ? window_.snapshot(0).time : head_.time;
      if (beyond_gap(last, time)) error = Error::GapTooLong;
      // What was used of the last time that was dropped is not known any more.
      const bool before = time < first || (time == first && window_.forgot() && time < last);
      if (tracking_ ? before || cuts_blink(time) : beyond_gap(time, last)) error = Error::TooOld;
    }
    if (!error) {
      strays_ = 0;
      return error;
    }
    if (beyond_gap(stray_time_, time) || beyond_gap(time, stray_time_)) strays_ = 0;
    stray_time_ = time;
    constexpr int kMostStrays = 8;
    if (++strays_ < kMostStrays) return error;
    strays_ = 0;
    tracking_ = false;
    window_.restart();
    departure_.restart();
    return Error::ClockJump;
  }

  // What the event at `place` and all after it make of the track; the first's result.
  [[nodiscard]] Result<Innovation<S>> replay_from(int place) {
    const int last = window_.size() - 1;
    int i = place;
    if (place < last) {
      i = window_.snap_before(place);
      head_ = window_.snapshot(i);
    }
    Result<Innovation<S>> told = std::unexpected(Error::NotYetLocated);
    for (; i <= last; ++i) {
      if (window_.snaps(i)) window_.snapshot(i) = head_;
      const Result<Innovation<S>> result =
          apply(head_, options_.model, window_[i], window_.first(i));
      window_[i].used = result.has_value();
      if (i == place) told = result;
    }
    return told;
  }

  // A heading to begin with, where the motion needs one.
  [[nodiscard]] std::optional<Measured<S>> known_heading(const FirstReadings<S>& set) const {
    if (set.heading) {
      return Measured<S>{set.heading->heading, set.heading->sigma * set.heading->sigma};
    }
    if constexpr (Motion::kHasHeading) {
      if (tracking_) {  // what the locked-out track had: it turned no faster than that
        constexpr S spread = S(0.5);
        return Measured<S>{options_.model.motion.heading(head_.state), spread * spread};
      }
    }
    return options_.heading;
  }

  [[nodiscard]] bool tries(const Event<S>& event) {
    return !std::holds_alternative<ImuSample<S>>(event.what) && pace_.looks();
  }

  // Begins a track at the last event if the recent ones agree on a place.
  [[nodiscard]] bool begin() {
    missing_ = Error::NotYetLocated;
    const std::int64_t time = window_.events().back().time;
    const S bias = Size.biases > 0 ? options_.model.bias_sigma : S(0);
    const auto set = gather_first_readings<S>(window_.events(), options_.fix_window,
                                              options_.speed_sigma, bias * bias);
    FirstFixOptions<S, kDimension> options;
    options.locate = options_.locate;
    if (tracking_ && !options.locate.prior) {
      const Vec<S, 3> place = options_.model.motion.place(head_.state, Vec<S, 3>::Zero().eval());
      options.locate.prior = Vec<S, kDimension>{place.template head<kDimension>()};
    }
    if constexpr (requires { options_.model.motion.height; }) {
      options.height = options_.model.motion.height;
    }
    options.wants_heading = Motion::kHasHeading;
    options.heading = known_heading(set);
    FirstFix<S, kDimension> fix;
    if (const auto found = first_fix<S, kDimension>(set, options)) {
      const bool waited = time - window_.events().front().time >= options_.fix_window;
      if (!BeginningPace::believes(found->degrees_of_freedom, set.repeated, waited)) return false;
      fix = *found;
    } else if (set.position) {
      fix = FirstFix<S, kDimension>::at(*set.position);
    } else {
      if (set.ranges == 0 && set.count > kDimension + 1) pace_.disagreed(set.count);
      return false;
    }
    auto heading = options.heading;
    if (fix.heading) heading = Measured<S>{*fix.heading, fix.covariance(kDimension, kDimension)};
    if constexpr (requires { requires Motion::kLooksAhead; }) {
      if (!heading) {
        heading = departure_.heading({fix.position[0], fix.position[1]}, fix.spread(), time,
                                     options_.max_gap);
      }
    }
    if (Motion::kHasHeading && !heading) {
      missing_ = Error::HeadingUndetermined;
      return false;
    }
    head_ = begun_track<Motion, Size.biases>(options_, fix, heading.value_or(Measured<S>{}), set,
                                             window_.events());
    now_ = tracking_ ? std::max(now_, time) : time;
    tracking_ = true;
    pace_.restart();
    window_.restart();
    watch_.reset(time);
    departure_.restart();
    return true;
  }

  TrackerOptions<Motion> options_;
  Track head_{};  // after the last event
  ReplayWindow<Event<S>, Track, Size.window, Size.stride> window_;
  LockOutWatch watch_;
  Departure<S> departure_;
  BeginningPace pace_;
  std::int64_t now_ = std::numeric_limits<std::int64_t>::min();
  std::int64_t stray_time_ = 0;
  int strays_ = 0;
  Error missing_ = Error::NotYetLocated;  // what there is no track for
  bool tracking_ = false;
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
