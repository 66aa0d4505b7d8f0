// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// One subnet of anchors that hear a tag blink (patent 001): it follows every anchor's clock from
/// the control anchor's sync frames, and makes of the arrivals of a blink what a solver takes.
/// Equations are those of time/clock_sync.hpp and ranging/tdoa_uplink.hpp. Against the reference 0,
///   (1) \f$ d_i = v\,(t_i - t_0),\quad
///       \sigma^2 = \tfrac1n \sum_{i=0}^{n-1} v^2 (\sigma_t^2 + P_i) \f$:
/// solvers want one σ for all arrivals; equal ones are what well-kept clocks come to.
///
/// \code
/// auto subnet = UplinkSubnet<float, 3>::make(anchors, control_id);
/// subnet->sync(anchor_id, control_tx, anchor_rx, host);            // each sync frame, each anchor
/// const auto blink = subnet->differences(arrivals, host);          // each blink
/// if (blink) fix = locate(blink->reference, blink->differences(), blink->sigma);
/// \endcode

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/geometry/anchors.hpp"
#include "uwbpos/ranging/tdoa_uplink.hpp"
#include "uwbpos/time/clock_sync.hpp"
#include "uwbpos/time/control_time.hpp"
#include "uwbpos/time/device_time.hpp"

namespace uwbpos {

/// One anchor's reception of a blink.
struct BlinkArrival {
  std::uint32_t anchor_id;  ///< whose
  DeviceTime<> stamp;       ///< on that anchor's own clock
};

/// All that one blink says, as solvers take it.
template <class S, int D, int Capacity>
struct BlinkDifferences {
  Vec<S, D> reference;         ///< the anchor that the others are compared with [m]
  std::uint32_t reference_id;  ///< the control anchor, or if that heard nothing the best other
  S sigma;                     ///< of one arrival, equation (1) [m]
  int size;                    ///< how many differences there are
  int refused;                 ///< arrivals that could not be used
  Error last_refusal;          ///< why the last of them could not, if there are any
  std::array<DifferenceTo<S, D>, static_cast<std::size_t>(Capacity)> entries;  ///< `size` count

  /// The differences, one contiguous range, valid as long as this struct.
  [[nodiscard]] std::span<const DifferenceTo<S, D>> differences() const {
    return {entries.data(), static_cast<std::size_t>(size)};
  }
};

/// Anchors, their trackers, and what turns blinks into differences. About 150 bytes an anchor;
/// never allocates.
template <class S, int D, int Capacity = 16>
class UplinkSubnet {
 public:
  /// Up to `Capacity` anchors, of which `control_id` sends the sync frames.
  /// Errors: UnknownAnchor (`control_id`), InvalidOption.
  [[nodiscard]] static Result<UplinkSubnet> make(const Anchors<S, D, Capacity>& anchors,
                                                 std::uint32_t control_id,
                                                 const ClockSyncOptions<S>& sync_options = {},
                                                 const TdoaUplinkOptions<S>& options = {}) {
    if (!anchors.contains(control_id)) return std::unexpected(Error::UnknownAnchor);
    if (!is_valid(sync_options) || !detail::uplink_options_valid(options)) {
      return std::unexpected(Error::InvalidOption);
    }
    return UplinkSubnet{anchors, control_id, sync_options, options};
  }

  /// A sync frame at one anchor: sent and received as `ClockSync::update` wants it, which says what
  /// is returned; the flight follows from the anchors' distance. `delays` [s]: the control anchor's
  /// transmit and this one's receive delay, where stamps include them.
  /// Errors: UnknownAnchor, DuplicateAnchor (the control anchor itself), those of
  /// `ClockSync::update`.
  [[nodiscard]] Result<Measured<S>> sync(std::uint32_t anchor_id, DeviceTime<> control_tx,
                                         DeviceTime<> anchor_rx, std::int64_t host,
                                         S delays = S(0)) {
    const auto place = find(anchor_id);
    if (!place) return std::unexpected(place.error());
    if (*place == control_) return std::unexpected(Error::DuplicateAnchor);
    const Vec<S, D> gap = position(*place) - position(control_);
    S square = 0;
    for (int axis = 0; axis < D; ++axis) square += gap(axis) * gap(axis);
    const S flight = std::sqrt(square) / options_.propagation_speed + delays;
    return syncs_[*place].update(control_tx, anchor_rx, flight, host);
  }

