// SPDX-License-Identifier: MIT

/// @file
/// Drives a fuzzer without libFuzzer: every kept input as it is, then `count` that are mutated or
/// made up, the same ones in every run.
///   replay CORPUS_DIR COUNT

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "uwbpos/sim/noise.hpp"

#include "bytes.hpp"

namespace {

using Input = std::vector<std::uint8_t>;

std::vector<Input> read_inputs(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator{folder}) {
    if (entry.is_regular_file()) paths.push_back(entry.path());
  }
  std::ranges::sort(paths);
  std::vector<Input> inputs;
  for (const auto& path : paths) {
    std::ifstream file{path, std::ios::binary};
    inputs.emplace_back(std::istreambuf_iterator<char>{file}, std::istreambuf_iterator<char>{});
  }
  return inputs;
}

Input made_up(uwbpos::sim::Random& random) {
  Input input(static_cast<std::size_t>(random.integer(0, 300)));
  for (auto& byte : input) byte = static_cast<std::uint8_t>(random.bits());
  return input;
}

Input mutated(Input input, uwbpos::sim::Random& random) {
  const int changes = random.integer(1, 4);
  for (int i = 0; i < changes && !input.empty(); ++i) {
    const int last = static_cast<int>(input.size()) - 1;
    const auto at = static_cast<std::size_t>(random.integer(0, last));
    if (random.chance(0.1)) {
      input.resize(at);
    } else {
      input[at] = static_cast<std::uint8_t>(random.bits());
    }
  }
  return input;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: replay CORPUS_DIR COUNT\n", stderr);
    return 2;
  }
  const std::vector<Input> inputs = read_inputs(argv[1]);
  const int count = std::stoi(argv[2]);
  if (inputs.empty()) {
    std::fprintf(stderr, "no inputs in %s\n", argv[1]);
    return 1;
  }
  for (const Input& input : inputs) LLVMFuzzerTestOneInput(input.data(), input.size());
  uwbpos::sim::Random random{"fuzz replay"};
  for (int i = 0; i < count; ++i) {
    const int last = static_cast<int>(inputs.size()) - 1;
    const auto seed = static_cast<std::size_t>(random.integer(0, last));
    const Input input = random.chance(0.2) ? made_up(random) : mutated(inputs[seed], random);
    LLVMFuzzerTestOneInput(input.data(), input.size());
  }
  std::printf("%zu kept inputs, %d more\n", inputs.size(), count);
  return 0;
}
