// SPDX-License-Identifier: MIT
#include <array>
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/solve/bancroft.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/tdoa_chan.hpp"
#include "uwbpos/solve/tdoa_fang.hpp"

#include "solve/difference_rooms.hpp"
#include "support/statistics.hpp"

namespace tests::solve_tdoa_least_squares {

using namespace uwbpos;

namespace {

template <class S>
std::vector<Vec<S, 2>> hall() {
  return {{0, 0}, {10, 0}, {10, 8}, {0, 8}, {5, 8}};
}

template <class S, int D>
void check_reference_does_not_matter() {
  sim::Random random{"any reference"};
  for (int trial = 0; trial < 200; ++trial) {
    const auto [tag, anchors] = test::random_difference_room<S, D>(random, D + 3, 8, 5);
    std::vector<double> arrivals;
    for (const auto& a : anchors) {
      arrivals.push_back((tag - a).template cast<double>().norm() + random.normal(0, 0.1));
    }
    Result<Fix<S, D>> first = std::unexpected(Error::NotConverged);
    for (std::size_t r = 0; r < anchors.size(); ++r) {
      std::vector<DifferenceTo<S, D>> differences;
      for (std::size_t i = 0; i < anchors.size(); ++i) {
        if (i != r) differences.push_back({anchors[i], S(arrivals[i] - arrivals[r])});
      }
      const auto fix = locate(anchors[r], differences, S(0.1));
      REQUIRE(fix);
      if (!first) first = fix;
      // The same minimum: an iteration stops within a ten-thousandth of a deviation of it, and
      // float noise adds as much as in the laws of ranges.
      const double spread = std::sqrt(static_cast<double>(first->covariance.trace()));
      CHECK(static_cast<double>((fix->position - first->position).norm()) <
            10 * test::exactness<S>() + 1e-3 * spread);
      CHECK(static_cast<double>(fix->chi_squared) ==
            doctest::Approx(static_cast<double>(first->chi_squared)).epsilon(2e-2));
    }
  }
}

}  // namespace

TEST_CASE_TEMPLATE("TDOA: the choice of reference does not change the answer", S, float, double) {
  check_reference_does_not_matter<S, 2>();
  check_reference_does_not_matter<S, 3>();
}

TEST_CASE_TEMPLATE("TDOA: a tag where all differences are equal is located", S, float, double) {
  const std::vector<Vec<S, 2>> square{{0, 0}, {8, 0}, {8, 8}, {0, 8}};
  const auto room = test::differences_between<S, 2>({4, 4}, square);
  const auto fix = locate(room.reference, room.differences, S(0.1));
  REQUIRE(fix);
  CHECK((fix->position - Vec<S, 2>{4, 4}).norm() < S(1e-4));
  // By symmetry: Σ (g − ḡ)(g − ḡ)ᵀ = 2 I over four anchors on the diagonals.
  CHECK(fix->covariance(0, 0) == doctest::Approx(0.005).epsilon(0.01));
  const auto chan = tdoa_chan(room.reference, room.differences, S(0.1));
  REQUIRE(chan);
  CHECK((chan->position - Vec<S, 2>{4, 4}).norm() < S(1e-4));
}

TEST_CASE_TEMPLATE("TDOA: what cannot be is refused by name", S, float, double) {
  const auto room = test::differences_between<S, 2>({4, 3}, hall<S>());
  const auto error = [&](const auto& change, S sigma = S(0.1)) {
    auto differences = room.differences;
    change(differences);
    const auto fix = locate(room.reference, differences, sigma);
    REQUIRE_FALSE(fix);
    return fix.error();
  };
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const auto nothing = [](auto&) {};
  CHECK(error([](auto& d) { d.clear(); }) == Error::TooFewMeasurements);
  CHECK(error([](auto& d) { d.resize(1); }) == Error::TooFewMeasurements);
  CHECK(error([](auto& d) { d.resize(65, d[0]); }) == Error::TooManyMeasurements);
  CHECK(error([&](auto& d) { d[1].difference = nan; }) == Error::NotFinite);
  CHECK(error([&](auto& d) { d[1].anchor[0] = -std::numeric_limits<S>::infinity(); }) ==
        Error::NotFinite);
  CHECK(error(nothing, nan) == Error::NotFinite);
  CHECK(error(nothing, S(0)) == Error::NonPositiveSigma);
  CHECK(error(nothing, S(-1)) == Error::NonPositiveSigma);
  // Baseline 10 m: beyond it by 5 √2 σ = 0.71 m is noise, by more is impossible.
  CHECK(error([](auto& d) { d[0].difference = S(10.8); }) == Error::ImpossibleDifference);
  CHECK(error([](auto& d) { d[0].difference = S(-10.8); }) == Error::ImpossibleDifference);
  CHECK(error([](auto& d) {
          for (auto& x : d) x.anchor = Vec<S, 2>::Zero(), x.difference = 0;
        }) == Error::DegenerateGeometry);
  LocateOptions<S, 2> options;
  options.side = {nan, 0};
  CHECK(locate(room.reference, room.differences, S(0.1), options).error() == Error::NotFinite);
}

TEST_CASE_TEMPLATE("TDOA: the fewest anchors may leave two answers, which a prior settles", S,
                   float, double) {
  // Behind a corner anchor the hyperbolas meet twice.
  const std::vector<Vec<S, 2>> three{{0, 0}, {10, 0}, {2, 9}};
  sim::Random random{"two hyperbolas"};
  int ambiguous = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Vec<S, 2> tag = test::random_in_box<S, 2>(random, {-4, -4}, {12, 12});
    if (test::difference_dilution<S, 2>(tag, three) > 10) continue;
    const auto room = test::differences_between<S, 2>(tag, three);
    const auto fix = locate(room.reference, room.differences, S(0.01), {.prior = tag});
    REQUIRE(fix);
    CHECK((fix->position - tag).norm() < S(1e-3));
    const auto alone = locate(room.reference, room.differences, S(0.01));
    if (!alone) {
      CHECK(alone.error() == Error::AmbiguousSolution);
      ++ambiguous;
    } else {
      CHECK((alone->position - tag).norm() < S(1e-3));
    }
  }
  CHECK(ambiguous > 20);
  CHECK(ambiguous < 250);
}

