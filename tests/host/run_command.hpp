// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The host command, called by a test.

#include <string>
#include <vector>

#include <command_line.hpp>

namespace uwbpos::test {

/// What `uwbpos WORDS` exits with.
inline int run_with(std::vector<std::string> words) {
  words.insert(words.begin(), "uwbpos");
  std::vector<const char*> argv;
  for (const std::string& word : words) argv.push_back(word.c_str());
  return host::run(static_cast<int>(argv.size()), argv.data());
}

}  // namespace uwbpos::test
