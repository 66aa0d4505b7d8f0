// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>
#include <doctest/doctest.h>

#include "uwbpos/core/covariance.hpp"

#include "support/random_geometry.hpp"

namespace tests::core_covariance {

using namespace uwbpos;

namespace {

template <class S>
Mat<S, 2> symmetric(S a, S b, S c) {
  Mat<S, 2> m;
  m << a, b, b, c;
  return m;
}

// The least eigenvalue of the correlations.
template <class S, int N>
double least_direction(const Mat<S, N>& p) {
  const Mat<double, N> exact = p.template cast<double>();
  const Vec<double, N> scale = exact.diagonal().cwiseSqrt().cwiseInverse();
  const Mat<double, N> correlations = scale.asDiagonal() * exact * scale.asDiagonal();
  return Eigen::SelfAdjointEigenSolver<Mat<double, N>>{correlations}.eigenvalues()[0];
}

}  // namespace

TEST_CASE_TEMPLATE("what is a covariance and what is not", S, float, double) {
  constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(looks_like_covariance<S, 2>(Mat<S, 2>::Zero()));
  CHECK(looks_like_covariance<S, 2>(symmetric<S>(4, 2, 1)));
  CHECK(looks_like_covariance<S, 2>(symmetric<S>(4, -2, 1)));
  CHECK_FALSE(looks_like_covariance<S, 2>(symmetric<S>(4, S(2.1), 1)));
  CHECK_FALSE(looks_like_covariance<S, 2>(symmetric<S>(4, S(-2.1), 1)));
  CHECK_FALSE(looks_like_covariance<S, 2>(symmetric<S>(-1, 0, 1)));
  CHECK_FALSE(looks_like_covariance<S, 2>(symmetric<S>(1, 0, -1)));
  CHECK_FALSE(looks_like_covariance<S, 2>(symmetric<S>(nan, 0, 1)));
  CHECK_FALSE(looks_like_covariance<S, 2>(symmetric<S>(1, nan, 1)));
  Mat<S, 2> skew = symmetric<S>(1, 0, 1);
  skew(0, 1) = S(0.1);
  CHECK_FALSE(looks_like_covariance<S, 2>(skew));
  // Each pair may be, the three may not: the first is like both others, they are unlike.
  Mat<S, 3> three;
  three << 1, S(0.9), S(1.8), S(0.9), 1, S(-1.8), S(1.8), S(-1.8), 4;
  CHECK_FALSE(looks_like_covariance<S, 3>(three));
  three(1, 2) = three(2, 1) = S(1.8);
  CHECK(looks_like_covariance<S, 3>(three));
  CHECK(looks_like_covariance<S, 3>(Mat<S, 3>::Ones()));
  CHECK(looks_like_covariance<S, 3>(Mat<S, 3>::Zero()));
  // A digit that is missing is forgiven.
  three << 2, S(1.415), 0, S(1.415), 1, 0, 0, 0, 1;
  CHECK(looks_like_covariance<S, 3>(three));
}

TEST_CASE_TEMPLATE("rounding is taken out of a covariance, the rest is left alone", S, float,
                   double) {
  const Mat<S, 2> sound = symmetric<S>(4, -1, 1);
  CHECK(without_rounding<S, 2>(sound) == sound);
  CHECK(without_rounding<S, 2>(symmetric<S>(4, S(2.001), 1)) == symmetric<S>(4, 2, 1));
  CHECK(without_rounding<S, 2>(symmetric<S>(4, S(-2.001), 1)) == symmetric<S>(4, -2, 1));
  CHECK(without_rounding<S, 2>(symmetric<S>(4, S(1e-9), S(-1e-9))) == symmetric<S>(4, 0, 0));
  Mat<S, 2> lower = sound;
  lower(0, 1) = S(7);  // not read
  CHECK(without_rounding<S, 2>(lower) == sound);
  CHECK(bounded<S>(3, 1, 2) == S(2));
  CHECK(bounded<S>(-3, 1, 2) == S(-2));
  CHECK(bounded<S>(1, 1, 2) == S(1));
}

TEST_CASE_TEMPLATE("correlations that contradict each other cost variance", S, float, double) {
  constexpr S epsilon = std::numeric_limits<S>::epsilon();
  Mat<S, 3> p = Mat<S, 3>::Identity() * S(4);
  raise_to_semidefinite<S, 3>(p);
  CHECK(p == Mat<S, 3>::Identity() * S(4));
  // The first is like both others, but they are unlike each other.
  p << 1, S(0.9), S(1.8), S(0.9), 1, S(-1.8), S(1.8), S(-1.8), 4;
  const Mat<S, 3> given = p;
  CHECK(least_direction<S, 3>(given) < -0.79);
  raise_to_semidefinite<S, 3>(p);
  CHECK(least_direction<S, 3>(p) > -8 * epsilon);
  CHECK((p - given).isDiagonal(0));
  CHECK((p - given).diagonal().minCoeff() >= 0);
  CHECK((p - given).trace() < S(8));  // the least is 4.8
  // What is nothing stays nothing.
  p << 1, 0, S(0.5), 0, 0, 0, S(0.5), 0, 1;
  const Mat<S, 3> with_zero = p;
  raise_to_semidefinite<S, 3>(p);
  CHECK(p == with_zero);
  p.setZero();
  raise_to_semidefinite<S, 3>(p);
  CHECK(p == Mat<S, 3>::Zero());
}

TEST_CASE_TEMPLATE("a sound covariance is not raised, a singular one by rounding only", S, float,
                   double) {
  constexpr S epsilon = std::numeric_limits<S>::epsilon();
  sim::Random random{"raised covariances"};
  S most = S(0);
  for (int trial = 0; trial < 2000; ++trial) {
    Mat<S, 6> root;
    for (int j = 0; j < 6; ++j) root.col(j) = test::random_in_cube<S, 6>(random, S(1));
    const Vec<S, 6> units = test::random_in_cube<S, 6>(random, S(7)).array().exp();
    Mat<S, 6> sound = root * root.transpose() + Mat<S, 6>::Identity() * S(0.01);
    sound = symmetric_from_lower<S, 6>(units.asDiagonal() * sound * units.asDiagonal());
    Mat<S, 6> raised = sound;
    raise_to_semidefinite<S, 6>(raised);
    CHECK(raised == sound);
    CHECK(looks_like_covariance<S, 6>(sound));

    // Of rank one to five, as a product of their factors leaves it.
    const int rank = 1 + trial % 5;
    Mat<S, 6> thin = root;
    thin.rightCols(6 - rank).setZero();
    const Mat<S, 6> flat = symmetric_from_lower<S, 6>(
        units.asDiagonal() * (thin * thin.transpose()) * units.asDiagonal());
    CHECK(looks_like_covariance<S, 6>(flat));
    raised = flat;
    raise_to_semidefinite<S, 6>(raised);
    CHECK(least_direction<S, 6>(raised) > -16 * epsilon);
    CHECK(looks_like_covariance<S, 6>(raised));
    CHECK((raised - flat).isDiagonal(0));
    const Vec<S, 6> added = (raised - flat).diagonal().cwiseQuotient(flat.diagonal());
    CHECK(added.minCoeff() >= 0);
    most = std::max(most, added.maxCoeff());
  }
  MESSAGE("raised by " << most << " at most");
  CHECK(most < std::sqrt(S(100) * epsilon));
}

TEST_CASE_TEMPLATE("small whole numbers make covariances of rank two", S, float, double) {
  // Exact, so that c² and d₁ d₂ of what is left after the first pivot differ by chance.
  int refused = 0;
  int all = 0;
  for (int code = 0; code < 117649; ++code) {
    Eigen::Matrix<S, 3, 2> j;
    int digits = code;
    for (int k = 0; k < 6; ++k) {
      j(k / 2, k % 2) = S(digits % 7 - 3);
      digits /= 7;
    }
    const Mat<S, 3> p = j * j.transpose();
    ++all;
    refused += looks_like_covariance<S, 3>(p) ? 0 : 1;
    const Mat<S, 3> raised = without_rounding<S, 3>(p);
    CHECK((raised - p).cwiseAbs().maxCoeff() <
          S(30) * std::sqrt(std::numeric_limits<S>::epsilon()));
  }
  CHECK(all == 117649);
  CHECK(refused == 0);
}

TEST_CASE_TEMPLATE("a variance that is infinite stays so", S, float, double) {
  constexpr S inf = std::numeric_limits<S>::infinity();
  const Mat<S, 3> p = without_rounding<S, 3>(Vec<S, 3>(inf, 1, 1).asDiagonal());
  CHECK(p(0, 0) == inf);
  CHECK(p(1, 1) == S(1));
  // What is as large as can be is not raised beyond.
  constexpr S most = std::numeric_limits<S>::max();
  Mat<S, 3> full = Mat<S, 3>::Constant(most);
  full(2, 1) = full(1, 2) = -most;
  raise_to_semidefinite<S, 3>(full);
  CHECK(full.diagonal() == Vec<S, 3>::Constant(most));
}

}  // namespace tests::core_covariance
