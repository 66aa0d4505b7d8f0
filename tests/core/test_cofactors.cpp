// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/core/cofactors.hpp"
#include "uwbpos/core/wide.hpp"

#include "support/random_geometry.hpp"

namespace tests::core_cofactors {

using namespace uwbpos;

namespace {

template <class S, int D>
Lower<S, D> lower(const Mat<S, D>& a) {
  Lower<S, D> result;
  for (int j = 0; j < D; ++j) {
    for (int i = j; i < D; ++i) result[lower_index<D>(i, j)] = a(i, j);
  }
  return result;
}

template <class S, int D>
Mat<S, D> positive_definite(sim::Random& random) {
  Mat<S, D> b;
  for (int i = 0; i < D; ++i) b.col(i) = test::random_in_cube<S, D>(random, S(1));
  return b * b.transpose() + Mat<S, D>::Identity();
}

template <class S, int D>
void check_inverse(sim::Random& random) {
  const S tolerance = S(500) * std::numeric_limits<S>::epsilon();
  for (int trial = 0; trial < 200; ++trial) {
    const Mat<S, D> a = positive_definite<S, D>(random);
    const Lower<S, D> all = lower<S, D>(a);
    const auto of_a = cofactors<S, D>(all);
    CHECK(bool(is_well_conditioned<S, S, D>(all, of_a)));
    const Vec<S, D> x = test::random_in_cube<S, D>(random, S(1));
    Numbers<S, D> ax;
    for (int i = 0; i < D; ++i) ax[i] = (a * x)[i];
    const Numbers<S, D> back = times<S, D>(of_a.adjugate, ax);
    for (int i = 0; i < D; ++i) CHECK(std::abs(back[i] / of_a.determinant - x[i]) < tolerance);
    CHECK(std::abs(trace_of<S, D>(all) - a.trace()) < tolerance * a.trace());
  }
}

template <class S, int D>
void check_refusals(sim::Random& random) {
  for (int trial = 0; trial < 200; ++trial) {
    Mat<S, D> a = positive_definite<S, D>(random);
    const auto refused = [&] {
      const Lower<S, D> all = lower<S, D>(a);
      return !is_well_conditioned<S, S, D>(all, cofactors<S, D>(all));
    };
    CHECK_FALSE(refused());
    // Of one rank less; negative; indefinite with a positive determinant; not a number.
    a.col(0) = a.col(1);
    a.row(0) = a.row(1);
    CHECK(refused());
    a = -positive_definite<S, D>(random);
    CHECK(refused());
    a = positive_definite<S, D>(random);
    a(0, 0) = std::numeric_limits<S>::quiet_NaN();
    CHECK(refused());
    a.setIdentity();
    a(0, 0) = a(1, 1) = S(-1);
    CHECK(refused());
  }
}

/// A matrix of one rank less that came of subtraction: what it was subtracted from tells.
template <class S, int D>
void check_subtraction(sim::Random& random) {
  int unseen = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Mat<S, D> moment = Mat<S, D>::Zero();
    Vec<S, D> mean = Vec<S, D>::Zero();
    for (int i = 0; i < D; ++i) {
      const Vec<S, D> p = test::random_in_cube<S, D>(random, S(1)) + Vec<S, D>::Constant(S(20));
      moment += p * p.transpose();
      mean += p / S(D);
    }
    const Lower<S, D> a = lower<S, D>(moment - S(D) * mean * mean.transpose());
    const auto of_a = cofactors<S, D>(a);
    Numbers<S, D> terms;
    for (int i = 0; i < D; ++i) terms[i] = moment(i, i);
    CHECK_FALSE(bool(is_well_conditioned<S, S, D>(a, of_a, terms)));
    unseen += is_well_conditioned<S, S, D>(a, of_a) ? 1 : 0;
  }
  CHECK(unseen > 0);
}

// Of rank two, one of both far weaker: rounding of its products looks like a determinant.
template <class S>
void check_graded() {
  sim::Random random{"graded"};
  for (int trial = 0; trial < 5000; ++trial) {
    const Vec<S, 3> strong = test::random_direction<S, 3>(random);
    const S ratio = S(std::pow(10.0, random.uniform(-4, 0)));
    const Vec<S, 3> weak = strong + ratio * test::random_direction<S, 3>(random);
    Mat<S, 3> a = Mat<S, 3>::Zero();
    add_outer<S, 3>(a, strong, S(400));
    add_outer<S, 3>(a, weak, S(100));
    const Lower<S, 3> all = lower<S, 3>(a);
    CHECK_FALSE(bool(is_well_conditioned<S, S, 3>(all, cofactors<S, 3>(all))));
  }
}

template <class S>
void check_lanes() {
  sim::Random random{"lanes"};
  Lower<Wide<S>, 3> many;
  std::array<Lower<S, 3>, kLanes<S>> each;
  for (std::size_t l = 0; l < kLanes<S>; ++l) {
    each[l] = lower<S, 3>(positive_definite<S, 3>(random));
    for (int k = 0; k < 6; ++k) many[k][l] = each[l][k];
  }
  const auto of_many = cofactors<Wide<S>, 3>(many);
  const Wide<S> roots = square_root(many[0]);
  for (std::size_t l = 0; l < kLanes<S>; ++l) {
    const auto of_one = cofactors<S, 3>(each[l]);
    const S tolerance = S(100) * std::numeric_limits<S>::epsilon() * of_one.determinant;
    CHECK(std::abs(of_many.determinant[l] - of_one.determinant) <= tolerance);
    CHECK(roots[l] == std::sqrt(each[l][0]));
  }
  CHECK(is_certain(is_well_conditioned<S, Wide<S>, 3>(many, of_many)));
  many[0][kLanes<S> - 1] = S(-1);
  CHECK_FALSE(is_certain(is_well_conditioned<S, Wide<S>, 3>(many, cofactors<Wide<S>, 3>(many))));
}

}  // namespace

TEST_CASE_TEMPLATE("cofactors invert well-conditioned matrices", S, float, double) {
  sim::Random random{"cofactors"};
  check_inverse<S, 2>(random);
  check_inverse<S, 3>(random);
}

TEST_CASE_TEMPLATE("cofactors refuse what elimination refuses", S, float, double) {
  sim::Random random{"cofactors refuse"};
  check_refusals<S, 2>(random);
  check_refusals<S, 3>(random);
  check_subtraction<S, 2>(random);
  check_subtraction<S, 3>(random);
}

TEST_CASE_TEMPLATE("cofactors see a rank that is missing beside one that is weak", S, float,
                   double) {
  check_graded<S>();
}

TEST_CASE_TEMPLATE("lanes of a register are as many numbers", S, float, double) {
  check_lanes<S>();
}

}  // namespace tests::core_cofactors
