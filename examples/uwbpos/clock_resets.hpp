// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Where in a log the clock that stamped it was set.

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "formats.hpp"

namespace uwbpos::host {

/// What there is to know of a row, in the order of the file.
struct Stamp {
  double t;                           ///< [s]
  std::array<std::uint32_t, 3> link;  ///< ids: a tag, and one or two anchors
  double value;                       ///< of what it says, a number that hardly comes twice
};

/// Rows whose times are to be moved, up to the next of these.
struct ClockStep {
  std::size_t row;  ///< the first
  double forth;     ///< by how much [s]
  bool is_reset;    ///< else another part of the log, as of another tag, that begins anew
};

/// A clock set back looks unlike rows that come late or parts of a log in the wrong order, which
/// fill a hole in what the rest tells or end where it begins; unlike a log whose tags or anchors
/// stand one after the other, whole or in batches, which are then others; and unlike rows logged
/// twice. Less than eight rows (of random pairs sixteen) are not seen, and steps more frequent than
/// a clock's own overflow are none. Set forward it is believed beyond three years, where nothing
/// else could be meant. Times go on by the usual step of each link. O(n log n), of a log without
/// any order too.
[[nodiscard]] std::vector<ClockStep> find_clock_steps(const std::vector<Stamp>& stamps);

/// One of several logs.
struct LogClock {
  std::vector<ClockReset>& resets;            ///< in order
  std::function<void(double, double)> moves;  ///< moves rows from a time on, by so much [s]
};

/// Where logs tell of the same resets of one clock, a pause beside each other, the one that was
/// silent for the shortest time is right for all: nobody knows how long the others were.
void align_clock_resets(const std::vector<LogClock>& logs);

}  // namespace uwbpos::host
