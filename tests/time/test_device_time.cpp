// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <limits>

#include <doctest/doctest.h>

#include <uwbpos/sim/noise.hpp>
#include <uwbpos/time/device_time.hpp>

namespace tests::time_device_time {

namespace {

using uwbpos::DeviceTime;

static_assert(DeviceTime<>::kBits == 40);
static_assert(DeviceTime<40>{1} - DeviceTime<40>{0xff'ffff'ffff} == 2);
static_assert(DeviceTime<32>{0} - DeviceTime<32>{1} == -1);
static_assert(DeviceTime<8>{256}.ticks() == 0);
static_assert(DeviceTime<>{} == DeviceTime<>{0});

template <unsigned Bits>
void check_laws() {
  using Time = DeviceTime<Bits>;
  uwbpos::sim::Random random{"device time"};
  for (int i = 0; i < 2000; ++i) {
    const Time start{random.bits()};
    const std::int64_t ticks =
        static_cast<std::int64_t>(random.bits() >> (65 - Bits)) * (random.chance(0.5) ? 1 : -1);
    CHECK((start + ticks) - start == ticks);
    CHECK(start - (start + ticks) == -ticks);
    CHECK((start + ticks) - ticks == start);
    CHECK((start - ticks) == (start + -ticks));
  }
}

TEST_CASE("Differences below half the range survive any number of wraps") {
  check_laws<8>();
  check_laws<32>();
  check_laws<40>();
  check_laws<62>();
}

TEST_CASE("Half the range has no sign and comes out negative") {
  const DeviceTime<> start{12345};
  CHECK((start + DeviceTime<>::kHalfWrap) - start == -DeviceTime<>::kHalfWrap);
  CHECK(start - (start + DeviceTime<>::kHalfWrap) == -DeviceTime<>::kHalfWrap);
  CHECK((start + (DeviceTime<>::kHalfWrap - 1)) - start == DeviceTime<>::kHalfWrap - 1);
}

TEST_CASE("Bits above the counter's are dropped") {
  CHECK(DeviceTime<>{0xabcd'ef01'2345'6789}.ticks() == 0x01'2345'6789);
  CHECK(DeviceTime<32>{0xffff'ffff'ffff'ffff}.ticks() == 0xffff'ffff);
}

}  // namespace

TEST_CASE_TEMPLATE("whole numbers of a scalar become integers exactly", S, float, double) {
  for (const S whole : {S(0), S(1), S(-1), S(16777216), S(-16777218), S(1073741824.0),
                        S(-1073741824.0), S(4294967296.0), S(-6.4e7), S(1099511627776.0),
                        S(-1099511758848.0), S(2305843009213693952.0), S(-2.3e17f)}) {
    CHECK(static_cast<S>(uwbpos::integer_ticks(whole)) == whole);
    CHECK(uwbpos::integer_ticks(whole) == static_cast<std::int64_t>(whole));
  }
}

TEST_CASE_TEMPLATE("a fraction of a tick is dropped", S, float, double) {
  CHECK(uwbpos::integer_ticks(S(3.75)) == 3);
  CHECK(uwbpos::integer_ticks(S(-3.75)) == -3);
  CHECK(uwbpos::integer_ticks(S(1e6) + S(0.5)) == 1'000'000);
}

TEST_CASE_TEMPLATE("ticks as a scalar are those that it can hold, or within an epsilon of it", S,
                   float, double) {
  uwbpos::sim::Random random{"scalar ticks"};
  const auto unit = static_cast<long double>(std::numeric_limits<S>::epsilon());
  for (int i = 0; i < 100'000; ++i) {
    const auto ticks = static_cast<std::int64_t>(random.bits()) >> (2 + random.bits() % 62);
    const auto exact = static_cast<long double>(ticks);
    const auto scalar = uwbpos::scalar_ticks<S>(ticks);
    REQUIRE(std::abs(static_cast<long double>(scalar) - exact) <= unit * std::abs(exact));
    if (static_cast<std::int64_t>(static_cast<S>(ticks)) == ticks) {
      REQUIRE(scalar == static_cast<S>(ticks));
    }
  }
  CHECK(uwbpos::scalar_ticks<S>(0) == 0);
  CHECK(uwbpos::scalar_ticks<S>(-1) == -1);
}

}  // namespace tests::time_device_time
