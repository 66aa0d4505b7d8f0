// SPDX-License-Identifier: MIT
#include <set>
#include <string>

#include <doctest/doctest.h>

#include "uwbpos/core/result.hpp"

namespace tests::core_result {

using namespace uwbpos;

TEST_CASE("every error is described in its own words") {
  std::set<std::string> seen;
  for (int i = 0; i < kErrorCount; ++i) {
    const std::string words{describe(static_cast<Error>(i))};
    CAPTURE(i);
    CHECK(words.size() > 10);
    CHECK(words != "unknown error");
    CHECK(seen.insert(words).second);
  }
}

TEST_CASE("a value that is no error is still described") {
  CHECK(describe(static_cast<Error>(kErrorCount)) == "unknown error");
  CHECK(describe(static_cast<Error>(255)) == "unknown error");
}

TEST_CASE("descriptions are available at compile time") {
  static_assert(!describe(Error::AmbiguousSolution).empty());
  static_assert(sizeof(Error) == 1);
}

}  // namespace tests::core_result
