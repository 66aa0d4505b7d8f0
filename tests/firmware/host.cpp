// SPDX-License-Identifier: MIT
// Runs every case on the host and writes its inputs and outputs as a header for the target.
#include <cstdio>
#include <vector>

#include "entry.hpp"
#include "units.hpp"

namespace {

void print_table(const char* symbol, const char* what, const std::vector<firmware::Word>& words) {
  std::printf("inline constexpr firmware::Word %s_%s[] = {", symbol, what);
  for (std::size_t i = 0; i < words.size(); ++i) {
    std::printf("%s0x%08xu,", i % 8 == 0 ? "\n" : "", static_cast<unsigned>(words[i]));
  }
  std::printf("};\n");
}

// A target uses those of its units, and has no others in its flash.
void print_unit(const char* unit, std::span<const firmware::Entry> entries) {
  for (const firmware::Entry& entry : entries) {
    std::vector<firmware::Word> inputs;
    std::vector<firmware::Word> outputs;
    entry.record(entry.symbol, inputs, outputs);
    print_table(entry.symbol, "inputs", inputs);
    print_table(entry.symbol, "outputs", outputs);
  }
  std::printf("inline constexpr firmware::Recording k_%s[] = {\n", unit);
  for (const firmware::Entry& entry : entries) {
    std::printf("{\"%s\", %d, %s_inputs, %s_outputs},\n", entry.symbol, entry.rounds, entry.symbol,
                entry.symbol);
  }
  std::printf("};\n");
}

}  // namespace

int main() {
  std::printf("// Written by tests/firmware/host.cpp.\n");
#define FIRMWARE_PRINT(unit) print_unit(#unit, firmware::unit::entries());
  FIRMWARE_UNITS(FIRMWARE_PRINT)
  return 0;
}
