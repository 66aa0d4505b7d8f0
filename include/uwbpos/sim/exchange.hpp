// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// One whole two-way exchange of three frames (poll, response, final), as two radios with their
/// own clocks would stamp it, and the truth behind it.
///
/// A frame whose timestamp its sender's clock shows at \f$ t \f$ leaves the antenna at
/// \f$ t + d_s/2 \f$ and is stamped by the receiver when it has travelled
/// \f[ \tau = \frac{|\mathbf p_r(t + \tau) - \mathbf p_s(t)| + \text{excess}}{c},
///     \qquad t + \tfrac12 d_s + \tau + \tfrac12 d_r + \text{noise} \tag{1} \f]
/// with antenna delays \f$ d_s, d_r \f$ (transmit plus receive, half each way). Both ends may
/// move: the geometry is taken anew for every frame, with constant velocities within the
/// exchange, and at reception for the receiver (one fixed-point step; the next would add
/// \f$ (v/c)^2 r \f$, below 1e-13 of the distance). Rates stay constant within an exchange.

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "uwbpos/core/types.hpp"
#include "uwbpos/ranging/ds_twr.hpp"
#include "uwbpos/ranging/ss_twr.hpp"
#include "uwbpos/sim/device_clock.hpp"
#include "uwbpos/sim/instant.hpp"
#include "uwbpos/sim/noise.hpp"
#include "uwbpos/sim/radio.hpp"

