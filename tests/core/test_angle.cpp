// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/sim/noise.hpp"

namespace tests::core_angle {

using namespace uwbpos;

TEST_CASE_TEMPLATE("an angle is wrapped into (-pi, pi]", S, float, double) {
  constexpr S pi = std::numbers::pi_v<S>;
  CHECK(wrap_angle(S(0)) == S(0));
  CHECK(wrap_angle(pi) == pi);
  CHECK(wrap_angle(-pi) == pi);
  CHECK(wrap_angle(S(1)) == S(1));
  CHECK(wrap_angle(S(-1)) == S(-1));
  // 2π as S is off by at most half an ulp of 2π, so is the remainder.
  const S ulp = 4 * std::numeric_limits<S>::epsilon();
  CHECK(std::abs(wrap_angle(2 * pi + S(0.5)) - S(0.5)) <= ulp);
  CHECK(std::abs(wrap_angle(-2 * pi - S(0.5)) + S(0.5)) <= ulp);
  sim::Random random{"wrap angle"};
  for (int i = 0; i < 1000; ++i) {
    const S angle = static_cast<S>(random.uniform(-1000, 1000));
    const S wrapped = wrap_angle(angle);
    CHECK(wrapped > -pi);
    CHECK(wrapped <= pi);
    CHECK(std::abs(std::remainder(wrapped - angle, 2 * pi)) < S(1e3) * ulp);
  }
}

TEST_CASE_TEMPLATE("a direction lies in (-pi, pi] with zeros of either sign", S, float, double) {
  constexpr S pi = std::numbers::pi_v<S>;
  CHECK(direction_of(S(-1), S(0)) == pi);
  CHECK(direction_of(S(-1), -S(0)) == pi);
  CHECK(direction_of(S(1), -S(0)) == S(0));
  CHECK(direction_of(S(0), S(-2)) == -pi / 2);
  CHECK(direction_of(S(-1), S(-1)) == doctest::Approx(-3 * static_cast<double>(pi) / 4));
}

TEST_CASE_TEMPLATE("what is no angle stays none", S, float, double) {
  CHECK(std::isnan(wrap_angle(std::numeric_limits<S>::quiet_NaN())));
  CHECK(std::isnan(wrap_angle(std::numeric_limits<S>::infinity())));
}

TEST_CASE_TEMPLATE("the difference of two angles takes the short way", S, float, double) {
  const S near_pi = S(3.1);
  const S ulps = 8 * std::numeric_limits<S>::epsilon();
  CHECK(std::abs(angle_difference(-near_pi, near_pi) - (2 * std::numbers::pi_v<S> - 2 * near_pi)) <
        ulps);
  CHECK(std::abs(radians_to_degrees(degrees_to_radians(S(123))) - S(123)) < 100 * ulps);
  CHECK(degrees_to_radians(S(180)) == std::numbers::pi_v<S>);
}

}  // namespace tests::core_angle
