// SPDX-License-Identifier: MIT
#include "output.hpp"

#include <fstream>

#include <fmt/format.h>

#include "failure.hpp"

namespace uwbpos::host {

void make_directory(const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (!std::filesystem::is_directory(directory, error)) {
    throw Failure{fmt::format("{}: cannot be made a directory for the output", directory.string())};
  }
}

void write_file(const std::filesystem::path& file, std::string_view content) {
  std::ofstream stream{file, std::ios::binary | std::ios::trunc};
  stream.write(content.data(), static_cast<std::streamsize>(content.size()));
  stream.close();
  if (!stream) throw Failure{fmt::format("{}: cannot be written", file.string())};
}

}  // namespace uwbpos::host
