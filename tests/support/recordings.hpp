// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Tables and true poses of real recordings, as plainly as tests need them.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/core/types.hpp"

namespace uwbpos::test {

using Row = std::vector<double>;

/// Numbers of a table; lines that do not begin with one are none.
inline std::vector<Row> rows(const std::filesystem::path& file) {
  std::ifstream stream{file};
  std::vector<Row> all;
  for (std::string line; std::getline(stream, line);) {
    std::ranges::replace(line, ',', ' ');
    std::istringstream words{line};
    Row row;
    for (double x = 0; words >> x;) row.push_back(x);
    if (!row.empty()) all.push_back(row);
  }
  return all;
}

struct TruePose {
  double x, y, z, heading;
};

/// Truth between two of its poses.
class Truth {
 public:
  explicit Truth(const std::filesystem::path& file) : rows_{rows(file)} {}

  [[nodiscard]] bool covers(double t) const {
    return rows_.front()[0] <= t && t <= rows_.back()[0];
  }

  [[nodiscard]] TruePose at(double t) const {
    const auto after = std::upper_bound(rows_.begin() + 1, rows_.end() - 1, t,
                                        [](double time, const Row& r) { return time < r[0]; });
    const Row& b = *after;
    const Row& a = *(after - 1);
    const double w = (t - a[0]) / (b[0] - a[0]);
    const auto heading = [](const Row& r) { return 2 * std::atan2(r[6], r[7]); };
    const double turn = angle_difference(heading(b), heading(a));
    return {a[1] + w * (b[1] - a[1]), a[2] + w * (b[2] - a[2]), a[3] + w * (b[3] - a[3]),
            heading(a) + w * turn};
  }

  [[nodiscard]] double spacing(double t) const {
    const auto after = std::upper_bound(rows_.begin() + 1, rows_.end() - 1, t,
                                        [](double time, const Row& r) { return time < r[0]; });
    return (*after)[0] - (*(after - 1))[0];
  }

 private:
  std::vector<Row> rows_;
};

inline std::map<int, Vec<double, 3>> points(const std::filesystem::path& file) {
  std::map<int, Vec<double, 3>> all;
  for (const Row& r : rows(file)) all[static_cast<int>(r[0])] = {r[1], r[2], r[3]};
  return all;
}

}  // namespace uwbpos::test
