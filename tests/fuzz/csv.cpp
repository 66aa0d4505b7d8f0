// SPDX-License-Identifier: MIT

/// @file
/// Any bytes at all as each of the host command's input files. Rows that do not fit are counted,
/// files that do not fit are a `Failure`; what is read is finite.

#include "csv.hpp"

#include <cmath>
#include <filesystem>
#include <string>

#include <sys/mman.h>
#include <unistd.h>

#include "bytes.hpp"
#include "failure.hpp"
#include "formats.hpp"

namespace {

using uwbpos::fuzz::require;

/// A file in memory with the given text.
class MemoryFile {
 public:
  explicit MemoryFile(std::span<const std::uint8_t> text)
      : descriptor_{memfd_create("fuzz", 0)},
        path_{"/proc/self/fd/" + std::to_string(descriptor_)} {
    require(descriptor_ >= 0, "a file in memory");
    const auto written = write(descriptor_, text.data(), text.size());
    require(written == static_cast<ssize_t>(text.size()), "all of it written");
    lseek(descriptor_, 0, SEEK_SET);
  }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  int descriptor_;
  std::filesystem::path path_;
};

template <class T>
void check_times(const uwbpos::host::Log<T>& log) {
  double last = -std::numeric_limits<double>::infinity();
  for (const T& row : log.rows) {
    require(std::isfinite(row.t) && row.t >= last, "rows come by time");
    last = row.t;
  }
  require(log.rows.size() <= log.counts.rows, "no more rows than the file has");
}

void read(int kind, const std::filesystem::path& file) {
  uwbpos::host::Problems problems{false, true};
  switch (kind) {
    case 0:
      (void)uwbpos::host::read_anchors(file, problems);
      break;
    case 1:
      (void)uwbpos::host::read_bias(file, problems);
      break;
    case 2:
      (void)uwbpos::host::read_power_bias(file, problems);
      break;
    case 3:
      (void)uwbpos::host::read_trajectory(file, problems);
      break;
    case 4:
      check_times(uwbpos::host::read_twr(file, problems));
      break;
    default:
      check_times(uwbpos::host::read_ranges(file, problems));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const MemoryFile file{std::span{data, size}.subspan(1)};
  try {
    read(data[0] % 6, file.path());
  } catch (const uwbpos::host::Failure& failure) {
    require(failure.what()[0] != '\0', "a failure says what failed");
  }
  return 0;
}
