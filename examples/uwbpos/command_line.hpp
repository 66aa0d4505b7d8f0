// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The command's front: arguments in, exit code out.

namespace uwbpos::host {

inline constexpr int kSuccess = 0;
inline constexpr int kBadInput = 1;  ///< or nothing to solve
inline constexpr int kBadUsage = 2;

/// Runs the command as `main` would. Prints results on standard output, everything that went
/// wrong on standard error.
int run(int argc, const char* const* argv);

}  // namespace uwbpos::host
