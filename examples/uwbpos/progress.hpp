// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A percentage on the terminal while work is long.

#include <chrono>
#include <cstddef>
#include <string>

namespace uwbpos::host {

/// Shows `what … 42 %` on standard error, if that is a terminal, once the work has taken half a
/// second; takes it away when destroyed.
class Progress {
 public:
  explicit Progress(std::string what);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void operator()(std::size_t done, std::size_t of);

 private:
  std::string what_;
  std::chrono::steady_clock::time_point shown_at_;
  bool terminal_;
  bool shown_ = false;
};

}  // namespace uwbpos::host
