// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Synchronisation of an anchor's clock to its control anchor's (math.md 5, patent 001): offset
/// and rate, followed from sync frames that travel a known distance. A frame that left at c_tx by
/// the control anchor's clock and was stamped a_rx by the anchor's, a flight τ later, is the event
///   (1) \f$ (c_{tx} + \tau,\ a_{rx}) \f$ with noise \f$ r = \sigma_t^2 + 1/12\ \text{ticks}^2 \f$
/// to the filter of time/clock_filter.hpp, whose equations count control time in anchor time. It
/// is used if
///   (2) \f$ \nu^2 \le 36\,(P'_{00} + r) \f$.
/// τ runs by the control anchor's clock, which no one knows better: the scale of that clock
/// (20 ppm) is that of all differences. The first two frames give both states.

#include <cmath>
#include <cstdint>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/time/clock_filter.hpp"
#include "uwbpos/time/clock_sync_options.hpp"
#include "uwbpos/time/control_time.hpp"
#include "uwbpos/time/device_time.hpp"

namespace uwbpos {

/// Follows the control anchor's clock from one anchor's receptions of its sync frames, and turns
/// that anchor's stamps into control time. 136 bytes in float; O(1), never allocates.
template <class S>
class ClockSync {
 public:
  /// With the default options.
  ClockSync() = default;

  /// With options, which `update` checks.
  explicit ClockSync(const ClockSyncOptions<S>& options) : options_{options} {}

  /// One sync frame: sent at `control_tx` on the control anchor's clock, received at `anchor_rx`
  /// on this one's, `flight` [s] between those stamps: distance over speed, and the control
  /// anchor's transmit and this one's receive delay unless stamps are free of them. `host` [µs]:
  /// when, roughly; any epoch, half a second is good enough.
  /// Returns δ, the rate of the control clock against this one (a fraction), and its variance.
  ///
  /// Errors, in the order they are looked for:
  /// - InvalidOption, NotFinite (`flight`), RangeBeyondMaximum (|`flight`| > 1 ms). Nothing
  ///   changes.
  /// - NotYetTracked: the first frame.
  /// - TimeNotIncreasing: a late or repeated frame, by the host's time or by stamps that fit;
  ///   ignored. Host time set back by more than `reorder_window` starts afresh.
  /// - GapTooLong: no frame was used for `max_gap`. Starts afresh.
  /// - ClockOffsetOutOfBounds: |δ| beyond the bound. Starts afresh.
  /// - OutlierRejected: the frame departs by less than `max_excess`: an echo. Not used.
  /// - ClockJump: the frame departs by more. Nothing is converted until the next one tells: if it
  ///   fits, this one was bad; if it departs alike, it gives the new phase and the rate is kept.
  ///   Also the last of `max_outliers` echoes in a row, if alike, which does the same; if not, or
  ///   after three jumps in a row, the tracker starts afresh. It cannot lock itself out.
  [[nodiscard]] Result<Measured<S>> update(DeviceTime<> control_tx, DeviceTime<> anchor_rx,
                                           S flight, std::int64_t host);

  /// The control anchor's time of `stamp` on this anchor's clock, and the variance of the
  /// conversion; the stamp's own noise is not in it. `host` [µs] as for `update`. Good also
  /// shortly before the last frame.
  /// Errors: NotYetTracked; ClockJump (suspected, see `update`); TooOld (more than `max_age` from
  /// the last frame used by the stamp, or 8 s by the host's time).
  [[nodiscard]] Result<ControlTime<S>> to_control(DeviceTime<> stamp, std::int64_t host) const;

  /// δ and its variance as of the last frame used. Error: NotYetTracked.
  [[nodiscard]] Result<Measured<S>> rate() const {
    if (!tracked_) return std::unexpected(Error::NotYetTracked);
    return filter_.rate();
  }

  /// Forgets everything but the options.
  void reset() { *this = ClockSync{options_}; }

 private:
  static constexpr S kGate = 36;
  static constexpr int kMaxJumps = 3;

  // Equation (1).
  [[nodiscard]] S noise() const {
    const S ticks = options_.sigma_timestamp / kTickSeconds<S>;
    return ticks * ticks + S(1) / 12;
  }
  [[nodiscard]] S wander() const { return ClockFilter<S>::wander_of(options_.wander); }

  Error restart(const ClockPair<S>& pair, std::int64_t host, Error reason) {
    reset();
    suspect_ = pair;
    host_ = host;
    based_ = true;
    return reason;
  }

  [[nodiscard]] Result<Measured<S>> begin(const ClockPair<S>& pair, std::int64_t host);
  [[nodiscard]] Result<Measured<S>> depart(const ClockPair<S>& pair, S departure,
                                           std::int64_t host);
  [[nodiscard]] Result<Measured<S>> used(const ClockPair<S>& pair, std::int64_t host);

