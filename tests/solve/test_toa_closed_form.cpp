// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>

#include <doctest/doctest.h>

#include "uwbpos/solve/toa_closed_form.hpp"

#include "solve/solver_laws.hpp"

namespace tests::solve_toa_closed_form {

using namespace uwbpos;

namespace {

template <class S, int D>
double nearest(const Mirror<S, D>& images, const Vec<S, D>& tag) {
  return static_cast<double>(std::min((images.first - tag).norm(), (images.second - tag).norm()));
}

template <class S, int D>
void check_exactness(int fewest, bool ceiling) {
  sim::Random random{"closed form is exact"};
  for (int trial = 0; trial < 5000; ++trial) {
    const auto room = test::random_room<S, D>(random, fewest, 8, ceiling);
    const auto images = toa_closed_form(room.ranges);
    REQUIRE(images);
    // Squares of 25 m carry 64 ε · 25² m² of rounding at worst, and a root of q turns Δq into
    // Δq/2√q, the more so the lower the tag hangs: 2 cm in float. No polishing here.
    CHECK(nearest<S, D>(*images, room.tag) < (sizeof(S) == 4 ? 3e-2 : 1e-9));
  }
}

}  // namespace

TEST_CASE_TEMPLATE("closed form: one of the images is the tag", S, float, double) {
  check_exactness<S, 2>(2, false);
  check_exactness<S, 3>(3, false);
  check_exactness<S, 3>(3, true);
}

TEST_CASE_TEMPLATE("closed form: three anchors in the plane and four in space leave one answer", S,
                   float, double) {
  const std::vector<Vec<S, 2>> three{{1, 1}, {9, 2}, {3, 8}};
  const auto flat = toa_closed_form(test::ranges_between<S, 2>({6, 3}, three));
  REQUIRE(flat);
  CHECK(flat->first == flat->second);
  CHECK((flat->first - Vec<S, 2>{6, 3}).norm() < S(1e-4));
  const std::vector<Vec<S, 3>> four{{0, 0, 0}, {9, 0, 2}, {0, 8, 3}, {9, 8, 0}};
  const auto solid = toa_closed_form(test::ranges_between<S, 3>({6, 3, 1}, four));
  REQUIRE(solid);
  CHECK(solid->first == solid->second);
  CHECK((solid->first - Vec<S, 3>{6, 3, 1}).norm() < S(1e-4));
}

TEST_CASE_TEMPLATE("closed form: D anchors and flat arrays leave two images", S, float, double) {
  const std::vector<Vec<S, 2>> two{{0, 0}, {6, 0}};
  const auto pair = toa_closed_form(test::ranges_between<S, 2>({2, 3}, two));
  REQUIRE(pair);
  CHECK(nearest<S, 2>(*pair, {2, 3}) < 1e-5);
  CHECK(nearest<S, 2>(*pair, {2, -3}) < 1e-5);
  const std::vector<Vec<S, 3>> ceiling{{0, 0, 3}, {6, 0, 3}, {6, 8, 3}, {0, 8, 3}, {3, 4, 3}};
  const auto images = toa_closed_form(test::ranges_between<S, 3>({2, 3, 1}, ceiling));
  REQUIRE(images);
  CHECK(nearest<S, 3>(*images, {2, 3, 1}) < 1e-4);
  CHECK(nearest<S, 3>(*images, {2, 3, 5}) < 1e-4);
}

TEST_CASE_TEMPLATE("closed form: a root a little below zero is the plane itself", S, float,
                   double) {
  const std::vector<RangeTo<S, 2>> ranges{{{0, 0}, S(1.9)}, {{4, 0}, S(1.95)}};
  const auto images = toa_closed_form(ranges);
  REQUIRE(images);
  CHECK(images->first == images->second);
  CHECK(images->first[1] == S(0));
  CHECK(images->first[0] == doctest::Approx(2 - 0.025).epsilon(0.01));
}

TEST_CASE_TEMPLATE("closed form: circles that miss one another are refused", S, float, double) {
  using R = RangeTo<S, 2>;
  CHECK(toa_closed_form(std::array{R{{0, 0}, 1}, R{{10, 0}, 1}}).error() ==
        Error::InconsistentRanges);
  CHECK(toa_closed_form(std::array{R{{0, 0}, 9}, R{{1, 0}, 1}}).error() ==
        Error::InconsistentRanges);
}

TEST_CASE_TEMPLATE("closed form: what it cannot solve is refused by name", S, float, double) {
  // Laws of refusal are stated for fixes: the first image serves as one.
  const auto first = [](const auto& ranges) -> Result<Vec<S, 3>> {
    const auto images = toa_closed_form(ranges);
    if (!images) return std::unexpected(images.error());
    return images->first;
  };
  test::check_refusals<S, 3>(first);
  // In one line in space: a circle of answers.
  const std::vector<Vec<S, 3>> line{{0, 1, 2}, {1, 2, 3}, {2, 3, 4}, {4, 5, 6}};
  CHECK(toa_closed_form(test::ranges_between<S, 3>({3, 1, 1}, line)).error() ==
        Error::DegenerateGeometry);
}

}  // namespace tests::solve_toa_closed_form