namespace uwbpos::sim {

/// An antenna on its way.
struct Motion {
  Vec<double, 3> position = Vec<double, 3>::Zero();  ///< at the start of the exchange [m]
  Vec<double, 3> velocity = Vec<double, 3>::Zero();  ///< [m/s]
};

/// What came of an exchange.
struct Exchange {
  DsTwrStamps stamps{};  ///< all stamps; those after a lost frame are zero
  /// How many frames arrived before one was lost, 0 … 3: two make a single-sided exchange.
  int frames = 0;
  Instant time{};  ///< when the poll was sent
  /// True distance between the antennas [m] of the poll, the response and the final.
  std::array<double, 3> distance{};
  double excess = 0;          ///< excess path of all three frames [m]
  double initiator_rate = 0;  ///< true rate error of the initiator's clock
  double responder_rate = 0;  ///< true rate error of the responder's clock
  /// What the initiator reads off the response's carrier: `clock_offset` plus noise.
  double measured_clock_offset = 0;
};

/// The true \f$ \delta = (1 + e_B)/(1 + e_A) - 1 \approx e_B - e_A \f$, A the initiator.
[[nodiscard]] inline double clock_offset(const Exchange& exchange) {
  return (exchange.responder_rate - exchange.initiator_rate) / (1 + exchange.initiator_rate);
}

/// The stamps of the first two frames, if both arrived.
[[nodiscard]] inline std::optional<SsTwrStamps> ss_stamps(const Exchange& exchange) {
  if (exchange.frames < 2) return std::nullopt;
  const DsTwrStamps& s = exchange.stamps;
  return SsTwrStamps{s.poll_tx, s.poll_rx, s.resp_tx, s.resp_rx};
}

/// The stamps of all three frames, if all arrived.
[[nodiscard]] inline std::optional<DsTwrStamps> ds_stamps(const Exchange& exchange) {
  if (exchange.frames < 3) return std::nullopt;
  return exchange.stamps;
}

/// The distance [m] that single-sided ranging measures: the mean over its two frames.
[[nodiscard]] inline double ss_distance(const Exchange& exchange) {
  return (exchange.distance[0] + exchange.distance[1]) / 2;
}

/// The distance [m] that double-sided ranging measures: the mean of its two round trips (of the
/// asymmetric formula only for equal replies; otherwise it leans towards the trip whose own reply
/// is the shorter, by less than a tag moves in half an exchange).
[[nodiscard]] inline double ds_distance(const Exchange& exchange) {
  return (exchange.distance[0] + 2 * exchange.distance[1] + exchange.distance[2]) / 4;
}

namespace detail {

struct Flight {
  Instant arrival;
  double distance;
};

// (1) without antenna delays and noise; positions are given for `start`.
inline Flight fly(Instant start, Instant sent, const Motion& sender, const Motion& receiver,
                  double excess, double speed) {
  const double since = sent - start;
  const Vec<double, 3> from = sender.position + since * sender.velocity;
  const Vec<double, 3> gap = receiver.position + since * receiver.velocity - from;
  const double first_time = (gap.norm() + excess) / speed;
  const double distance = (gap + first_time * receiver.velocity).norm();
  return {sent + (distance + excess) / speed, distance};
}

// The first count on the transmitter's grid at or after `ticks`.
inline std::int64_t on_grid(std::int64_t ticks, std::int64_t grid) {
  const std::int64_t beyond = ((ticks % grid) + grid) % grid;
  return beyond == 0 ? ticks : ticks + (grid - beyond);
}

}  // namespace detail

/// An exchange that the initiator begins at `start` or within its transmission grid after it.
/// Both clocks are moved on to `start`, which must not lie before the last exchange of either.
/// `excess` [m]: how much longer than the straight line the radio's path is.
/// Draws the same count of random numbers whether or not frames are lost, so that only the
/// losses differ between two runs that differ in `radio.loss`. No allocation.
[[nodiscard]] inline Exchange exchange(Instant start, Device& initiator,
                                       const Motion& initiator_motion, Device& responder,
                                       const Motion& responder_motion, double excess,
                                       const Radio& radio, Random& random) {
  initiator.clock = advance(initiator.clock, start, random);
  responder.clock = advance(responder.clock, start, random);
  const std::int64_t grid = radio.tx_grid;
  const double half_delays = (initiator.antenna_delay + responder.antenna_delay) / 2;

  Exchange result;
  result.excess = excess;
  result.initiator_rate = initiator.clock.rate;
  result.responder_rate = responder.clock.rate;

  // Sends at the count `tx` of the sender's clock; returns the receiver's count.
  const auto send = [&](std::int64_t tx, const Device& from, const Motion& from_motion,
                        const Device& to, const Motion& to_motion, double& distance) {
    const Instant sent = when(from.clock, tx) + radio.sigma_tx * random.normal();
    const auto flight =
        detail::fly(start, sent, from_motion, to_motion, excess, radio.propagation_speed);
    distance = flight.distance;
    return stamp(to.clock, flight.arrival + half_delays, radio.sigma_rx * random.normal());
  };
  // The count of a reply to what was received at `rx`.
  const auto reply = [&](std::int64_t rx, double nominal) {
    const double wait = nominal + radio.reply_jitter * random.uniform(-1, 1);
    return detail::on_grid(
        rx + static_cast<std::int64_t>(wait * static_cast<double>(kTicksPerSecond)), grid);
  };

  const Reading now = read(initiator.clock, start);
  const std::int64_t poll_tx = detail::on_grid(now.ticks + (now.fraction > 0 ? 1 : 0), grid);
  const std::int64_t poll_rx =
      send(poll_tx, initiator, initiator_motion, responder, responder_motion, result.distance[0]);
  const std::int64_t resp_tx = reply(poll_rx, radio.reply);
  const std::int64_t resp_rx =
      send(resp_tx, responder, responder_motion, initiator, initiator_motion, result.distance[1]);
  const std::int64_t final_tx = reply(resp_rx, radio.final_reply);
  const std::int64_t final_rx =
      send(final_tx, initiator, initiator_motion, responder, responder_motion, result.distance[2]);

  result.time = when(initiator.clock, poll_tx);
  result.measured_clock_offset = clock_offset(result) + radio.sigma_clock_offset * random.normal();
  bool arriving = true;
  for (int frame = 0; frame < 3; ++frame) {
    const bool lost = random.chance(radio.loss);
    arriving = arriving && !lost;
    if (arriving) ++result.frames;
  }
  result.stamps.poll_tx = counter(poll_tx);
  if (result.frames >= 1) {
    result.stamps.poll_rx = counter(poll_rx);
    result.stamps.resp_tx = counter(resp_tx);
  }
  if (result.frames >= 2) {
    result.stamps.resp_rx = counter(resp_rx);
    result.stamps.final_tx = counter(final_tx);
  }
  if (result.frames >= 3) result.stamps.final_rx = counter(final_rx);
  return result;
}

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
