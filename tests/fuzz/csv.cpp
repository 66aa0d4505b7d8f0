// SPDX-License-Identifier: MIT

/// @file
/// Any bytes at all as each of the host command's input files. Rows that do not fit are counted,
/// files that do not fit are a `Failure`; what is read is finite.

#include "csv.hpp"

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <tuple>

#include <sys/mman.h>
#include <unistd.h>

#include "bytes.hpp"
#include "failure.hpp"
#include "formats.hpp"
#include "link_network.hpp"
#include "subnets.hpp"

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

void check_points(const uwbpos::host::Points& points) {
  for (const auto& [id, position] : points) require(position.allFinite(), "a point is finite");
}

void check_bias(const uwbpos::host::BiasTable& table) {
  for (const auto& [link, bias] : table.of_link) {
    require(std::isfinite(bias) && table.find(link.first, link.second) == bias, "a link's bias");
  }
  for (const auto& [anchor, bias] : table.of_anchor) require(std::isfinite(bias), "a bias");
}

void check_power_bias(const uwbpos::host::PowerBiasTable& table) {
  for (std::size_t i = 0; i < table.size(); ++i) {
    require(std::isfinite(table[i].power_dbm) && std::isfinite(table[i].bias), "a finite row");
    require(i == 0 || table[i - 1].power_dbm < table[i].power_dbm, "ascending by power");
  }
}

// Poses by time; between two of them there is one, that turns and does no more.
void check_trajectory(const uwbpos::host::Trajectory& trajectory) {
  double last = -std::numeric_limits<double>::infinity();
  for (const auto& pose : trajectory.poses()) {
    require(std::isfinite(pose.t) && pose.t > last, "poses come by time");
    require(pose.position.allFinite(), "a finite position");
    const double between = std::isfinite(last) ? last / 2 + pose.t / 2 : pose.t;
    if (const auto at = trajectory.at(between)) {
      const auto& q = at->rotation;
      const double length = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
      require(at->position.allFinite(), "a finite position between two");
      require(std::abs(length - 1) < 1e-6, "a unit quaternion");
    }
    last = pose.t;
  }
}

// The network says the same of a link however it was trained, or nothing.
void check_network(const std::filesystem::path& file) {
  const uwbpos::host::LinkNetwork network{file};
  const auto still = uwbpos::Mat<double, 3>::Identity().eval();
  for (const unsigned anchor : {0u, 1u, 4000000000u}) {
    for (const double x : {0.0, 3.0, 1e300, std::numeric_limits<double>::quiet_NaN()}) {
      const auto bias = network.bias(0, anchor, {x, 1, 2}, still);
      require(!bias || std::isfinite(*bias), "a finite bias");
    }
  }
}

template <class T>
void check_times(const uwbpos::host::Log<T>& log) {
  double last = -std::numeric_limits<double>::infinity();
  for (const T& row : log.rows) {
    require(std::isfinite(row.t) && row.t >= last, "rows come by time");
    last = row.t;
  }
  require(log.rows.size() <= log.counts.rows, "no more rows than the file has");
}

// The file is subnets.csv; the anchors are six, of three subnets.
void check_subnets(const std::filesystem::path& file, uwbpos::host::Problems& problems) {
  static constexpr std::string_view kAnchors =
      "anchor_id,x_m,y_m,z_m,subnet_id\n10,0,0,3,1\n11,20,0,3,1\n12,20,15,2,1\n"
      "20,0,0,3,2\n21,10,0,3,2\n30,0,0,3,3\n";
  const MemoryFile anchors_file{
      std::span{reinterpret_cast<const std::uint8_t*>(kAnchors.data()), kAnchors.size()}};
  uwbpos::host::Points anchors;
  for (const auto& [id, x, y, z] :
       std::initializer_list<std::tuple<unsigned, int, int, int>>{{10, 0, 0, 3},
                                                                  {11, 20, 0, 3},
                                                                  {12, 20, 15, 2},
                                                                  {20, 0, 0, 3},
                                                                  {21, 10, 0, 3},
                                                                  {30, 0, 0, 3}}) {
    anchors[id] = {double(x), double(y), double(z)};
  }
  const auto table = uwbpos::host::read_subnets(file, anchors_file.path(), anchors, problems);
  require(!table.empty() && table.frames.size() <= std::size_t{uwbpos::host::kMostSubnets},
          "some subnets, and no more than fit");
  for (const auto& frame : table.frames) {
    require(frame.map_T_subnet.translation.allFinite() && std::isfinite(frame.height.value) &&
                std::isfinite(frame.height.variance),
            "a frame is finite");
  }
  require(!anchors.empty(), "anchors that belong to a subnet");
  for (const auto& [id, position] : anchors) {
    require(position.allFinite(), "an anchor in the map is finite");
    require(table.of_anchor.at(id) < table.frames.size(), "its subnet is there");
  }
}

void read(int kind, const std::filesystem::path& file) {
  uwbpos::host::Problems problems{false, true};
  switch (kind) {
    case 0:
      check_points(uwbpos::host::read_anchors(file, problems));
      break;
    case 1:
      check_bias(uwbpos::host::read_bias(file, problems));
      break;
    case 2:
      check_power_bias(uwbpos::host::read_power_bias(file, problems));
      break;
    case 3:
      check_trajectory(uwbpos::host::read_trajectory(file, problems));
      break;
    case 4:
      check_times(uwbpos::host::read_twr(file, problems));
      break;
    case 5:
      try {
        check_times(uwbpos::host::read_tdoa(file, problems));
      } catch (const uwbpos::host::Failure&) {
        check_times(uwbpos::host::read_imu(file, problems));
      }
      break;
    case 6:
      check_subnets(file, problems);
      break;
    case 7:
      check_times(uwbpos::host::read_ranges(file, problems));
      break;
    case 8:
      check_points(uwbpos::host::read_tags(file, problems));
      break;
    case 9:
      check_times(uwbpos::host::read_ultrasonic(file, problems));
      break;
    case 10:
      check_times(uwbpos::host::read_imu(file, problems));
      break;
    default:
      check_network(file);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const MemoryFile file{std::span{data, size}.subspan(1)};
  try {
    read(data[0] % 12, file.path());
  } catch (const uwbpos::host::Failure& failure) {
    require(failure.what()[0] != '\0', "a failure says what failed");
  }
  return 0;
}
