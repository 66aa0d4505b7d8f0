// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Table 1 of Jiang, Yan, Zang, Zhao (003): counts of three receivers at x = −25.6, 0, 23.75 cm,
/// and what the paper prints for each method.

#include <array>
#include <cstdint>

#include "uwbpos/core/types.hpp"

namespace uwbpos::sim {

/// x, y and distance from the middle receiver [cm].
struct PrintedPosition {
  double x;       ///< [cm]
  double y;       ///< [cm]
  double length;  ///< [cm]
};

/// One row of the table.
struct PrintedRow {
  std::array<std::uint32_t, 3> counts;  ///< ticks of 1/3 µs, at 24 °C
  PrintedPosition truth;                ///< as surveyed
  PrintedPosition conventional;         ///< from the two outer receivers
  PrintedPosition time_difference;      ///< from all three
  PrintedPosition fsri;                 ///< with lag and repair
  double lag;                           ///< [cm]
  std::array<int, 3> repair;            ///< waves added
};

/// The table. It gives y of the last method in row 3 as 111.1, which is the length beside it; the
/// length makes it 107.9.
inline constexpr std::array<PrintedRow, 4> kPaperTable{{
    {{0x2D2E, 0x2623, 0x2053},
     {86.6, 71.3, 112.2},
     {86.9, 71.4, 112.5},
     {86.7, 71.2, 112.2},
     {86.7, 71.2, 112.2},
     0.3129,
     {0, 0, 0}},
    {{0x3AA8, 0x3496, 0x2FB2},
     {100.1, 114.4, 152.0},
     {101.9, 117.0, 155.2},
     {100.1, 114.9, 152.4},
     {100.1, 114.9, 152.4},
     2.7029,
     {0, 0, 0}},
    {{0x29E7, 0x26AC, 0x259D},
     {26.3, 107.6, 110.8},
     {29.1, 110.8, 114.6},
     {24.1, 91.1, 94.3},
     {26.3, 107.9, 111.1},
     2.9617,
     {-1, 0, 0}},
    {{0x3522, 0x2F26, 0x2ACC},
     {82.3, 108.4, 136.1},
     {86.5, 109.6, 139.6},
     {63.2, 79.3, 101.4},
     {82.0, 108.7, 136.1},
     2.9671,
     {-1, 0, 0}},
}};

/// The table's receivers [m].
template <class S>
std::array<Vec<S, 2>, 3> table_receivers() {
  return {Vec<S, 2>{S(-0.256), 0}, Vec<S, 2>{0, 0}, Vec<S, 2>{S(0.2375), 0}};
}

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
