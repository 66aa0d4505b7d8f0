// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/solve/toa_least_squares.hpp"
#include "uwbpos/solve/toa_refine.hpp"

#include "solve/solver_laws.hpp"

namespace tests::solve_toa_refine {

using namespace uwbpos;

namespace {

// Position of what is diluted more is refused.
constexpr double kDilution = 8;

// Beside the middle of the rooms of `random_room`, metres from most tags.
template <class S, int D>
Vec<S, D> somewhere() {
  return Vec<S, D>::Constant(S(2.5));
}

template <class S, int D>
void check_exactness() {
  sim::Random random{"refinement is exact"};
  int refused = 0;
  for (int trial = 0; trial < 5000; ++trial) {
    const auto room = test::random_room<S, D>(random, D + 2, 10, false, kDilution);
    const Vec<S, D> start = room.tag + S(0.2) * test::random_direction<S, D>(random);
    const auto fix = toa_refine(room.ranges, start);
    if (!fix) {
      CHECK(fix.error() == Error::NotConverged);
      ++refused;
      continue;
    }
    // The last step is below 5e-3 sigma, 4 mm at GDOP 8, and what it leaves is about its square.
    CHECK(static_cast<double>((fix->position - room.tag).norm()) < test::exactness<S>() + 1e-5);
  }
  CHECK(refused <= 3);
}

// In noise the same minimum as the descent that is damped, and the same J there.
template <class S, int D>
void check_against_descent() {
  sim::Random random{"refinement beside the descent"};
  int refused = 0;
  int apart = 0;
  for (int trial = 0; trial < 5000; ++trial) {
    auto room = test::random_room<S, D>(random, D + 2, 10, false, kDilution);
    room.ranges = test::noisy<S, D>(random, room.ranges);
    const Vec<S, D> start = room.tag + S(0.5) * test::random_direction<S, D>(random);
    const auto fix = toa_refine(room.ranges, start);
    const auto descent = toa_least_squares(room.ranges, {.initial = start});
    REQUIRE(descent);
    if (!fix) {
      CHECK(fix.error() == Error::NotConverged);
      ++refused;
      continue;
    }
    const S sigma = std::sqrt(descent->covariance.trace());
    const S off = (fix->position - descent->position).norm() / sigma;
    if (off > S(2e-3)) ++apart;
    CHECK(off < S(0.05));
    CHECK((fix->covariance - descent->covariance).norm() < S(0.03) * descent->covariance.norm());
    CHECK(std::abs(fix->chi_squared - descent->chi_squared) < S(1e-3) * (descent->chi_squared + 1));
    CHECK(fix->degrees_of_freedom == descent->degrees_of_freedom);
  }
  CHECK(refused <= 5);
  CHECK(apart <= 50);
}

}  // namespace

TEST_CASE_TEMPLATE("refinement: exact ranges give the exact position", S, float, double) {
  check_exactness<S, 2>();
  check_exactness<S, 3>();
}

TEST_CASE_TEMPLATE("refinement: the minimum that a damped descent finds", S, float, double) {
  check_against_descent<S, 2>();
  check_against_descent<S, 3>();
}

TEST_CASE_TEMPLATE("refinement: the covariance predicts the errors", S, float, double) {
  test::check_consistency<S, 2>(
      [](const auto& ranges) { return toa_refine(ranges, Vec<S, 2>{4, 1}); },
      test::four_corners<S>(), Vec<S, 2>{3, 2}, 0.999);
}

TEST_CASE_TEMPLATE("refinement: what it cannot solve is refused by name", S, float, double) {
  test::check_refusals<S, 2>([](const auto& r) { return toa_refine(r, somewhere<S, 2>()); });
  test::check_refusals<S, 3>([](const auto& r) { return toa_refine(r, somewhere<S, 3>()); });

  const auto ranges = test::ranges_between<S, 2>({4, 3}, test::four_corners<S>());
  const S infinity = std::numeric_limits<S>::infinity();
  const S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(toa_refine(ranges, {infinity, 0}).error() == Error::NotFinite);
  CHECK(toa_refine(ranges, {0, nan}).error() == Error::NotFinite);
  // From where squares do not fit, and where all anchors lie in one direction: if at all, the tag.
  CHECK(toa_refine(ranges, {std::numeric_limits<S>::max(), 0}).error() == Error::NotConverged);
  if (const auto fix = toa_refine(ranges, {S(1e6), S(1e6)})) {
    CHECK((fix->position - Vec<S, 2>{4, 3}).norm() < S(1e-3));
  }
}

TEST_CASE_TEMPLATE("refinement: flat and few anchors will do, a metre below them", S, float,
                   double) {
  sim::Random random{"refinement below a ceiling"};
  int solved = 0;
  while (solved < 1000) {
    const auto room = test::random_room<S, 3>(random, 3, 10, true, kDilution);
    if (room.tag[2] > 2) continue;
    const Vec<S, 3> start = room.tag + S(0.1) * test::random_direction<S, 3>(random);
    const auto fix = toa_refine(room.ranges, start);
    REQUIRE(fix);
    CHECK(static_cast<double>((fix->position - room.tag).norm()) < test::exactness<S>() + 5e-5);
    ++solved;
  }
}

// Near the first anchor, which others are far from: rounding is relative to them, not to it.
TEST_CASE("refinement: sigmas near a float's rounding converge") {
  sim::Random random{"refinement of millimetres"};
  for (int trial = 0; trial < 1000; ++trial) {
    std::vector<RangeTo<float, 3>> ranges;
    const Vec<float, 3> tag = test::random_in_cube<float, 3>(random, 300);
    for (int i = 0; i < 8; ++i) {
      const Vec<float, 3> anchor = i == 0 ? Vec<float, 3>{tag + Vec<float, 3>{1, 0, 0}}
                                          : test::random_in_cube<float, 3>(random, 1000);
      ranges.push_back({anchor, (tag - anchor).norm(), 1e-4F});
    }
    const auto fix = toa_refine(ranges, tag + Vec<float, 3>{0.1F, 0.1F, -0.1F});
    if (!cramer_rao_bound(ranges, tag) || cramer_rao_bound(ranges, tag)->trace() > 1e-6F) continue;
    REQUIRE(fix);
    CHECK((fix->position - tag).norm() < 0.01F);
  }
}

}  // namespace tests::solve_toa_refine
