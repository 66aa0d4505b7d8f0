// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a simulated radio is like, presets, and one device drawn from such a make.

#include <cmath>
#include <cstdint>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/sim/device_clock.hpp"
#include "uwbpos/sim/instant.hpp"
#include "uwbpos/sim/noise.hpp"

namespace uwbpos::sim {

/// A make of radio and its firmware. All zeros but the speed: a perfect one.
struct Radio {
  /// Clock rates are uniform in ± this (a fraction: 20 ppm = 20e-6).
  double max_rate = 0;
  /// Random walk of the rate [1/√s]; a crystal in a room moves some 1e-9.
  double rate_walk = 0;
  /// Standard deviation of a reception's timestamp [s].
  double sigma_rx = 0;
  /// Standard deviation of when a frame really leaves, about its timestamp [s].
  double sigma_tx = 0;
  /// The responder's reply time Db [s], by its own clock.
  double reply = 0;
  /// The initiator's reply time Da [s], by its own clock.
  double final_reply = 0;
  /// How far each strays, uniform in ± this [s].
  double reply_jitter = 0;
  /// Transmissions start on multiples of this many ticks, a power of two (512 on a DW1000).
  std::int64_t tx_grid = 1;
  /// Probability that a frame is lost.
  double loss = 0;
  /// Transmit plus receive antenna delay that calibration left in a device [s], its mean.
  double antenna_delay = 0;
  /// Its standard deviation from device to device [s].
  double antenna_delay_spread = 0;
  /// Standard deviation of the clock offset that a receiver reads off the carrier (fraction).
  double sigma_clock_offset = 0;
  /// Speed of propagation [m/s].
  double propagation_speed = kSpeedOfLightAir<double>;
};

/// Perfect clocks and timestamps but for the rounding to ticks; equal replies of 300 µs.
[[nodiscard]] constexpr Radio ideal_radio() { return {.reply = 300e-6, .final_reply = 300e-6}; }

/// Like a DW1000 module with a ±20 ppm crystal: 0.15 ns a reception, 3.2 cm single-sided.
[[nodiscard]] constexpr Radio dw1000_radio() {
  return {.max_rate = 20e-6,
          .rate_walk = 1e-9,
          .sigma_rx = 0.15e-9,
          .reply = 300e-6,
          .final_reply = 300e-6,
          .reply_jitter = 2e-6,
          .tx_grid = 512,
          .sigma_clock_offset = 0.1e-6};
}

/// Like a DW3000 module: better timestamps, and a temperature-compensated ±5 ppm oscillator.
[[nodiscard]] constexpr Radio dw3000_radio() {
  return {.max_rate = 5e-6,
          .rate_walk = 0.3e-9,
          .sigma_rx = 0.1e-9,
          .reply = 650e-6,
          .final_reply = 650e-6,
          .reply_jitter = 2e-6,
          .tx_grid = 512,
          .sigma_clock_offset = 0.05e-6};
}

/// The setting of paper (000): ±20 ppm clocks and unequal replies of hundreds of microseconds,
/// drawn anew for each exchange, so that Da − Db is now positive, now negative.
[[nodiscard]] constexpr Radio delivery_robot_radio() {
  return {.max_rate = 20e-6,
          .rate_walk = 1e-9,
          .sigma_rx = 0.15e-9,
          .reply = 250e-6,
          .final_reply = 300e-6,
          .reply_jitter = 100e-6,
          .tx_grid = 512,
          .sigma_clock_offset = 0.1e-6};
}

/// One radio.
struct Device {
  DeviceClock clock{};       ///< its own
  double antenna_delay = 0;  ///< transmit plus receive [s], half of which counts each way
};

/// A device of that make, switched on at some time before `start`: its counter stands anywhere
/// in its 40 bits.
[[nodiscard]] inline Device make_device(const Radio& radio, Instant start, Random& random) {
  Device device;
  device.clock.rate = random.uniform(-radio.max_rate, radio.max_rate);
  device.clock.rate_walk = radio.rate_walk;
  device.clock.reading.ticks = static_cast<std::int64_t>(random.bits() >> 24);
  device.clock.reading.fraction = random.uniform();
  device.clock.at = start;
  device.antenna_delay = random.normal(radio.antenna_delay, radio.antenna_delay_spread);
  return device;
}

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
