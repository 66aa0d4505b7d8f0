// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Where the real recordings are that some tests replay; they are not part of the repository.

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string_view>
#include <system_error>

namespace uwbpos::test {

/// The folder of recordings: $UWBPOS_DATA, else ../shared/data beside the source tree (whose
/// place the build gives as UWBPOS_SOURCE_DIR, else where the test was started); nothing when
/// neither is a folder.
inline std::optional<std::filesystem::path> data_dir() {
  std::error_code ignored;
  if (const char* named = std::getenv("UWBPOS_DATA"); named != nullptr && *named != '\0') {
    const std::filesystem::path path{named};
    if (std::filesystem::is_directory(path, ignored)) return path;
    return std::nullopt;
  }
#ifdef UWBPOS_SOURCE_DIR
  const std::filesystem::path source{UWBPOS_SOURCE_DIR};
#else
  const std::filesystem::path source = std::filesystem::current_path(ignored);
#endif
  const std::filesystem::path beside = (source / ".." / "shared" / "data").lexically_normal();
  if (std::filesystem::is_directory(beside, ignored)) return beside;
  return std::nullopt;
}

/// Says, where nobody overlooks it, that a test did not run for want of recordings.
inline void say_skipped(std::string_view test) {
  std::cerr << "\n*** SKIPPED: " << test
            << "\n*** its recordings are missing; set UWBPOS_DATA to the folder that holds them\n"
            << std::endl;
}

/// `data_dir() / name`, or nothing after a loud SKIPPED line that names the test:
/// \code
/// const auto folder = data_or_skip("lias/mid", "replays a drive");
/// if (!folder) return;
/// \endcode
inline std::optional<std::filesystem::path> data_or_skip(const std::filesystem::path& name,
                                                         std::string_view test) {
  std::error_code ignored;
  if (const auto folder = data_dir()) {
    if (std::filesystem::exists(*folder / name, ignored)) return *folder / name;
  }
  say_skipped(test);
  return std::nullopt;
}

}  // namespace uwbpos::test
