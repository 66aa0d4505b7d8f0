// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include "uwbpos/model/range.hpp"

#include "support/numeric_jacobian.hpp"
#include "support/random_geometry.hpp"

namespace tests::model_range {

using namespace uwbpos;

namespace {

template <class S, int D>
void check_gradient() {
  sim::Random random{"range gradient"};
  // Central differences with step ε^(1/3) err by about ε^(2/3) for lengths of a few metres.
  const S step = test::difference_step<S>();
  for (int i = 0; i < 200; ++i) {
    const Vec<S, D> anchor = test::random_in_cube<S, D>(random, S(3));
    const Vec<S, D> position = anchor + S(2) * test::random_direction<S, D>(random);
    const auto predicted = predict_range(position, anchor);
    CHECK(predicted.range == doctest::Approx(2).epsilon(1e-6));
    const auto at = [&](const Vec<S, D>& p) { return predict_range(p, anchor).range; };
    const Vec<S, D> numeric = test::numeric_gradient<S, D>(at, position);
    CHECK((numeric - predicted.gradient).norm() < 20 * step * step);
  }
}

}  // namespace

TEST_CASE_TEMPLATE("the range's gradient agrees with central differences", S, float, double) {
  check_gradient<S, 2>();
  check_gradient<S, 3>();
}

TEST_CASE_TEMPLATE("at the anchor the range is zero and so is the gradient", S, float, double) {
  const Vec<S, 3> anchor{1, 2, 3};
  const auto predicted = predict_range(anchor, anchor);
  CHECK(predicted.range == S(0));
  CHECK(predicted.gradient == Vec<S, 3>::Zero());
}

}  // namespace tests::model_range
