// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A case as the programs see it that run all of them.

#include <cstddef>
#include <cstdint>
#include <span>
#ifndef FIRMWARE_TARGET
#include <vector>
#endif

namespace firmware {

using Word = std::uint32_t;

/// What the host has recorded of a case.
struct Recording {
  const char* symbol;
  int rounds;
  const Word* inputs;
  const Word* outputs;
};

/// What a case did. `different`: words that are not as recorded.
struct Outcome {
  int words = 0;
  int different = 0;
  std::uint32_t most_instructions = 0;
  std::uint32_t mean_instructions = 0;
  std::uint32_t stack = 0;
};

/// A case as the programs know it.
struct Entry {
  const char* symbol;  ///< of the function to call
  int rounds;
#ifdef FIRMWARE_TARGET
  Outcome (*check)(const Recording&);
#else
  void (*record)(const char* symbol, std::vector<Word>& inputs, std::vector<Word>& outputs);
#endif
};

/// Takes an input, makes an output.
using Function = void (*)(const void* input, void* output);

#ifdef FIRMWARE_TARGET

/// What a call took.
struct Cost {
  std::uint32_t instructions;
  std::uint32_t stack;
};

/// Calls `function(input, output)`, once or, to count finer than a tick, many times.
Cost measure(Function function, const void* input, void* output, bool once);

#endif

}  // namespace firmware
