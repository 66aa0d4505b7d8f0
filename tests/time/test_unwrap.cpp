// SPDX-License-Identifier: MIT
#include <cstdint>

#include <doctest/doctest.h>

#include <uwbpos/sim/noise.hpp>
#include <uwbpos/time/unwrap.hpp>

namespace tests::time_unwrap {

namespace {

using namespace uwbpos;

template <unsigned Bits>
void check_recovers() {
  sim::Random random{"unwrap"};
  constexpr std::int64_t wrap = DeviceTime<Bits>::kWrap;
  for (int i = 0; i < 5000; ++i) {
    const DeviceTime<Bits> start{random.bits()};
    const auto truth =
        static_cast<std::int64_t>(random.uniform(1, 50.0 * static_cast<double>(wrap)));
    // The host is off by up to half a wrap, less a tick.
    const auto off =
        static_cast<std::int64_t>(random.uniform(-0.499, 0.499) * static_cast<double>(wrap));
    const std::int64_t host = truth + off > 0 ? truth + off : truth;
    const UnwrappedInterval run = unwrap_interval(start + truth, start, host);
    CHECK(run.nearest == truth);
    if (run.other) {
      CHECK((*run.other - truth == wrap || truth - *run.other == wrap));
      CHECK(run.other_mismatch >= wrap / 2);
      CHECK(run.other_mismatch == (*run.other > host ? *run.other - host : host - *run.other));
    }
  }
}

TEST_CASE("Whole wraps are told by a host that is off by less than half a wrap") {
  check_recovers<8>();
  check_recovers<32>();
  check_recovers<40>();
}

TEST_CASE("An interval is positive, even when the host saw next to none") {
  const DeviceTime<32> start{1000};
  CHECK(unwrap_interval(start + 4'000'000'000, start, 1).nearest == 4'000'000'000);
  CHECK_FALSE(unwrap_interval(start + 4'000'000'000, start, 1).other);
  // The counter stands where it stood: a whole wrap is the least.
  CHECK(unwrap_interval(start, start, 1).nearest == DeviceTime<32>::kWrap);
  CHECK_FALSE(unwrap_interval(start, start, 1).other);
}

}  // namespace

}  // namespace tests::time_unwrap
