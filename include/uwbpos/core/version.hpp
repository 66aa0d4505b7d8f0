// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The library's version. This is the one place that states it: CMake, pkg-config and the
/// documentation read it from here, and `./dev lint` holds the changelog to it.

#include <string_view>

namespace uwbpos {

/// Semantic version, "major.minor.patch".
inline constexpr std::string_view kVersion = "0.1.0";

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
