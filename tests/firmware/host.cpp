// SPDX-License-Identifier: MIT
// Runs every case on the host and writes its inputs and outputs as a header for the target.
#include <cstdio>
#include <string_view>
#include <vector>

#include "cases/entries.hpp"

namespace {

void print_table(const char* symbol, const char* what, const std::vector<firmware::Word>& words) {
  std::printf("inline constexpr firmware::Word %s_%s[] = {", symbol, what);
  for (std::size_t i = 0; i < words.size(); ++i) {
    std::printf("%s0x%08xu,", i % 8 == 0 ? "\n" : "", static_cast<unsigned>(words[i]));
  }
  std::printf("};\n");
}

// The M0 runs no tracker and has no flash for its recording.
bool is_tracker(const firmware::Entry& entry) {
  return std::string_view{entry.symbol}.starts_with("tracker");
}

}  // namespace

int main() {
  std::vector<firmware::Entry> entries;
  for (const auto& unit : {FIRMWARE_UNITS}) entries.insert(entries.end(), unit.begin(), unit.end());
  std::printf("// Written by tests/firmware/host.cpp.\n");
  for (const firmware::Entry& entry : entries) {
    std::vector<firmware::Word> inputs;
    std::vector<firmware::Word> outputs;
    entry.record(entry.symbol, inputs, outputs);
    if (is_tracker(entry)) std::printf("#ifndef BOARD_m0\n");
    print_table(entry.symbol, "inputs", inputs);
    print_table(entry.symbol, "outputs", outputs);
    if (is_tracker(entry)) std::printf("#endif\n");
  }
  std::printf("inline constexpr firmware::Recording kRecordings[] = {\n");
  for (const firmware::Entry& entry : entries) {
    if (is_tracker(entry)) std::printf("#ifndef BOARD_m0\n");
    std::printf("{\"%s\", %d, %s_inputs, %s_outputs},\n", entry.symbol, entry.rounds, entry.symbol,
                entry.symbol);
    if (is_tracker(entry)) std::printf("#endif\n");
  }
  std::printf("};\n");
  return 0;
}
