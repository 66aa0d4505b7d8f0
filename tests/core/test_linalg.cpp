// SPDX-License-Identifier: MIT
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/core/linalg.hpp"

#include "support/random_geometry.hpp"

namespace tests::core_linalg {

using namespace uwbpos;

namespace {

template <class S, int D>
void check_factorisation(sim::Random& random) {
  // A = B Bᵀ + I has a condition number below 1 + |B|², so a few hundred ulps suffice.
  const S tolerance = S(500) * std::numeric_limits<S>::epsilon();
  for (int trial = 0; trial < 100; ++trial) {
    Mat<S, D> b;
    for (int i = 0; i < D; ++i) b.col(i) = test::random_in_cube<S, D>(random, S(1));
    const Mat<S, D> a = b * b.transpose() + Mat<S, D>::Identity();
    Mat<S, D> lower = a.template triangularView<Eigen::Lower>();
    lower(0, D - 1) = std::numeric_limits<S>::quiet_NaN();  // the upper part must not be read
    const Ldlt<S, D> factor{lower};
    REQUIRE(factor.positive_definite());
    const Vec<S, D> x = test::random_in_cube<S, D>(random, S(1));
    CHECK((factor.solve(a * x) - x).norm() < tolerance);
    const Mat<S, D> inverse = factor.inverse();
    CHECK((a * inverse - Mat<S, D>::Identity()).norm() < tolerance);
    CHECK(inverse == inverse.transpose());
  }
}

}  // namespace

TEST_CASE_TEMPLATE("LDLT solves and inverts positive definite matrices", S, float, double) {
  sim::Random random{"ldlt"};
  check_factorisation<S, 2>(random);
  check_factorisation<S, 3>(random);
  check_factorisation<S, 4>(random);
  check_factorisation<S, 6>(random);
}

TEST_CASE_TEMPLATE("LDLT knows what is not positive definite", S, float, double) {
  CHECK_FALSE(Ldlt<S, 3>{Vec<S, 3>(S(5), S(5), S(0)).asDiagonal()}.positive_definite());
  CHECK_FALSE(Ldlt<S, 3>{Vec<S, 3>(S(5), S(-5), S(5)).asDiagonal()}.positive_definite());
  CHECK_FALSE(Ldlt<S, 2>{Mat<S, 2>::Zero()}.positive_definite());
  CHECK_FALSE(Ldlt<S, 2>{Mat<S, 2>::Ones()}.positive_definite());
  Mat<S, 2> bad = Mat<S, 2>::Identity();
  bad(1, 0) = std::numeric_limits<S>::quiet_NaN();
  CHECK_FALSE(Ldlt<S, 2>{bad}.positive_definite());
  bad(1, 0) = 0;
  bad(0, 0) = std::numeric_limits<S>::quiet_NaN();
  CHECK_FALSE(Ldlt<S, 2>{bad}.positive_definite());
  // Rank two of three, in a direction that no axis shows.
  sim::Random random{"rank two"};
  for (int i = 0; i < 100; ++i) {
    const Vec<S, 3> a = test::random_direction<S, 3>(random);
    const Vec<S, 3> b = test::random_direction<S, 3>(random);
    const Mat<S, 3> flat = a * a.transpose() + b * b.transpose();
    CHECK_FALSE(Ldlt<S, 3>{flat}.positive_definite());
  }
}

TEST_CASE_TEMPLATE("small products are what they say", S, float, double) {
  const Vec<S, 3> a{1, 2, 3};
  const Vec<S, 3> b{4, -5, 6};
  CHECK(dot(a, b) == S(12));
  CHECK(squared_norm(a) == S(14));
  CHECK(norm(Vec<S, 2>{3, 4}) == S(5));
  Mat<S, 3> sum = Mat<S, 3>::Zero();
  add_outer(sum, a, S(2));
  CHECK(symmetric_from_lower(sum) == Mat<S, 3>{S(2) * a * a.transpose()});
  CHECK(all_finite(a));
  CHECK_FALSE(all_finite(Vec<S, 2>{S(1), std::numeric_limits<S>::infinity()}));
  CHECK_FALSE(all_finite(Vec<S, 2>{std::numeric_limits<S>::quiet_NaN(), S(1)}));
}

}  // namespace tests::core_linalg
