// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The subcommands, once their arguments are known. Each returns the exit code or throws `Failure`.

#include <cstdint>
#include <filesystem>

#include "formats.hpp"
#include "recording.hpp"
#include "replay.hpp"
#include "settings.hpp"

namespace uwbpos::host {

int run_replay(const Settings& settings);
int run_calibrate(const Settings& settings);

}  // namespace uwbpos::host
