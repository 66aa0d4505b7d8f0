// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// How the command ends early.

#include <stdexcept>

namespace uwbpos::host {

/// The run cannot go on: bad input, or nothing to solve. `what()` names the file, the line, what
/// was wrong and what was expected; the command prints it and exits with 1.
struct Failure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace uwbpos::host
