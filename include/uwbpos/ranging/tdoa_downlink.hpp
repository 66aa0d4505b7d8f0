// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Range differences at a tag that only listens (math.md 5, paper 004): anchor A sends, anchor B
/// hears it and sends, and the tag hears both. With everything of B's on B's clock,
///   (1) \f$ d = r_B - r_A = v\,[\kappa\,(rx_B - rx_A) - (\tau_{AB} + tx_B - rx_{A \to B})] \f$,
/// κ = 1 + δ the rate of B's clock against the tag's. With I = rx_B − rx_A on the tag's clock and
/// J = tx_B − rx_A→B on B's, both integers,
///   (2) \f$ d = v\,[((I - J) + \delta I) - \tau_{AB}] \f$,
///   (3) \f$ \mathrm{var}\,d = v^2\,[3\sigma_t^2 + (I \sigma_\delta)^2] \f$: three receptions are
///       noisy, departures are exact.
/// δ comes from a `RateTracker` fed with successive packets of B: `update(rx at the tag, tx,
/// host)`. Fed with this packet first, its last step holds rx_B too and (3) is an upper bound:
/// between two packets of B it interpolates and averages their noise. Fed afterwards, smoothing is
/// what keeps (Iσδ)² small. A moving tag sees B's rate lowered by the speed at which it leaves B:
/// so far as the tracker follows that, (2) is r_B at the time of A's packet, as it should be; so
/// far as it smooths it, d is r_B at rx_B minus r_A at rx_A.

#include <cmath>
#include <cstdint>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/ranging/ss_twr.hpp"
#include "uwbpos/time/device_time.hpp"

namespace uwbpos {

/// Stamps of two packets: A's, then B's, which tells when B heard A's.
struct DownlinkStamps {
  DeviceTime<> a_rx;       ///< A's packet received by the tag, on the tag's clock.
  DeviceTime<> b_rx;       ///< B's packet received by the tag, on the tag's clock.
  DeviceTime<> a_rx_at_b;  ///< A's packet received by B, on B's clock.
  DeviceTime<> b_tx;       ///< B's packet sent, on B's clock.
};

/// Options of downlink differences. Domains in brackets.
template <class S>
struct TdoaDownlinkOptions {
  /// Standard deviation of a reception's stamp [s]. [0 < σ ≤ 1 ms]
  S sigma_timestamp = S(0.15e-9);
  /// |δ| beyond this is refused, and intervals that imply it. [0 < e ≤ 1 %]
  S max_clock_offset = S(80e-6);
  /// From A's packet to B's at the tag [s]; older ones are refused. [0 < t ≤ 4 s]
  S max_interval = S(0.1);
  /// Differences beyond ± this [m] are refused. [0 < d ≤ 1000 km]
  S max_difference = S(500);
  /// Transmit plus receive delay of B [s], where its stamps include them; those of A and of the
  /// tag cancel. [|d| ≤ 1 ms]
  S antenna_delay_b{};
  /// [m/s]. [1 ≤ v ≤ 3e8]
  S propagation_speed = kSpeedOfLightAir<S>;
};

/// Equations (2) and (3) [m, m²] from two packets; `rate` is δ, the rate of B's clock against the
/// tag's, and its variance (`RateTracker::rate`); `flight` is τ_AB, the anchors' distance over
/// the speed [s]. Whole ticks are subtracted as integers: float is within 0.1 mm of double for
/// the same δ. That a difference exceeds the anchors' distance is for the solver to find.
/// O(1), never allocates.
///
/// Errors, in the order they are looked for:
/// - InvalidOption: an option is NaN or outside its domain.
/// - NotFinite: `rate` or `flight`; NonPositiveSigma: a negative variance; NegativeTimeOfFlight:
///   `flight`; RangeBeyondMaximum: `flight` above 1 ms.
/// - ClockOffsetOutOfBounds: |δ| exceeds `max_clock_offset`.
/// - NonPositiveInterval: B's packet was received before A's, or sent before it heard A's.
/// - TooOld: A's packet lies more than `max_interval` back, on either clock.
/// - RangeBeyondMaximum: the difference exceeds `max_difference`: stamps of different packets,
///   most likely.
/// - NumericOverflow: the rate's variance is beyond all bounds.
template <class S>
[[nodiscard]] Result<Measured<S>> tdoa_downlink_difference(
    const DownlinkStamps& stamps, const Measured<S>& rate, S flight,
    const TdoaDownlinkOptions<S>& options = {}) {
  const auto& o = options;
  // Written so that NaN fails every line.
  const bool valid = o.sigma_timestamp > 0 && o.sigma_timestamp <= S(1e-3) &&
                     o.max_clock_offset > 0 && o.max_clock_offset <= S(0.01) &&
                     o.max_interval > 0 && o.max_interval <= 4 && o.max_difference > 0 &&
                     o.max_difference <= S(1e6) && std::abs(o.antenna_delay_b) <= S(1e-3) &&
                     o.propagation_speed >= 1 && o.propagation_speed <= S(3e8);
  if (!valid) return std::unexpected(Error::InvalidOption);
  if (!std::isfinite(rate.value) || !std::isfinite(rate.variance) || !std::isfinite(flight)) {
    return std::unexpected(Error::NotFinite);
  }
  if (rate.variance < 0) return std::unexpected(Error::NonPositiveSigma);
  if (flight < 0) return std::unexpected(Error::NegativeTimeOfFlight);
  if (flight > S(1e-3)) return std::unexpected(Error::RangeBeyondMaximum);
  if (std::abs(rate.value) > o.max_clock_offset) {
    return std::unexpected(Error::ClockOffsetOutOfBounds);
  }

  const std::int64_t at_tag = stamps.b_rx - stamps.a_rx;
  const std::int64_t at_b = stamps.b_tx - stamps.a_rx_at_b;
  if (at_tag <= 0 || at_b <= 0) return std::unexpected(Error::NonPositiveInterval);
  const S interval = scalar_ticks<S>(at_tag) * kTickSeconds<S>;
  if (interval > o.max_interval ||
      scalar_ticks<S>(at_b) * kTickSeconds<S> > (1 + o.max_clock_offset) * o.max_interval) {
    return std::unexpected(Error::TooOld);
  }

  const S ticks = detail::add_scaled_ticks(at_tag - at_b, rate.value, at_tag);
  const S known = flight + o.antenna_delay_b;
  const S difference = o.propagation_speed * (ticks * kTickSeconds<S> - known);
  if (std::abs(difference) > o.max_difference) return std::unexpected(Error::RangeBeyondMaximum);
  const S sigma = o.sigma_timestamp;
  const S variance = o.propagation_speed * o.propagation_speed *
                     (3 * sigma * sigma + interval * interval * rate.variance);
  if (!std::isfinite(variance)) return std::unexpected(Error::NumericOverflow);
  return Measured<S>{difference, variance};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
