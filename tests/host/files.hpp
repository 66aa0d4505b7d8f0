// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Files of a test, in a directory of their own that goes when the test does.

#include <atomic>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>

#include <unistd.h>

namespace uwbpos::test {

class Files {
 public:
  Files() {
    static std::atomic<int> count = 0;
    directory_ = std::filesystem::temp_directory_path() /
                 ("uwbpos_test_" + std::to_string(getpid()) + "_" + std::to_string(count++));
    std::filesystem::create_directories(directory_);
  }
  ~Files() {
    std::error_code ignored;
    std::filesystem::remove_all(directory_, ignored);
  }
  Files(const Files&) = delete;
  Files& operator=(const Files&) = delete;

  [[nodiscard]] std::filesystem::path path(std::string_view name) const {
    return directory_ / name;
  }

  /// Writes a file and returns its path.
  std::filesystem::path write(std::string_view name, std::string_view content) const {
    std::ofstream{path(name), std::ios::binary} << content;
    return path(name);
  }

  [[nodiscard]] std::string read(std::string_view name) const {
    std::ifstream stream{path(name), std::ios::binary};
    return {std::istreambuf_iterator<char>{stream}, {}};
  }

 private:
  std::filesystem::path directory_;
};

}  // namespace uwbpos::test
