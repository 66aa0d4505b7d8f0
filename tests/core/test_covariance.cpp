// SPDX-License-Identifier: MIT
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/core/covariance.hpp"

namespace tests::core_covariance {

using namespace uwbpos;

namespace {

template <class S>
Mat<S, 2> symmetric(S a, S b, S c) {
  Mat<S, 2> m;
  m << a, b, b, c;
  return m;
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

}  // namespace tests::core_covariance
