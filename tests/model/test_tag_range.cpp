// SPDX-License-Identifier: MIT
#include <array>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/accuracy/pose_bound.hpp"

#include "support/numeric_jacobian.hpp"
#include "support/random_geometry.hpp"

namespace tests::model_tag_range {

using namespace uwbpos;

namespace {

template <class S, int D>
void check_gradient() {
  sim::Random random{"tag range gradient"};
  // Central differences with step ε^(1/3) err by about ε^(2/3) for lengths of a few metres.
  const S step = test::difference_step<S>();
  for (int i = 0; i < 100; ++i) {
    const Vec<S, D> arm = test::random_in_cube<S, D>(random, S(1));
    Vec<S, D + 1> pose = test::random_in_cube<S, D + 1>(random, S(3));
    const auto at = [&](const Vec<S, D + 1>& x, const Vec<S, D>& anchor) {
      return predict_tag_range<S, D>(x.template head<D>(), turn_of(x[D]), arm, anchor);
    };
    const Vec<S, D> none = Vec<S, D>::Zero();
    const Vec<S, D> tag = pose.template head<D>() + at(pose, none).arm;
    const Vec<S, D> anchor = tag + S(2) * test::random_direction<S, D>(random);
    const auto predicted = at(pose, anchor);
    CHECK(predicted.range == doctest::Approx(2).epsilon(1e-5));
    const Vec<S, D + 1> numeric = test::numeric_gradient<S, D + 1>(
        [&](const Vec<S, D + 1>& x) { return at(x, anchor).range; }, pose);
    Vec<S, D + 1> written;
    for (int k = 0; k < D; ++k) written[k] = predicted.gradient[k];
    written[D] = predicted.heading_gradient;
    CHECK((numeric - written).norm() < S(30) * step * step);
  }
}

}  // namespace

TEST_CASE_TEMPLATE("the gradient of a tag's range agrees with central differences", S, float,
                   double) {
  check_gradient<S, 2>();
  check_gradient<S, 3>();
}

TEST_CASE_TEMPLATE("a tag on its anchor has no direction, and a turn leaves heights alone", S,
                   float, double) {
  const Turn<S> left{S(0), S(1)};
  const Vec<S, 3> arm{2, 0, S(0.5)};
  CHECK(turned<S, 3>(left, arm) == Vec<S, 3>{0, 2, S(0.5)});
  const auto on_anchor = predict_tag_range<S, 3>({1, 1, 1}, left, arm, {1, 3, S(1.5)});
  CHECK(on_anchor.range == S(0));
  CHECK(on_anchor.gradient == Vec<S, 3>::Zero());
  CHECK(on_anchor.heading_gradient == S(0));
}

TEST_CASE_TEMPLATE("bound of two tags amid four anchors: σ²/4 each way and σ²/d²", S, float,
                   double) {
  // Far anchors on the axes: J = Σ g gᵀ/σ² gives each tag 2/σ² I, the pose 4/σ² I, and the heading
  // Σ (g·r')²/σ² = 2 · 2 (d/2)²/σ² = d²/σ².
  std::vector<TagRange<S, 2>> ranges;
  const S far = S(1e4);
  for (const S side : {S(1), S(-1)}) {
    for (const Vec<S, 2>& anchor :
         {Vec<S, 2>{far, 0}, Vec<S, 2>{-far, 0}, Vec<S, 2>{0, far}, Vec<S, 2>{0, -far}}) {
      ranges.push_back({{0, side * S(0.3)}, anchor, S(0)});
    }
  }
  const auto bound = pose_bound(ranges, {0, 0}, S(0.8));
  REQUIRE(bound);
  CHECK((*bound)(0, 0) == doctest::Approx(0.01 / 4).epsilon(1e-3));
  CHECK((*bound)(1, 1) == doctest::Approx(0.01 / 4).epsilon(1e-3));
  CHECK((*bound)(2, 2) == doctest::Approx(0.01 / 0.36).epsilon(1e-3));
  CHECK(*bound == bound->transpose());
}

TEST_CASE_TEMPLATE("a bound that does not exist is refused by name", S, float, double) {
  constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  using R = TagRange<S, 2>;
  const auto error = [](const std::vector<R>& ranges, S heading = S(0)) {
    const auto bound = pose_bound(ranges, {1, 2}, heading);
    REQUIRE_FALSE(bound);
    return bound.error();
  };
  const std::vector<R> one_tag{{{0, 1}, {0, 0}, 0}, {{0, 1}, {9, 0}, 0}, {{0, 1}, {0, 9}, 0}};
  CHECK(error({}) == Error::TooFewMeasurements);
  CHECK(error(one_tag) == Error::DegenerateGeometry);
  CHECK(error(one_tag, nan) == Error::NotFinite);
  auto bad = one_tag;
  bad[1].sigma = 0;
  CHECK(error(bad) == Error::NonPositiveSigma);
  bad[1].lever_arm[0] = nan;
  CHECK(error(bad) == Error::NotFinite);
}

}  // namespace tests::model_tag_range
