// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Rows of the recordings in recorded/, on the host.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace firmware {

/// A row's numbers, in order of columns.
using Row = std::vector<double>;

/// All rows of recorded/`name`.csv; ends the program if there are none.
inline std::vector<Row> recorded(const std::string& name) {
  std::vector<Row> rows;
  const std::string path = std::string{RECORDED} + "/" + name + ".csv";
  if (std::FILE* const file = std::fopen(path.c_str(), "r")) {
    char line[512];
    if (std::fgets(line, sizeof line, file) == nullptr) line[0] = '\0';  // the columns' names
    while (std::fgets(line, sizeof line, file) != nullptr) {
      Row row;
      for (const char* at = line; *at != '\0' && *at != '\n';) {
        char* end = nullptr;
        row.push_back(std::strtod(at, &end));
        at = *end == ',' ? end + 1 : end;
        if (end == at && *end != '\n' && *end != '\0') break;
      }
      rows.push_back(row);
    }
    std::fclose(file);
  }
  if (rows.empty()) {
    std::fprintf(stderr, "nothing in %s\n", path.c_str());
    std::exit(1);
  }
  return rows;
}

/// Time as a host has it [µs].
inline std::int64_t microseconds(double seconds) { return std::llround(seconds * 1e6); }

}  // namespace firmware
