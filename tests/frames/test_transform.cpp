// SPDX-License-Identifier: MIT
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/frames/transform.hpp"

#include "frames/scenes.hpp"
#include "support/numeric_jacobian.hpp"
#include "support/statistics.hpp"

namespace tests::frames_transform {

using namespace uwbpos;

namespace {

// Coordinates reach 150 m and each passes through a dozen roundings.
template <class S>
constexpr S kLength = S(150 * 12) * std::numeric_limits<S>::epsilon();

template <class S, int D>
void check_same(const Transform<S, D>& a, const Transform<S, D>& b, S scale = S(1)) {
  CHECK((a.rotation - b.rotation).cwiseAbs().maxCoeff() <=
        S(20) * std::numeric_limits<S>::epsilon());
  CHECK((a.translation - b.translation).cwiseAbs().maxCoeff() <= scale * kLength<S>);
  // Lever arms of up to 100 m and back: a variance of θ times 1e4, which cancels.
  CHECK((a.covariance - b.covariance).cwiseAbs().maxCoeff() <=
        S(1e4 * 50 * 0.01) * std::numeric_limits<S>::epsilon());
}

template <class S, int D>
void laws(sim::Random& random) {
  for (int trial = 0; trial < 100; ++trial) {
    const auto a_T_b = test::random_transform<S, D>(random);
    const auto b_T_c = test::random_transform<S, D>(random);
    const auto c_T_d = test::random_transform<S, D>(random);
    const Vec<S, D> p_c = test::random_in_cube<S, D>(random, S(50));

    const auto a_T_c = compose(a_T_b, b_T_c);
    CHECK((apply(a_T_c, p_c) - apply(a_T_b, apply(b_T_c, p_c))).norm() <= kLength<S>);
    CHECK((apply(inverse(a_T_c), apply(a_T_c, p_c)) - p_c).norm() <= S(2) * kLength<S>);

    check_same(inverse(inverse(a_T_b)), a_T_b);
    check_same(compose(a_T_b, Transform<S, D>{}), a_T_b);
    check_same(compose(Transform<S, D>{}, a_T_b), a_T_b);
    check_same(compose(compose(a_T_b, b_T_c), c_T_d), compose(a_T_b, compose(b_T_c, c_T_d)), S(2));
    check_same(inverse(compose(a_T_b, b_T_c)), compose(inverse(b_T_c), inverse(a_T_b)), S(2));
    CHECK(test::rotation_defect<S, D>(a_T_c.rotation) <
          16 * static_cast<double>(std::numeric_limits<S>::epsilon()));

    CHECK(a_T_c.covariance == a_T_c.covariance.transpose());
    CHECK(exact(a_T_c).covariance.isZero(0));
    CHECK(exact(a_T_c).rotation == a_T_c.rotation);
    CHECK(exact(a_T_c).translation == a_T_c.translation);
  }
}

template <class S, int D>
void fix_laws(sim::Random& random) {
  const auto a_T_b = test::random_transform<S, D>(random);
  Fix<S, D> fix{};
  fix.position = test::random_in_cube<S, D>(random, S(20));
  fix.covariance = test::random_covariance<S, D>(random, 0.02, 0.3);
  fix.chi_squared = S(3.5);
  fix.degrees_of_freedom = 4;
  const Fix<S, D> moved = apply(a_T_b, fix);
  CHECK(moved.chi_squared == S(3.5));
  CHECK(moved.degrees_of_freedom == 4);
  CHECK(moved.covariance == moved.covariance.transpose());
  // A motion without error turns the covariance and keeps its size.
  const Fix<S, D> turned = apply(exact(a_T_b), fix);
  CHECK(turned.position == moved.position);
  CHECK(static_cast<double>(turned.covariance.trace()) ==
        doctest::Approx(static_cast<double>(fix.covariance.trace())).epsilon(1e-5));
  const Fix<S, D> back = apply(exact(inverse(a_T_b)), turned);
  CHECK((back.covariance - fix.covariance).norm() <
        S(100) * std::numeric_limits<S>::epsilon() * fix.covariance.norm());
  // Its own error only ever adds.
  CHECK(moved.covariance.trace() > turned.covariance.trace());
}

// Derivatives by the transforms themselves, moved by small ξ, in double.
template <int D>
void jacobians(sim::Random& random) {
  constexpr int N = kTransformDof<D>;
  const auto a_T_b = exact(test::random_transform<double, D>(random));
  const auto b_T_c = exact(test::random_transform<double, D>(random));
  const Vec<double, D> p = test::random_in_cube<double, D>(random, 20.0);
  const Vec<double, N> zero = Vec<double, N>::Zero();
  // Central differences of lengths of 100 m: truncation and rounding stay below 1e-7.
  const auto point = test::numeric_jacobian<D, double, N>(
      [&](const Vec<double, N>& xi) { return apply(test::perturbed<D>(a_T_b, xi), p); }, zero);
  CHECK((point - point_jacobian(a_T_b, p)).cwiseAbs().maxCoeff() < 1e-7);

  const Mat<double, N> sigma = test::random_covariance<double, N>(random, 0.01, 0.1);
  const auto with = [&](Transform<double, D> t) {
    t.covariance = sigma;
    return t;
  };
  const auto numeric = [&](auto&& moved, const Transform<double, D>& at) {
    const auto j = test::numeric_jacobian<N, double, N>(
        [&](const Vec<double, N>& xi) { return test::error_of<D>(moved(xi), at); }, zero);
    return Mat<double, N>{j * sigma * j.transpose()};
  };
  const auto ac = compose(a_T_b, b_T_c);
  const Mat<double, N> first =
      numeric([&](const auto& xi) { return compose(test::perturbed<D>(a_T_b, xi), b_T_c); }, ac);
  CHECK((first - compose(with(a_T_b), b_T_c).covariance).norm() < 1e-6 * first.norm());
  const Mat<double, N> second =
      numeric([&](const auto& xi) { return compose(a_T_b, test::perturbed<D>(b_T_c, xi)); }, ac);
  CHECK((second - compose(a_T_b, with(b_T_c)).covariance).norm() < 1e-6 * second.norm());
  const Mat<double, N> inverted = numeric(
      [&](const auto& xi) { return inverse(test::perturbed<D>(a_T_b, xi)); }, inverse(a_T_b));
  CHECK((inverted - inverse(with(a_T_b)).covariance).norm() < 1e-6 * inverted.norm());
}

// Mean and covariance of 20,000 draws against the claim: an entry's sampling error is about
// √(2/20000) = 1 % of the entries' size, so that 5 % is five deviations.
template <class S, int D>
void monte_carlo(sim::Random& random) {
  constexpr int N = kTransformDof<D>;
  constexpr int draws = 20000;
  auto a_T_b = test::random_transform<S, D>(random);
  // Angles of 1.5 deg: the second order, θ²/2 of 20 m, is 7 mm against errors of 0.5 m.
  a_T_b.covariance = test::random_covariance<S, N>(random, 0.01, 0.03);
  Fix<S, D> fix{};
  fix.position = test::random_in_cube<S, D>(random, S(20));
  fix.covariance = test::random_covariance<S, D>(random, 0.1, 0.3);
  const Mat<double, D> claimed = apply(a_T_b, fix).covariance.template cast<double>();
  const auto estimate = test::in_double(a_T_b);
  Mat<double, D> sum = Mat<double, D>::Zero();
  for (int k = 0; k < draws; ++k) {
    const Vec<double, N> xi = test::draw<N>(random, estimate.covariance);
    const Vec<double, D> noise =
        test::draw<D>(random, Mat<double, D>{fix.covariance.template cast<double>()});
    const Vec<double, D> at = fix.position.template cast<double>();
    const Vec<double, D> error =
        apply(test::perturbed<D>(estimate, xi), Vec<double, D>{at + noise}) - apply(estimate, at);
    sum += error * error.transpose();
  }
  const Mat<double, D> seen = sum / draws;
  CHECK((seen - claimed).norm() < 0.05 * claimed.norm());
}

}  // namespace

TEST_CASE_TEMPLATE("transforms form a group, covariances included", S, float, double) {
  sim::Random random{"transform group"};
  laws<S, 2>(random);
  laws<S, 3>(random);
}

TEST_CASE_TEMPLATE("a fix is turned with its covariance", S, float, double) {
  sim::Random random{"transformed fix"};
  for (int trial = 0; trial < 100; ++trial) {
    fix_laws<S, 2>(random);
    fix_laws<S, 3>(random);
  }
}

TEST_CASE("every covariance is propagated by the derivative that central differences find") {
  sim::Random random{"transform jacobians"};
  for (int trial = 0; trial < 50; ++trial) {
    jacobians<2>(random);
    jacobians<3>(random);
  }
}

TEST_CASE_TEMPLATE("a transformed fix errs as its covariance says", S, float, double) {
  sim::Random random{"transform monte carlo"};
  for (int trial = 0; trial < 5; ++trial) {
    monte_carlo<S, 2>(random);
    monte_carlo<S, 3>(random);
  }
}

TEST_CASE_TEMPLATE("an error of yaw grows into metres with the distance", S, float, double) {
  Transform<S, 2> map_T_subnet;
  map_T_subnet.translation = {100, 50};
  map_T_subnet.covariance(2, 2) = S(0.01 * 0.01);
  Fix<S, 2> fix{};
  fix.position = {0, 0};
  fix.covariance.setZero();
  CHECK(apply(map_T_subnet, fix).covariance.isZero(0));
  fix.position = {20, 0};
  const Mat<S, 2> far = apply(map_T_subnet, fix).covariance;
  CHECK(far(1, 1) == doctest::Approx(0.2 * 0.2));
  CHECK(far(0, 0) == S(0));
}

}  // namespace tests::frames_transform
