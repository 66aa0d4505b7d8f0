// SPDX-License-Identifier: MIT
#include <cmath>

#include <doctest/doctest.h>

#include "uwbpos/solve/locate.hpp"

#include "solve/rooms.hpp"

using namespace uwbpos;

namespace {

// 100,000 noiseless rooms of GDOP < 20. No answer may be off by more than 1 mm in double and 5 cm
// in float; what is refused must be the mirror image that float digits cannot rule out, and rare.
template <class S, int D>
void check_rooms(const char* name, int fewest, int most, bool ceiling) {
  sim::Random random{name};
  constexpr int kRooms = 100000;
  int wrong = 0;
  int ambiguous = 0;
  int otherwise = 0;
  double worst = 0;
  for (int i = 0; i < kRooms; ++i) {
    const auto room = test::random_room<S, D>(random, fewest, most, ceiling);
    LocateOptions<S, D> options;
    if (ceiling) options.side[D - 1] = S(-1);
    const auto fix = locate(room.ranges, options);
    if (!fix) {
      ++(fix.error() == Error::AmbiguousSolution ? ambiguous : otherwise);
      continue;
    }
    const double error = (fix->position - room.tag).template cast<double>().norm();
    worst = std::max(worst, error);
    wrong += error > (sizeof(S) == 4 ? 5e-2 : 1e-3) ? 1 : 0;
  }
  MESSAGE(name, ": worst ", worst, " m, refused as ambiguous ", ambiguous, " of ", kRooms);
  CHECK(wrong == 0);
  CHECK(otherwise == 0);
  if (sizeof(S) == 4) {
    CHECK(ambiguous < kRooms / 1000);
  } else {
    CHECK(ambiguous == 0);
  }
}

}  // namespace

TEST_CASE("no wrong answer in 100,000 rooms, double") {
  check_rooms<double, 2>("plane, 3 to 8 anchors", 3, 8, false);
  check_rooms<double, 3>("space, 4 to 8 anchors", 4, 8, false);
  check_rooms<double, 3>("ceiling, 3 to 8 anchors", 3, 8, true);
}

TEST_CASE("no wrong answer in 100,000 rooms, float") {
  check_rooms<float, 2>("plane, 3 to 8 anchors", 3, 8, false);
  check_rooms<float, 3>("space, 4 to 8 anchors", 4, 8, false);
  check_rooms<float, 3>("ceiling, 3 to 8 anchors", 3, 8, true);
}
