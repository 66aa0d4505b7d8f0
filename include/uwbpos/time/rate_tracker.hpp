// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A tracker of one clock's rate against another's, from pairs of stamps of the same events: a poll
/// that A sends and B receives, say (the time of flight cancels but for motion: 1 m/s is
/// 0.003 ppm). From two successive events
///   (1) \f$ \delta = (\Delta B - \Delta A)/\Delta A = (e_B - e_A)/(1 + e_A) \f$.
/// With counters of W = 2^Bits ticks only ΔA mod W and ΔB mod W are seen:
///   (2) ΔB − ΔA is its own signed residue as long as |δ|ΔA < W/2, however often both wrapped;
///   (3) ΔA = residue + kW, with the k that brings it nearest to the host's interval.
/// A k that is wrong by one scales δ by ΔA/(ΔA ± W) and does nothing else. It happens: a host that
/// reads a queue sees other intervals, and next to nothing of what a full one lost. So k is checked
/// twice. Where the nearest does not explain the stamps by the tracked rate, the one that does,
/// ΔA ≈ (ΔB − ΔA)/δ, is taken if the queue may hide it. And a rate outside the bounds of
/// phase_window.hpp, which know nothing of k, gives way to one inside, until it was once alone
/// there. While neither tells two plausible k apart, the variance says so.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/time/device_time.hpp"
#include "uwbpos/time/phase_window.hpp"
#include "uwbpos/time/rate_tracker_options.hpp"
#include "uwbpos/time/unwrap.hpp"

namespace uwbpos {

/// Follows the rate of clock B against clock A from pairs of stamps of the same events.
/// One scalar Kalman filter: state δ, random walk of density `wander`², measurement (1) with
/// variance \f$ 2\sigma_t^2/\Delta A^2 \f$ (successive ones share a stamp, which makes the variance
/// returned an upper bound). Wraps, restarts and lost frames are data. All differences are
/// integers: a float build loses nothing. About 100 bytes; O(1) per update, never allocates.
template <class S, unsigned Bits = 40>
class RateTracker {
 public:
  /// With the default options.
  RateTracker() = default;

  /// With options, which `update` checks.
  explicit RateTracker(const RateTrackerOptions<S>& options) : options_{options} {}

  /// One more event: `a` on clock A, `b` on clock B, and when the host saw it [µs] — any epoch,
  /// milliseconds are enough, tens of ppm and jitter do not matter.
  /// Returns δ = eB − eA (a fraction) now, and the variance of its error: what
  /// `TwrOptions::clock_offset` and (its root) `sigma_clock_offset` ask for.
  ///
  /// Errors, in the order they are looked for:
  /// - InvalidOption: an option is NaN or outside the domain it states. Nothing changes.
  /// - TimeNotIncreasing: host time stands still or steps back, or both stamps
  ///   are those of the last event once more (nothing changes). A step back within
  ///   `reorder_window` is a late or repeated frame and is ignored; a longer one starts afresh.
  /// - NotYetTracked: the first event.
  /// - GapTooLong: the gap exceeds `max_gap`, or \f$ \delta_{max} \Delta A \f$ reaches half a wrap
  ///   (32 bits, 80 ppm: 420 s). Starts afresh from this event.
  /// - ClockOffsetOutOfBounds: the first rate lies beyond the bound. Starts afresh.
  /// - ClockJump: the rate departs from the tracked one. The event becomes the new base; the rate
  ///   is kept once, but a second jump in a row discards that too: no lock-out.
  [[nodiscard]] Result<Measured<S>> update(DeviceTime<Bits> a, DeviceTime<Bits> b,
                                           std::int64_t host_microseconds);

  /// The rate and its variance as of the last event, accepted or not: after a single ClockJump,
  /// which concerns the stamps and not the crystals, this is still the rate to use.
  /// Error: NotYetTracked.
  [[nodiscard]] Result<Measured<S>> rate() const {
    if (!tracked_) return std::unexpected(Error::NotYetTracked);
    return state_;
  }

  /// Forgets everything but the options.
  void reset() { *this = RateTracker{options_}; }

 private:
  static constexpr S kGate = 6;

  void rebase(DeviceTime<Bits> a, DeviceTime<Bits> b, std::int64_t host) {
    a_ = a;
    b_ = b;
    host_ = host;
    based_ = true;
  }

  Error restart(DeviceTime<Bits> a, DeviceTime<Bits> b, std::int64_t host, Error reason) {
    reset();
    rebase(a, b, host);
    window_.start(host);
    return reason;
  }