  /// When one anchor received a blink, in control time. Antenna delays of blinks cancel if all
  /// anchors have the same; else take them off the stamps first.
  /// Errors: UnknownAnchor, those of `ClockSync::to_control`.
  [[nodiscard]] Result<ControlTime<S>> arrival(const BlinkArrival& heard, std::int64_t host) const {
    const auto place = find(heard.anchor_id);
    if (!place) return std::unexpected(place.error());
    if (*place == control_) return control_arrival<S>(heard.stamp, S(0), options_);
    return anchor_arrival<S>(syncs_[*place], heard.stamp, host, S(0), options_);
  }

  /// The differences (1) of one blink's arrivals, in their order without the reference: the control
  /// anchor if it heard the blink, else the arrival of least variance. Arrivals that cannot be used
  /// (what `arrival` refuses, DuplicateAnchor, what `tdoa_uplink_difference` refuses) are counted.
  /// `host` [µs] as for `sync`. O(n). Errors: TooManyMeasurements (more than `Capacity`),
  /// TooFewMeasurements (fewer than two can be used: `arrival` tells why).
  [[nodiscard]] Result<BlinkDifferences<S, D, Capacity>> differences(
      std::span<const BlinkArrival> arrivals, std::int64_t host) const;

  /// The tracker of one anchor's clock. Error: UnknownAnchor.
  [[nodiscard]] Result<Measured<S>> rate(std::uint32_t anchor_id) const {
    const auto place = find(anchor_id);
    if (!place) return std::unexpected(place.error());
    return syncs_[*place].rate();
  }

  /// The anchors as given.
  [[nodiscard]] const Anchors<S, D, Capacity>& anchors() const { return anchors_; }

 private:
  static constexpr auto kCapacity = static_cast<std::size_t>(Capacity);

  UplinkSubnet(const Anchors<S, D, Capacity>& anchors, std::uint32_t control_id,
               const ClockSyncOptions<S>& sync_options, const TdoaUplinkOptions<S>& options)
      : anchors_{anchors}, options_{options}, control_{find(control_id).value_or(0)} {
    syncs_.fill(ClockSync<S>{sync_options});
  }

  [[nodiscard]] Result<std::size_t> find(std::uint32_t id) const {
    for (std::size_t i = 0; i < static_cast<std::size_t>(anchors_.size()); ++i) {
      if (anchors_[static_cast<int>(i)].id == id) return i;
    }
    return std::unexpected(Error::UnknownAnchor);
  }

  [[nodiscard]] const Vec<S, D>& position(std::size_t place) const {
    return anchors_[static_cast<int>(place)].position;
  }

  Anchors<S, D, Capacity> anchors_;
  TdoaUplinkOptions<S> options_;
  std::array<ClockSync<S>, kCapacity> syncs_{};
  std::size_t control_ = 0;
};

template <class S, int D, int Capacity>
Result<BlinkDifferences<S, D, Capacity>> UplinkSubnet<S, D, Capacity>::differences(
    std::span<const BlinkArrival> arrivals, std::int64_t host) const {
  if (arrivals.size() > kCapacity) return std::unexpected(Error::TooManyMeasurements);
  std::array<ControlTime<S>, kCapacity> times{};
  std::array<std::size_t, kCapacity> places{};
  std::size_t count = 0;
  std::size_t reference = 0;
  BlinkDifferences<S, D, Capacity> blink{};
  const auto refuse = [&](Error error) {
    ++blink.refused;
    blink.last_refusal = error;
  };
  std::array<bool, kCapacity> seen{};
  for (const BlinkArrival& heard : arrivals) {
    const auto time = arrival(heard, host);
    if (!time) {
      refuse(time.error());
      continue;
    }
    const std::size_t place = find(heard.anchor_id).value_or(0);
    if (seen[place]) {
      refuse(Error::DuplicateAnchor);
      continue;
    }
    seen[place] = true;
    times[count] = *time;
    places[count] = place;
    // The control anchor's variance is the least there is.
    if (times[count].variance < times[reference].variance) reference = count;
    ++count;
  }
  if (count < 2) return std::unexpected(Error::TooFewMeasurements);

  blink.reference = position(places[reference]);
  blink.reference_id = anchors_[static_cast<int>(places[reference])].id;
  S variance = options_.propagation_speed * options_.propagation_speed * times[reference].variance;
  for (std::size_t i = 0; i < count; ++i) {
    if (i == reference) continue;
    const auto difference = tdoa_uplink_difference(times[reference], times[i], options_);
    if (!difference) {
      refuse(difference.error());
      continue;
    }
    blink.entries[static_cast<std::size_t>(blink.size++)] = {position(places[i]),
                                                             difference->value};
    variance += difference->variance - difference->shared_variance;
  }
  if (blink.size == 0) return std::unexpected(Error::TooFewMeasurements);
  blink.sigma = std::sqrt(variance / static_cast<S>(blink.size + 1));
  return blink;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
