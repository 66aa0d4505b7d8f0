// SPDX-License-Identifier: MIT
#include <cstdint>

#include <doctest/doctest.h>

#include <uwbpos/time/phase_window.hpp>

namespace tests::time_phase_window {
namespace {

using namespace uwbpos;

constexpr double kTicksPerSecond = 128 * 499.2e6;

TEST_CASE_TEMPLATE("Phase window: the rate lies within, whatever the host's lag", S, float,
                   double) {
  for (const double rate : {2e-6, -2e-6, 60e-6}) {
    for (const double seconds : {0.5, 3.0, 16.0}) {
      for (const double late : {-1.9, -0.3, 0.0, 1.9}) {
        const double told = seconds + late;  // host time may run ahead or behind by the lag
        if (told <= 0) continue;
        PhaseWindow<S> window;
        window.start(77);
        window.add(static_cast<std::int64_t>(rate * seconds * kTicksPerSecond));
        const auto host = 77 + static_cast<std::int64_t>(told * 1e6);
        const auto bounds = window.bounds(host, 2'000'000, S(80e-6), S(1e-10));
        CHECK(bounds.admit(S(rate)));
        CHECK(static_cast<double>(bounds.middle) ==
              doctest::Approx(rate * seconds / told).epsilon(1e-5));
      }
    }
  }
}

TEST_CASE("Phase window: after some lags a rate that a wrong wrap scaled lies outside") {
  PhaseWindow<double> window;
  window.start(0);
  window.add(static_cast<std::int64_t>(2e-6 * 4.5 * kTicksPerSecond));
  const auto bounds = window.bounds(4'500'000, 2'000'000, 80e-6, 1e-10);
  CHECK(window.length(4'500'000) == 4'500'000);
  CHECK_FALSE(bounds.admit(2e-6 * 98.87 / 166.1));
  CHECK_FALSE(bounds.admit(2e-6 * 98.87 / 31.7));
  CHECK_FALSE(bounds.admit(-2e-6));
}

TEST_CASE("Phase window: bounds of a short window reach to the limit, on the phase's side") {
  PhaseWindow<double> window;
  window.start(0);
  window.add(-1000);
  const auto bounds = window.bounds(1'000'000, 2'000'000, 80e-6, 0.0);
  CHECK(bounds.low == -80e-6);
  CHECK(bounds.high < 0);
}

}  // namespace
}  // namespace tests::time_phase_window