TEST_CASE_TEMPLATE("TDOA: anchors on one ceiling need a side", S, float, double) {
  const std::vector<Vec<S, 3>> ceiling{{0, 0, 3}, {10, 0, 3}, {10, 8, 3}, {0, 8, 3}, {4, 3, 3}};
  const Vec<S, 3> tag{3, 5, 1};
  const auto room = test::differences_between<S, 3>(tag, ceiling);
  CHECK(locate(room.reference, room.differences, S(0.1)).error() == Error::AmbiguousSolution);
  const auto fix = locate(room.reference, room.differences, S(0.1), {.side = {0, 0, -1}});
  REQUIRE(fix);
  CHECK((fix->position - tag).norm() < S(2e-3));
}

TEST_CASE("Fang, Chan, least squares, Bancroft and pairs agree to a nanometre") {
  sim::Random random{"all agree"};
  for (int trial = 0; trial < 2000; ++trial) {
    const auto [tag, anchors] = test::random_difference_room<double, 2>(random, 4, 8, 5);
    const auto room = test::differences_between<double, 2>(tag, anchors);
    const auto least = tdoa_least_squares(room.reference, room.differences, 0.1);
    const auto chan = tdoa_chan(room.reference, room.differences, 0.1);
    const std::vector<DifferenceTo<double, 2>> two(room.differences.begin(),
                                                   room.differences.begin() + 2);
    std::vector<RangeTo<double, 2>> pseudoranges;
    std::vector<PairDifference<double, 2>> pairs;
    for (const auto& a : anchors) pseudoranges.push_back({a, (tag - a).norm() - 3});
    for (std::size_t i = 1; i < anchors.size(); ++i) {
      pairs.push_back({anchors[i - 1], anchors[i],
                       test::true_difference<double, 2>(tag, anchors[i - 1], anchors[i])});
    }
    const auto closed = bancroft(pseudoranges);
    const auto paired = locate(pairs);
    REQUIRE(least);
    REQUIRE(chan);
    REQUIRE(closed);
    REQUIRE(paired);
    CHECK((least->position - tag).norm() < 1e-9);
    CHECK((chan->position - tag).norm() < 1e-9);
    CHECK((closed->first.position - tag).norm() < 1e-9);
    CHECK(closed->first.bias == doctest::Approx(-3).epsilon(1e-9));
    CHECK((paired->position - tag).norm() < 1e-9);
    // Three anchors by themselves may see the tag from where a nanometre takes more digits.
    const std::vector<Vec<double, 2>> three(anchors.begin(), anchors.begin() + 3);
    if (test::difference_dilution<double, 2>(tag, three) > 20) continue;
    const auto fang = tdoa_fang(room.reference, two);
    REQUIRE(fang);
    CHECK(std::min((fang->first - tag).norm(), (fang->second - tag).norm()) < 1e-9);
  }
}

}  // namespace tests::solve_tdoa_least_squares
