// SPDX-License-Identifier: MIT
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/solve/locate.hpp"

#include "solve/difference_rooms.hpp"
#include "support/statistics.hpp"

namespace tests::solve_tdoa_pairs {

using namespace uwbpos;

namespace {

template <class S, int D>
std::vector<PairDifference<S, D>> exact_pairs(const Vec<S, D>& tag,
                                              const std::vector<Vec<S, D>>& anchors,
                                              const std::vector<std::pair<int, int>>& which) {
  std::vector<PairDifference<S, D>> pairs;
  for (const auto& [a, b] : which) {
    const auto& from = anchors[static_cast<std::size_t>(a)];
    const auto& to = anchors[static_cast<std::size_t>(b)];
    pairs.push_back({from, to, test::true_difference<S, D>(tag, from, to)});
  }
  return pairs;
}

// The corners of a flying room, as a drone has them.
template <class S>
std::vector<Vec<S, 3>> corners() {
  std::vector<Vec<S, 3>> all;
  for (int i = 0; i < 8; ++i) {
    all.push_back(
        {(i & 1) != 0 ? S(7) : S(0), (i & 2) != 0 ? S(8) : S(0), (i & 4) != 0 ? S(3) : S(0.2)});
  }
  return all;
}

}  // namespace

TEST_CASE_TEMPLATE("pairs: chains, rings and stars of pairs give the exact position", S, float,
                   double) {
  sim::Random random{"pairs are exact"};
  const std::vector<std::vector<std::pair<int, int>>> graphs{
      {{0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 5}, {5, 6}, {6, 7}},
      {{0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 5}, {5, 6}, {6, 7}, {7, 0}},
      {{3, 1}, {3, 2}, {3, 0}, {3, 4}, {3, 5}, {3, 6}, {3, 7}},
      {{5, 0}, {1, 4}, {4, 5}, {7, 2}, {2, 1}, {3, 7}, {6, 3}, {0, 6}}};
  for (int trial = 0; trial < 500; ++trial) {
    const Vec<S, 3> tag = test::random_in_box<S, 3>(random, {1, 1, S(0.4)}, {6, 7, S(2.7)});
    for (const auto& graph : graphs) {
      const auto fix = locate(exact_pairs<S, 3>(tag, corners<S>(), graph));
      REQUIRE(fix);
      CHECK(static_cast<double>((fix->position - tag).norm()) < test::exactness<S>() + 1e-6);
      CHECK(fix->degrees_of_freedom == static_cast<int>(graph.size()) - 3);
    }
  }
}

TEST_CASE("pairs: their error is at the bound and their covariance predicts it") {
  sim::Random random{"pairs at the bound"};
  const std::vector<std::pair<int, int>> ring{{0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 5},
                                              {5, 6}, {6, 7}, {7, 0}, {0, 4}, {2, 6}};
  const Vec<double, 3> tag{3, 5, 1.2};
  const auto exact = exact_pairs<double, 3>(tag, corners<double>(), ring);
  const auto bound = cramer_rao_bound(exact, tag);
  REQUIRE(bound);
  double squares = 0;
  double nees = 0;
  constexpr int kTrials = 4000;
  for (int i = 0; i < kTrials; ++i) {
    auto pairs = exact;
    for (auto& d : pairs) d.difference += d.sigma * random.normal();
    const auto fix = locate(pairs);
    REQUIRE(fix);
    const Vec<double, 3> error = fix->position - tag;
    squares += error.squaredNorm();
    nees += dot(error, Ldlt<double, 3>{fix->covariance}.solve(error));
  }
  // The mean of 4000 scatters by 2 %.
  CHECK(squares / kTrials / bound->trace() < 1.08);
  CHECK(squares / kTrials / bound->trace() > 0.94);
  CHECK(test::mean_nees_interval(3, kTrials, 0.999).contains(nees / kTrials));
}

TEST_CASE_TEMPLATE("pairs: what cannot be is refused by name", S, float, double) {
  const Vec<S, 3> tag{3, 5, 1};
  const std::vector<std::pair<int, int>> chain{{0, 1}, {1, 2}, {2, 3}, {3, 4}, {4, 5}};
  const auto exact = exact_pairs<S, 3>(tag, corners<S>(), chain);
  REQUIRE(locate(exact));
  const auto error = [&](const auto& change) {
    auto pairs = exact;
    change(pairs);
    const auto fix = locate(pairs);
    REQUIRE_FALSE(fix);
    return fix.error();
  };
  const S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(error([](auto& p) { p.resize(2); }) == Error::TooFewMeasurements);
  CHECK(error([](auto& p) { p.resize(65, p[0]); }) == Error::TooManyMeasurements);
  CHECK(error([&](auto& p) { p[0].difference = nan; }) == Error::NotFinite);
  CHECK(error([&](auto& p) { p[0].anchor_b[1] = nan; }) == Error::NotFinite);
  CHECK(error([](auto& p) { p[0].sigma = 0; }) == Error::NonPositiveSigma);
  CHECK(error([](auto& p) { p[0].difference = 20; }) == Error::ImpossibleDifference);
  CHECK(error([](auto& p) {
          for (auto& d : p) d = p[0];
        }) == Error::DegenerateGeometry);
  LocateOptions<S, 3> options;
  options.prior = Vec<S, 3>{nan, 0, 0};
  CHECK(locate(exact, options).error() == Error::NotFinite);
}

}  // namespace tests::solve_tdoa_pairs
