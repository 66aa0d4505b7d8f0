// SPDX-License-Identifier: MIT
#include "progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

namespace uwbpos::host {

Progress::Progress(std::string what)
    : what_{std::move(what)},
      shown_at_{std::chrono::steady_clock::now()},
      terminal_{isatty(STDERR_FILENO) == 1} {}

Progress::~Progress() {
  if (shown_) fmt::print(stderr, "\r\033[K");
}

void Progress::operator()(std::size_t done, std::size_t of) {
  constexpr std::chrono::milliseconds pause{500};
  const auto now = std::chrono::steady_clock::now();
  if (!terminal_ || of == 0 || now - shown_at_ < pause) return;
  shown_at_ = now;
  shown_ = true;
  fmt::print(stderr, "\r{} … {} %\033[K", what_, 100 * done / of);
  std::fflush(stderr);
}

}  // namespace uwbpos::host
