// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A delivery robot with two tags on its front (000, 002): double-sided exchanges with the base
/// stations become ranges, lose their bias by power and their height, become two positions, a
/// heading, and a track.

#include <array>
#include <cstdint>
#include <optional>

#include <uwbpos/filter/motion/planar_robot.hpp>
#include <uwbpos/filter/tracker.hpp>
#include <uwbpos/geometry/height.hpp>
#include <uwbpos/pose/two_tag.hpp>
#include <uwbpos/ranging/ds_twr.hpp>
#include <uwbpos/ranging/range_bias.hpp>

namespace tag {

inline constexpr std::size_t kStations = 4;

/// One finished exchange, as a radio's driver tells it.
struct Exchange {
  std::int64_t time;           ///< of the poll, host clock [µs]
  std::uint32_t tag;           ///< 0 left, 1 right
  std::uint32_t station;       ///< which of the settings' stations
  uwbpos::DsTwrStamps stamps;  ///< ticks of the radios
  float power;                 ///< received [dBm]
};

/// What the application asks of a radio. Write one for your transceiver.
class Radio {
 public:
  /// The next exchange, or nothing when the radio is switched off.
  virtual std::optional<Exchange> next() = 0;

 protected:
  ~Radio() = default;
};

/// Where characters go: a UART, a terminal.
using Put = void (*)(char);

/// All that is the installation's.
struct Settings {
  std::array<uwbpos::Vec<float, 3>, kStations> stations;    ///< in the map [m]
  float tag_height;                                         ///< [m]
  float baseline;                                           ///< between the tags [m]
  float antenna_delay;                                      ///< of each radio, both ways [s]
  std::array<uwbpos::RangeBiasPoint<float>, 4> power_bias;  ///< of the antenna
};

/// That of the simulated hall.
const Settings& settings();

/// Follows exchanges until the radio ends and prints a line for each round of all stations.
/// Returns how many rounds gave a heading.
int run(Radio& radio, const Settings& settings, Put put);

}  // namespace tag
