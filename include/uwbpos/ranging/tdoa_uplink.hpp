// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Range differences from one blink of a tag, received by anchors whose clocks are synchronised
/// (math.md 5, patent 001). With t_i the control anchor's time of arrival i, receive delay taken
/// off,
///   (1) \f$ d_i = r_i - r_0 = v\,(t_i - t_0) \f$,
///   (2) \f$ \mathrm{var}\,d_i = v^2 (\sigma_t^2 + P_i) + v^2 (\sigma_t^2 + P_0) \f$,
/// P_i the variance of anchor i's synchronisation, zero for the control anchor. The second half of
/// (2) is shared by all differences of a blink: with the control anchor as reference it is σt²,
/// which a solver's \f$ Q = \sigma^2 (I + 1 1^T) \f$ means. Trackers err independently but for the
/// wander of the control anchor's own clock, which moves them alike and cancels between two of
/// them: there (2) is an upper bound.
///
/// \code
/// // Once per anchor: ClockSync<float> sync; every sync frame: sync.update(tx, rx, flight, host)
/// const auto zero = control_arrival<float>(blink.control_rx);
/// const auto one = anchor_arrival<float>(sync, blink.anchor_rx, host);
/// if (zero && one) difference = tdoa_uplink_difference(*zero, *one);
/// \endcode

#include <cmath>
#include <cstdint>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/time/clock_sync.hpp"
#include "uwbpos/time/control_time.hpp"
#include "uwbpos/time/device_time.hpp"

namespace uwbpos {

/// Options of uplink differences. Domains in brackets.
template <class S>
struct TdoaUplinkOptions {
  /// Standard deviation of the stamp of a blink's reception [s]. [0 < σ ≤ 1 ms]
  S sigma_timestamp = S(0.15e-9);
  /// Differences beyond ± this [m] are no two receptions of one blink. [0 < d ≤ 1000 km]
  S max_difference = S(500);
  /// [m/s]. [1 ≤ v ≤ 3e8]
  S propagation_speed = kSpeedOfLightAir<S>;
};

/// A range difference [m], the variance of its error, and the part of that which it has in common
/// with every other difference of the same blink against the same reference [m²].
template <class S>
struct UplinkDifference {
  S value;            ///< r(arrival's anchor) − r(reference) [m]
  S variance;         ///< equation (2) [m²]
  S shared_variance;  ///< its second half [m²]
};

namespace detail {

// Written so that NaN fails every line.
template <class S>
constexpr bool uplink_options_valid(const TdoaUplinkOptions<S>& o) {
  return o.sigma_timestamp > 0 && o.sigma_timestamp <= S(1e-3) && o.max_difference > 0 &&
         o.max_difference <= S(1e6) && o.propagation_speed >= 1 && o.propagation_speed <= S(3e8);
}

// Takes a receive delay [s] off and adds the stamp's own variance.
template <class S>
Result<ControlTime<S>> uplink_arrival(const ControlTime<S>& stamp, S receive_delay,
                                      const TdoaUplinkOptions<S>& options) {
  if (!uplink_options_valid(options)) return std::unexpected(Error::InvalidOption);
  if (!std::isfinite(receive_delay)) return std::unexpected(Error::NotFinite);
  if (!(std::abs(receive_delay) <= S(1e-3))) return std::unexpected(Error::InvalidOption);
  const S delay = receive_delay / kTickSeconds<S>;
  const S whole = std::floor(delay);
  const S sigma = options.sigma_timestamp;
  return ControlTime<S>{stamp.ticks - integer_ticks(whole), stamp.fraction - (delay - whole),
                        stamp.variance + sigma * sigma};
}

}  // namespace detail

/// A blink's arrival at the control anchor itself, stamped by its own clock. `receive_delay` [s]:
/// of its antenna, where stamps include it.
/// Errors: InvalidOption (an option or the delay outside its domain, |delay| ≤ 1 ms; NaN options
/// too), NotFinite (the delay). O(1), never allocates.
template <class S>
[[nodiscard]] Result<ControlTime<S>> control_arrival(DeviceTime<> stamp, S receive_delay = S(0),
                                                     const TdoaUplinkOptions<S>& options = {}) {
  return detail::uplink_arrival(ControlTime<S>{stamp}, receive_delay, options);
}

/// A blink's arrival at any other anchor, through its synchronisation. `host` [µs] as for
/// `ClockSync::update`. Errors: as for `control_arrival`, and first those of
/// `ClockSync::to_control`: NotYetTracked, ClockJump, TooOld.
template <class S>
[[nodiscard]] Result<ControlTime<S>> anchor_arrival(const ClockSync<S>& sync, DeviceTime<> stamp,
                                                    std::int64_t host, S receive_delay = S(0),
                                                    const TdoaUplinkOptions<S>& options = {}) {
  const auto time = sync.to_control(stamp, host);
  if (!time) return std::unexpected(time.error());
  return detail::uplink_arrival(*time, receive_delay, options);
}

/// Equations (1) and (2) from two arrivals of one blink. Whole ticks are subtracted as integers.
/// That a difference exceeds its anchors' distance is for the solver to find.
/// Errors: InvalidOption (an option is NaN or outside its domain), NotFinite (an arrival),
/// RangeBeyondMaximum (beyond `max_difference`: arrivals of different blinks, most likely).
template <class S>
[[nodiscard]] Result<UplinkDifference<S>> tdoa_uplink_difference(
    const ControlTime<S>& reference, const ControlTime<S>& arrival,
    const TdoaUplinkOptions<S>& options = {}) {
  if (!detail::uplink_options_valid(options)) return std::unexpected(Error::InvalidOption);
  const S speed = options.propagation_speed;
  const S difference = ticks_between(reference, arrival) * (speed * kTickSeconds<S>);
  const S shared = speed * speed * reference.variance;
  const S variance = speed * speed * arrival.variance + shared;
  if (!std::isfinite(difference) || !std::isfinite(variance)) {
    return std::unexpected(Error::NotFinite);
  }
  if (std::abs(difference) > options.max_difference) {
    return std::unexpected(Error::RangeBeyondMaximum);
  }
  return UplinkDifference<S>{difference, variance, shared};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