  ClockSyncOptions<S> options_{};
  ClockFilter<S> filter_;
  ClockPair<S> suspect_{};  // the first frame, or the last that departed
  std::int64_t host_ = 0;   // of the last frame used, or the first
  int departures_ = 0;
  bool based_ = false;
  bool tracked_ = false;
  bool jumped_ = false;
};

template <class S>
Result<Measured<S>> ClockSync<S>::update(DeviceTime<> control_tx, DeviceTime<> anchor_rx, S flight,
                                         std::int64_t host) {
  if (!is_valid(options_)) return std::unexpected(Error::InvalidOption);
  if (!std::isfinite(flight)) return std::unexpected(Error::NotFinite);
  if (std::abs(flight) > S(1e-3)) return std::unexpected(Error::RangeBeyondMaximum);
  const S ticks = flight / kTickSeconds<S>;
  const S whole = std::floor(ticks);
  const ClockPair<S> pair{control_tx + integer_ticks(whole), ticks - whole, anchor_rx};

  if (!based_) return std::unexpected(restart(pair, host, Error::NotYetTracked));
  std::int64_t gap = 0;
  const bool overflow = __builtin_sub_overflow(host, host_, &gap);
  if (host <= host_) {
    if (overflow || gap < -options_.reorder_window) restart(pair, host, Error::TimeNotIncreasing);
    return std::unexpected(Error::TimeNotIncreasing);
  }
  if (overflow || gap > options_.max_gap) {
    return std::unexpected(restart(pair, host, Error::GapTooLong));
  }
  if (!tracked_) return begin(pair, host);

  // Equation (2).
  const S departure = control_ticks(filter_.at(anchor_rx), pair);
  const S variance = filter_.variance_at(anchor_rx, wander()) + noise();
  if (!(departure * departure <= kGate * variance)) return depart(pair, departure, host);
  if (anchor_rx - filter_.base().anchor <= 0) return std::unexpected(Error::TimeNotIncreasing);
  filter_.correct(anchor_rx, departure, noise(), wander());
  return used(pair, host);
}

template <class S>
Result<Measured<S>> ClockSync<S>::begin(const ClockPair<S>& pair, std::int64_t host) {
  const std::int64_t run = pair.anchor - suspect_.anchor;
  // Below a microsecond a rate means nothing.
  if (run < (1 << 16)) return std::unexpected(restart(pair, host, Error::TimeNotIncreasing));
  const S gained = scalar_ticks<S>(ClockFilter<S>::difference(suspect_, pair));
  if (!(std::abs(gained) <= options_.max_clock_offset * scalar_ticks<S>(run))) {
    return std::unexpected(restart(pair, host, Error::ClockOffsetOutOfBounds));
  }
  filter_ = ClockFilter<S>{suspect_, pair, noise(), wander()};
  tracked_ = true;
  return used(pair, host);
}

template <class S>
Result<Measured<S>> ClockSync<S>::used(const ClockPair<S>& pair, std::int64_t host) {
  if (!(std::abs(filter_.rate().value) <= options_.max_clock_offset)) {
    return std::unexpected(restart(pair, host, Error::ClockOffsetOutOfBounds));
  }
  host_ = host;
  departures_ = 0;
  jumped_ = false;
  return filter_.rate();
}

template <class S>
Result<Measured<S>> ClockSync<S>::depart(const ClockPair<S>& pair, S departure, std::int64_t host) {
  const bool known = jumped_;
  const bool far = std::abs(departure) > options_.max_excess / kTickSeconds<S>;
  ++departures_;
  const bool last = departures_ >= (far ? kMaxJumps : options_.max_outliers);
  if (departures_ > 1 && (far || last)) {
    const std::int64_t run = pair.anchor - suspect_.anchor;
    const S apart = control_ticks(filter_.carried(suspect_, pair.anchor), pair);
    const S s = ClockFilter<S>::spans(run);
    const S variance = 2 * noise() + s * s * filter_.rate_variance_at(pair.anchor, wander());
    if (run > 0 && apart * apart <= kGate * variance) {
      filter_.relock(pair, noise(), wander());
      const auto rate = used(pair, host);
      if (rate && !known) return std::unexpected(Error::ClockJump);
      return rate;
    }
    if (last) return std::unexpected(restart(pair, host, Error::ClockJump));
  }
  suspect_ = pair;
  jumped_ = far;
  return std::unexpected(far ? Error::ClockJump : Error::OutlierRejected);
}

template <class S>
Result<ControlTime<S>> ClockSync<S>::to_control(DeviceTime<> stamp, std::int64_t host) const {
  if (!tracked_) return std::unexpected(Error::NotYetTracked);
  if (jumped_) return std::unexpected(Error::ClockJump);
  std::int64_t gap = 0;
  const bool overflow = __builtin_sub_overflow(host, host_, &gap);
  if (overflow || gap > kLongestSyncGap || gap < -kLongestSyncGap)
    return std::unexpected(Error::TooOld);
  const std::int64_t run = stamp - filter_.base().anchor;
  const std::int64_t limit = options_.max_age * 638'976 / 10;
  if (run > limit || run < -limit) return std::unexpected(Error::TooOld);
  const ClockPair<S> event = filter_.at(stamp);
  return ControlTime<S>{event.control, event.fraction,
                        filter_.variance_at(stamp, wander()) * kTickSeconds<S> * kTickSeconds<S>};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
