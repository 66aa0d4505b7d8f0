// SPDX-License-Identifier: MIT
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/ranging/ultrasonic.hpp"

namespace tests::ranging_ultrasonic {

using namespace uwbpos;

TEST_CASE_TEMPLATE("speed of sound: the paper's value, and back", S, float, double) {
  // (003) prints 345.70 m/s at 24 °C and 0.8643 cm.
  CHECK(std::abs(*speed_of_sound(S(24)) - S(345.70)) < S(0.005));
  CHECK(std::abs(*ultrasonic_wavelength(S(24)) - S(0.008643)) < S(5e-7));
  CHECK(*speed_of_sound(S(0)) == S(331.45));
  for (S celsius = S(-60); celsius <= S(70); celsius += S(6.5)) {
    const auto back = temperature_from_speed_of_sound(*speed_of_sound(celsius));
    REQUIRE(back);
    // An ulp of the speed, 1.5e-5 m/s in float, is 2.5e-5 K; a few of them.
    CHECK(std::abs(*back - celsius) < (sizeof(S) == 4 ? S(2e-4) : S(1e-11)));
  }
}

TEST_CASE_TEMPLATE("speed of sound: what air does not have is refused by name", S, float, double) {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const S infinity = std::numeric_limits<S>::infinity();
  for (const S value : {nan, infinity, -infinity}) {
    CHECK(speed_of_sound(value).error() == Error::NotFinite);
    CHECK(temperature_from_speed_of_sound(value).error() == Error::NotFinite);
    CHECK(ultrasonic_wavelength(S(20), value).error() == Error::NotFinite);
  }
  for (const S celsius : {S(-274), S(-60.1), S(70.1), S(1e6)}) {
    CHECK(speed_of_sound(celsius).error() == Error::TemperatureOutOfRange);
    CHECK(ultrasonic_wavelength(celsius).error() == Error::TemperatureOutOfRange);
    CHECK(ultrasonic_length<S>(1000, {.temperature = celsius}).error() ==
          Error::TemperatureOutOfRange);
  }
  for (const S speed : {S(0), S(-345), S(290), S(380), S(1e30)}) {
    CHECK(temperature_from_speed_of_sound(speed).error() == Error::TemperatureOutOfRange);
  }
  CHECK(ultrasonic_wavelength(S(20), S(0)).error() == Error::InvalidOption);
}

TEST_CASE_TEMPLATE("ultrasonic length: count, delay and variance", S, float, double) {
  // The first count of (003), table 1: 0x2D2E thirds of a microsecond.
  const auto plain = ultrasonic_length<S>(0x2D2E);
  REQUIRE(plain);
  CHECK(std::abs(plain->value - S(1.33280)) < S(1e-5));
  const S tick = *speed_of_sound(S(24)) / S(3e6);
  CHECK(plain->variance == doctest::Approx(static_cast<double>(tick * tick / 12)).epsilon(1e-5));
  const auto delayed = ultrasonic_length<S>(0x2D2E, {.circuit_delay = S(20e-6)});
  CHECK(std::abs(plain->value - delayed->value - S(20e-6) * S(345.704)) < S(1e-6));
  const auto noisy = ultrasonic_length<S>(0x2D2E, {.sigma_time = S(1e-6)});
  CHECK(noisy->variance - plain->variance ==
        doctest::Approx(345.704e-6 * 345.704e-6).epsilon(1e-4));
  // A kelvin of doubt, by a difference: 2.2 mm of 1.33 m.
  const auto unsure = ultrasonic_length<S>(0x2D2E, {.sigma_temperature = S(1)});
  const S by_kelvin = (ultrasonic_length<S>(0x2D2E, {.temperature = S(24.5)})->value -
                       ultrasonic_length<S>(0x2D2E, {.temperature = S(23.5)})->value);
  CHECK(std::sqrt(unsure->variance) ==
        doctest::Approx(static_cast<double>(by_kelvin)).epsilon(1e-3));
}

TEST_CASE_TEMPLATE("ultrasonic length: what cannot be is refused by name", S, float, double) {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(ultrasonic_length<S>(1000, {.tick = nan}).error() == Error::NotFinite);
  CHECK(ultrasonic_length<S>(1000, {.temperature = nan}).error() == Error::NotFinite);
  CHECK(ultrasonic_length<S>(1000, {.tick = S(0)}).error() == Error::InvalidOption);
  CHECK(ultrasonic_length<S>(1000, {.circuit_delay = S(-1e-6)}).error() == Error::InvalidOption);
  CHECK(ultrasonic_length<S>(1000, {.max_length = S(0)}).error() == Error::InvalidOption);
  CHECK(ultrasonic_length<S>(1000, {.sigma_time = S(-1)}).error() == Error::NonPositiveSigma);
  CHECK(ultrasonic_length<S>(0).error() == Error::NegativeTimeOfFlight);
  CHECK(ultrasonic_length<S>(3, {.circuit_delay = S(2e-6)}).error() == Error::NegativeTimeOfFlight);
  CHECK(ultrasonic_length<S>(0xffffffff).error() == Error::RangeBeyondMaximum);
  const S huge = std::numeric_limits<S>::max();
  CHECK(ultrasonic_length<S>(1000, {.sigma_time = huge}).error() == Error::NumericOverflow);
  CHECK(ultrasonic_length<S>(1000, {.sigma_temperature = huge}).error() == Error::NumericOverflow);
  const S slow = std::numeric_limits<S>::denorm_min();
  CHECK(ultrasonic_wavelength<S>(S(24), slow).error() == Error::NumericOverflow);
}

}  // namespace tests::ranging_ultrasonic
