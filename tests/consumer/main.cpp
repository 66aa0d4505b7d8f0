// SPDX-License-Identifier: MIT

/// @file
/// A user's program: one position from four ranges, with every public header included.

#include <cmath>
#include <cstdio>
#include <vector>

#include <uwbpos/uwbpos.hpp>

int main() {
  const std::vector<uwbpos::RangeTo<double, 2>> ranges{
      {{0, 0}, 5}, {{6, 0}, 5}, {{6, 8}, 5}, {{0, 8}, 5}};
  const auto fix = uwbpos::locate(ranges);
  if (!fix) {
    std::puts(uwbpos::describe(fix.error()).data());
    return 1;
  }
  std::printf("uwbpos %s: %.3f %.3f\n", uwbpos::kVersion.data(), fix->position.x(),
              fix->position.y());
  return std::hypot(fix->position.x() - 3, fix->position.y() - 4) < 1e-6 ? 0 : 1;
}
