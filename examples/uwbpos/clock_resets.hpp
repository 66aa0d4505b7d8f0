// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Where in a log the clock that stamped it was set back.

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace uwbpos::host {

/// What there is to know of a row, in the order of the file.
struct Stamp {
  double t;                           ///< [s]
  std::array<std::uint32_t, 3> link;  ///< ids of what it is of, the tag first
  double value;                       ///< of what it says, a number that hardly comes twice
};

/// A place from which on all times are to be moved.
struct SetBack {
  std::size_t row;  ///< the first
  double forth;     ///< by how much [s]
};

/// A clock set back looks unlike rows that come late or parts of a log in the wrong order, which
/// fill a hole in what the rest tells or end where it begins; unlike a log whose tags or anchors
/// stand one after the other, which are then others; and unlike rows logged twice. Less than eight
/// rows are not seen. O(n log n), of a log without any order too.
[[nodiscard]] std::vector<SetBack> find_set_backs(std::vector<Stamp> rows);

}  // namespace uwbpos::host
