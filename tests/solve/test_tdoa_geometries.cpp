// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include "uwbpos/solve/locate.hpp"

#include "solve/difference_rooms.hpp"

namespace tests::solve_tdoa_geometries {

using namespace uwbpos;

namespace {

template <class S, int D>
void check_rooms(const char* name, int fewest, int most) {
  sim::Random random{name};
  constexpr int kRooms = 100000;
  int wrong = 0;
  int ambiguous = 0;
  int otherwise = 0;
  double worst = 0;
  for (int i = 0; i < kRooms; ++i) {
    const auto [tag, anchors] = test::random_difference_room<S, D>(random, fewest, most);
    const auto room = test::differences_between<S, D>(tag, anchors);
    const auto fix = locate(room.reference, room.differences, S(0.1));
    if (!fix) {
      ++(fix.error() == Error::AmbiguousSolution ? ambiguous : otherwise);
      continue;
    }
    const double error = (fix->position - tag).template cast<double>().norm();
    worst = std::max(worst, error);
    wrong += error > (sizeof(S) == 4 ? 5e-2 : 1e-3) ? 1 : 0;
  }
  MESSAGE(std::string{name}, ": worst ", worst, " m, refused as ambiguous ", ambiguous, " of ",
          kRooms);
  CHECK(wrong == 0);
  CHECK(otherwise == 0);
  if (sizeof(S) == 4) {
    CHECK(ambiguous < kRooms / 1000);
  } else {
    CHECK(ambiguous == 0);
  }
}

}  // namespace

TEST_CASE("TDOA: no wrong answer in 100,000 rooms, double") {
  check_rooms<double, 2>("differences in the plane, 4 to 8 anchors", 4, 8);
  check_rooms<double, 3>("differences in space, 5 to 8 anchors", 5, 8);
}

TEST_CASE("TDOA: no wrong answer in 100,000 rooms, float") {
  check_rooms<float, 2>("differences in the plane, 4 to 8 anchors", 4, 8);
  check_rooms<float, 3>("differences in space, 5 to 8 anchors", 5, 8);
}

}  // namespace tests::solve_tdoa_geometries
