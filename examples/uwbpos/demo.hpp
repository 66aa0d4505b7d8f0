// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What the library does, in a minute: a simulated hall, and real recordings where there are any.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

namespace uwbpos::host {

/// Mean and largest error of positions from one method of ranging [m].
struct MethodErrors {
  double mean = 0;
  double rmse = 0;
  double max = 0;
  std::size_t solved = 0;
};

/// Errors of the three methods in the hall of paper (000), on the same exchanges.
struct HallComparison {
  std::size_t places = 0;
  MethodErrors single_sided;  ///< the paper's unimproved method
  MethodErrors symmetric;     ///< the paper's improved one (000-9)
  MethodErrors asymmetric;
};

/// 30 m × 20 m, three base stations on the axes, ±20 ppm clocks, unequal replies; `runs` times 30
/// random places, each with devices of its own.
[[nodiscard]] HallComparison compare_methods(int runs, std::uint64_t seed);

int run_demo(const std::filesystem::path& out);

}  // namespace uwbpos::host
