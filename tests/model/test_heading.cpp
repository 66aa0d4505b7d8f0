// SPDX-License-Identifier: MIT
#include <cmath>

#include <doctest/doctest.h>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/model/heading.hpp"
#include "uwbpos/model/lever_arm.hpp"

#include "support/numeric_jacobian.hpp"
#include "support/random_geometry.hpp"

namespace tests::model_heading {

using namespace uwbpos;

TEST_CASE_TEMPLATE("heading: direction in plan and gradient by turns of the body", S, float,
                   double) {
  sim::Random random{"heading model"};
  for (int i = 0; i < 100; ++i) {
    Vec<S, 3> forward = test::random_direction<S, 3>(random);
    if (std::abs(forward[2]) > S(0.95)) continue;  // the gradient grows like 1/(1 − f_z²)
    const auto prediction = predict_heading<S>(forward);
    // Within the rounding of the library's own arctangent, which is the same on every processor.
    CHECK(std::abs(prediction.heading - std::atan2(forward[1], forward[0])) < S(5e-7));
    const auto turned = [&](const Vec<S, 3>& turn) {
      const Vec<S, 3> f = rotate<S>(quaternion_from_turn<S>(turn), forward);
      return angle_difference(std::atan2(f[1], f[0]), prediction.heading);
    };
    const Vec<S, 3> wanted = test::numeric_gradient<S, 3>(turned, Vec<S, 3>::Zero());
    // Central differences of a function whose third derivative is some ten.
    CHECK((prediction.gradient - wanted).norm() < test::difference_step<S>() * S(30));
  }
  const auto up = predict_heading<S>({S(0), S(0), S(1)});
  CHECK(up.heading == S(0));
  CHECK(up.gradient == Vec<S, 3>::Zero());
}

TEST_CASE_TEMPLATE("lever arm: gradients by turns of the body", S, float, double) {
  sim::Random random{"lever arm"};
  for (int i = 0; i < 100; ++i) {
    const Vec<S, 3> arm = test::random_in_cube<S, 3>(random, S(0.5));
    const Vec<S, 3> g = test::random_direction<S, 3>(random);
    const auto along = [&](const Vec<S, 3>& turn) {
      return g.dot(rotate<S>(quaternion_from_turn<S>(turn), arm));
    };
    const Vec<S, 3> wanted = test::numeric_gradient<S, 3>(along, Vec<S, 3>::Zero());
    CHECK((turn_gradient<S>(arm, g) - wanted).norm() < test::difference_step<S>() * S(3));
    CHECK(heading_gradient<S, 3>(arm, g) == turn_gradient<S>(arm, g)[2]);
  }
}

}  // namespace tests::model_heading
