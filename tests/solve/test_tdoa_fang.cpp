// SPDX-License-Identifier: MIT
#include <algorithm>
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/solve/tdoa_fang.hpp"

#include "solve/difference_rooms.hpp"

namespace tests::solve_tdoa_fang {

using namespace uwbpos;

namespace {

template <class S, int D>
void check_exactness() {
  sim::Random random{"fang is exact"};
  int twice = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const auto [tag, anchors] = test::random_difference_room<S, D>(random, D + 1, D + 1, 10);
    if (anchors.size() != static_cast<std::size_t>(D + 1)) continue;  // the square and the cube
    const auto room = test::differences_between<S, D>(tag, anchors);
    const auto both = tdoa_fang(room.reference, room.differences);
    REQUIRE(both);
    const auto error =
        static_cast<double>(std::min((both->first - tag).norm(), (both->second - tag).norm()));
    // Squares of 25 m over the root of a discriminant that may nearly vanish; unpolished.
    CHECK(error < (sizeof(S) == 4 ? 5e-2 : 1e-8));
    twice += both->first == both->second ? 0 : 1;
    // The other answer explains the differences as well.
    const Vec<S, D> other =
        (both->first - tag).norm() < (both->second - tag).norm() ? both->second : both->first;
    if (sizeof(S) == 8 && other.norm() < S(1e3)) {
      for (const auto& d : room.differences) {
        const S difference = test::true_difference<S, D>(other, room.reference, d.anchor);
        CHECK(std::abs(difference - d.difference) < S(1e-6));
      }
    }
  }
  CHECK(twice > 100);
}

}  // namespace

TEST_CASE_TEMPLATE("Fang: one of the two roots is the tag, both explain it", S, float, double) {
  check_exactness<S, 2>();
  check_exactness<S, 3>();
}

TEST_CASE_TEMPLATE("Fang: what it cannot solve is refused by name", S, float, double) {
  using Difference = DifferenceTo<S, 2>;
  const Vec<S, 2> origin{0, 0};
  const auto error = [&](const std::vector<Difference>& d) {
    const auto both = tdoa_fang(origin, d);
    REQUIRE_FALSE(both);
    return both.error();
  };
  const S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(error({{{5, 0}, 1}}) == Error::TooFewMeasurements);
  CHECK(error({{{5, 0}, 1}, {{0, 5}, 1}, {{5, 5}, 1}}) == Error::TooManyMeasurements);
  CHECK(error({{{5, 0}, nan}, {{0, 5}, 1}}) == Error::NotFinite);
  CHECK(error({{{5, nan}, 1}, {{0, 5}, 1}}) == Error::NotFinite);
  CHECK(error({{{5, 0}, 6}, {{0, 5}, 1}}) == Error::ImpossibleDifference);
  CHECK(error({{{5, 0}, 1}, {{5, 0}, 1}}) == Error::DegenerateGeometry);
  CHECK(error({{{0, 0}, 0}, {{0, 0}, 0}}) == Error::DegenerateGeometry);
}

}  // namespace tests::solve_tdoa_fang