  RateTrackerOptions<S> options_{};
  DeviceTime<Bits> a_;
  DeviceTime<Bits> b_;
  std::int64_t host_ = 0;
  PhaseWindow<S> window_;
  Measured<S> state_{};
  bool based_ = false;
  bool tracked_ = false;
  bool jumped_ = false;
  bool settled_ = false;  // once, no other wrap count lay within the bounds
};

template <class S, unsigned Bits>
Result<Measured<S>> RateTracker<S, Bits>::update(DeviceTime<Bits> a, DeviceTime<Bits> b,
                                                 std::int64_t host_microseconds) {
  const std::int64_t host = host_microseconds;
  if (!is_valid(options_)) return std::unexpected(Error::InvalidOption);
  if (!based_) return std::unexpected(restart(a, b, host, Error::NotYetTracked));
  std::int64_t gap = 0;
  const bool overflow = __builtin_sub_overflow(host, host_, &gap);
  if (host <= host_) {
    if (overflow || gap < -options_.reorder_window) restart(a, b, host, Error::TimeNotIncreasing);
    return std::unexpected(Error::TimeNotIncreasing);
  }
  if (overflow || gap > options_.max_gap)
    return std::unexpected(restart(a, b, host, Error::GapTooLong));
  if (a == a_ && b == b_) return std::unexpected(Error::TimeNotIncreasing);  // a repeat

  // Equation (3).
  const std::int64_t host_interval = microseconds_to_ticks(gap);
  const UnwrappedInterval run = unwrap_interval(a, a_, host_interval);
  if (scalar_ticks<S>(run.nearest) * options_.max_clock_offset >= S(DeviceTime<Bits>::kHalfWrap)) {
    return std::unexpected(restart(a, b, host, Error::GapTooLong));
  }

  // Equation (2).
  const std::int64_t difference =
      DeviceTime<Bits>{b.ticks() - b_.ticks()} - DeviceTime<Bits>{a.ticks() - a_.ticks()};
  const S gained = scalar_ticks<S>(difference);
  const auto rate_over = [&](std::int64_t ticks) { return gained / scalar_ticks<S>(ticks); };
  const std::int64_t lag = microseconds_to_ticks(options_.host_lag);
  std::int64_t allowed = microseconds_to_ticks(options_.host_jitter);
  const bool doubtful = run.other && run.other_mismatch <= allowed;

  const S wander = options_.wander * options_.wander * kTickSeconds<S>;
  // The measurement is the mean rate over the interval, not the rate at its end.
  const auto noise_over = [&](std::int64_t ticks) {
    const S stamp = options_.sigma_timestamp / (scalar_ticks<S>(ticks) * kTickSeconds<S>);
    return 2 * stamp * stamp + wander * scalar_ticks<S>(ticks) / 3;
  };
  window_.add(difference);
  std::int64_t ticks = run.nearest;
  if (!tracked_) {
    const S measured = rate_over(ticks);
    if (!(std::abs(measured) <= options_.max_clock_offset)) {
      return std::unexpected(restart(a, b, host, Error::ClockOffsetOutOfBounds));
    }
    const S doubt = doubtful ? measured - rate_over(*run.other) : S(0);
    rebase(a, b, host);
    tracked_ = true;
    return state_ = {measured, noise_over(ticks) + doubt * doubt};
  }

  // A rate known well enough tells the wrap counts apart.
  const S prior = state_.variance + wander * scalar_ticks<S>(host_interval);
  const auto departure = [&](std::int64_t t) { return std::abs(rate_over(t) - state_.value); };
  const auto known = [&](std::int64_t t) { return kGate * std::sqrt(prior + noise_over(t)); };
  const auto explained_by = [&](S rate) {
    return unwrap_explained(a, a_, gained / rate, host_interval, lag);
  };
  if (doubtful && departure(*run.other) < departure(ticks)) ticks = *run.other;
  bool recovered = false;
  if (!(departure(ticks) <= known(ticks))) {
    const std::int64_t lost = explained_by(state_.value);
    recovered = departure(lost) < departure(ticks);
    if (recovered) ticks = lost;
  }

  // The bounds, which know no wraps, may know better.
  const std::int64_t window = window_.length(host);
  const RateBounds<S> bounds =
      window_.bounds(host, options_.host_lag, options_.max_clock_offset,
                     kGate * std::sqrt(noise_over(microseconds_to_ticks(window))));
  bool replaced = false;
  if (run.other && run.other_mismatch <= lag && !settled_ && !bounds.admit(state_.value)) {
    const std::int64_t better = explained_by(bounds.middle);
    replaced = bounds.admit(rate_over(better));
    if (replaced) ticks = better;
  }
  if (recovered || replaced) allowed = lag;
  const S measured = rate_over(ticks);
  const S noise = noise_over(ticks);

  // Other counts that remain.
  S doubt = 0;
  bool alone = true;
  for (const std::int64_t wrap : {-DeviceTime<Bits>::kWrap, DeviceTime<Bits>::kWrap}) {
    const std::int64_t rival = ticks + wrap;
    const std::int64_t mismatch = std::abs(rival - host_interval);
    if (rival <= 0 || mismatch > lag || !bounds.admit(rate_over(rival))) continue;
    alone = false;
    if (mismatch <= allowed && (replaced || departure(rival) <= known(rival))) {
      doubt = std::max(doubt, std::abs(measured - rate_over(rival)));
    }
  }

  if (!(replaced || departure(ticks) <= known(ticks) + options_.max_rate_step) ||
      !(std::abs(measured) <= options_.max_clock_offset)) {
    if (jumped_) return std::unexpected(restart(a, b, host, Error::ClockJump));
    rebase(a, b, host);
    window_.start(host);
    state_.variance = prior;
    jumped_ = true;
    return std::unexpected(Error::ClockJump);
  }
  rebase(a, b, host);
  if (window > window_.kLongest * options_.host_lag) window_.start(host);
  jumped_ = false;
  settled_ = settled_ || alone;
  // Where the rate told the count, and others fit too, the count tells nothing of the rate.
  if (recovered && !replaced && doubt > 0) return state_ = {state_.value, prior};
  const S gain = replaced ? S(1) : prior / (prior + noise);
  return state_ = {state_.value + gain * (measured - state_.value),
                   std::max(gain * noise, doubt * doubt)};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
