// SPDX-License-Identifier: MIT
#include <cmath>

#include <doctest/doctest.h>

#include <uwbpos/sim/instant.hpp>
#include <uwbpos/sim/noise.hpp>

namespace tests::sim_instant {

namespace {

using uwbpos::sim::Instant;
using uwbpos::sim::to_seconds;

TEST_CASE("A picosecond is a picosecond after thirty years") {
  const Instant late{1'000'000'000, 0.999'999};
  const Instant later = late + 1e-12;
  // One rounding of a fraction below one: 1.1e-16 s of 1e-12 s.
  CHECK(std::abs((later - late) - 1e-12) < 1.2e-16);
}

TEST_CASE("Instants carry into seconds and borrow from them") {
  constexpr Instant a{10, 0.75};
  static_assert(a + 0.5 == Instant{11, 0.25});
  static_assert(a + 3.0 == Instant{13, 0.75});
  static_assert(a + (-1.0) == Instant{9, 0.75});
  static_assert(a + (-11.0) == Instant{-1, 0.75});
  static_assert(a + 1.25 == Instant{12, 0.0});
  static_assert(Instant{0, 0.25} + (-0.5) == Instant{-1, 0.75});
  static_assert((Instant{3, 0.25} - Instant{1, 0.75}) == 1.5);
  static_assert(to_seconds(Instant{-2, 0.5}) == -1.5);
  // A duration too small to borrow by does not leave a fraction of one.
  constexpr Instant just_below = Instant{5, 0.0} + (-1e-30);
  static_assert(just_below.fraction < 1);
  static_assert(just_below == Instant{5, 0.0});
}

TEST_CASE("Going there and back again loses nothing that a radio could see") {
  uwbpos::sim::Random random{"instants"};
  for (int i = 0; i < 20000; ++i) {
    const Instant a{random.integer(-1000000, 1000000), random.uniform()};
    const double duration = random.uniform(-20, 20);
    const Instant b = a + duration;
    REQUIRE(b.fraction >= 0);
    REQUIRE(b.fraction < 1);
    // Two roundings at 20 s (1.8e-15 each) and two of fractions: 0.004 ps.
    CHECK(std::abs((b - a) - duration) < 4e-15);
    CHECK(std::abs((b + -duration) - a) < 4e-15);
  }
}

}  // namespace

}  // namespace tests::sim_instant
