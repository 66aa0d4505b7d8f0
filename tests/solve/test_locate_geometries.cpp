// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/solve/locate.hpp"

#include "solve/rooms.hpp"

namespace tests::solve_locate_geometries {

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
    auto room = test::random_room<S, D>(random, fewest, most, ceiling);
    // The data are exact whatever their sigma says; a float must not mind a small one.
    const double sigmas[] = {0.1, 0.03, 0.01, 0.003};
    for (auto& r : room.ranges) r.sigma = S(sigmas[i % 4]);
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

// Long corridors with the tag up to 20 m beyond their ends, where ranges are nearly parallel.
template <class S>
void check_corridors() {
  sim::Random random{"corridors"};
  int wrong = 0;
  int not_converged = 0;
  for (int i = 0; i < 20000;) {
    test::Room<S, 2> room;
    room.tag = {S(random.uniform(-20, 120)), S(random.uniform(-6, 10))};
    const int n = random.integer(4, 7);
    for (int k = 0; k < n; ++k) {
      const Vec<S, 2> anchor{S(random.uniform(0, 100)), S(random.uniform(0, 4))};
      room.ranges.push_back({anchor, test::true_range<S, 2>(room.tag, anchor), S(0.03)});
    }
    if (!(test::dilution(room) < 20)) continue;
    ++i;
    const auto fix = locate(room.ranges);
    if (!fix) {
      not_converged += fix.error() == Error::AmbiguousSolution ? 0 : 1;
      continue;
    }
    wrong += (fix->position - room.tag).norm() > (sizeof(S) == 4 ? S(5e-2) : S(1e-3)) ? 1 : 0;
  }
  CHECK(wrong == 0);
  CHECK(not_converged == 0);
}

}  // namespace

TEST_CASE_TEMPLATE("no wrong answer in corridors, nor beyond their ends", S, float, double) {
  check_corridors<S>();
}

TEST_CASE("a float does not answer the mirror image of a corridor's tag") {
  using R = RangeTo<float, 2>;
  const std::vector<R> ranges{{{67.0618134f, 0.603820443f}, 101.133034f, 0.0334792286f},
                              {{39.3470154f, 4.70484018f}, 75.1495056f, 0.0336178318f},
                              {{50.9230957f, 1.39452541f}, 85.4524918f, 0.0236450266f},
                              {{39.9962845f, 3.46306705f}, 75.4463501f, 0.0204361491f},
                              {{114.5672f, 0.231159925f}, 148.018234f, 0.020400241f}};
  std::vector<RangeTo<double, 2>> exact;
  for (const R& r : ranges) {
    exact.push_back(
        {r.anchor.cast<double>(), static_cast<double>(r.range), static_cast<double>(r.sigma)});
  }
  const auto expected = locate(exact);
  REQUIRE(expected);
  const auto fix = locate(ranges);
  REQUIRE(fix);
  CHECK((fix->position.cast<double>() - expected->position).norm() < 0.05);
}

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

}  // namespace tests::solve_locate_geometries
