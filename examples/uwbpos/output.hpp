// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Writing files so that a full disk or a missing directory is told, never passed over.

#include <filesystem>
#include <string_view>

namespace uwbpos::host {

/// Makes the directory and those above it. Throws `Failure` if it cannot be written to.
void make_directory(const std::filesystem::path& directory);

/// Replaces a file. Throws `Failure` if not every byte could be written.
void write_file(const std::filesystem::path& file, std::string_view content);

}  // namespace uwbpos::host
