// SPDX-License-Identifier: MIT
#include <limits>

#include <doctest/doctest.h>

#include <uwbpos/sim/noise.hpp>
#include <uwbpos/time/clock.hpp>

namespace tests::time_clock {

namespace {

using namespace uwbpos;

TEST_CASE_TEMPLATE("A clock's reading and the true time are inverse", S, float, double) {
  sim::Random random{"clock model"};
  for (int i = 0; i < 1000; ++i) {
    const Clock<S> clock{static_cast<S>(random.uniform(-10, 10)),
                         static_cast<S>(random.uniform(-40e-6, 40e-6))};
    const auto t = static_cast<S>(random.uniform(-100, 100));
    // A few roundings of numbers up to 110.
    CHECK(static_cast<double>(true_time(clock, clock_reading(clock, t))) ==
          doctest::Approx(static_cast<double>(t))
              .epsilon(1e-6)
              .scale(110.0 * (sizeof(S) == 4 ? 1 : 1e-8)));
  }
}

TEST_CASE_TEMPLATE("A clock of rate e shows (1 + e) seconds a second", S, float, double) {
  const Clock<S> clock{S(3), S(0.25)};
  CHECK(clock_reading(clock, S(0)) == S(3));
  CHECK(clock_reading(clock, S(8)) == S(13));
  CHECK(true_time(clock, S(13)) == S(8));
}

TEST_CASE_TEMPLATE("The relative rate is what one clock counts in the other's time", S, float,
                   double) {
  const Clock<S> a{S(5), S(0.25)};
  const Clock<S> b{S(-2), S(0.5)};
  const S counted_a = clock_reading(a, S(16)) - clock_reading(a, S(0));
  const S counted_b = clock_reading(b, S(16)) - clock_reading(b, S(0));
  CHECK(static_cast<double>(relative_rate(b, a)) ==
        doctest::Approx(static_cast<double>((counted_b - counted_a) / counted_a)));
  CHECK(relative_rate(a, a) == 0);
}

}  // namespace

}  // namespace tests::time_clock
