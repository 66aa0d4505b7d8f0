// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <Eigen/Dense>
#include <doctest/doctest.h>

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/solve/tdoa_chan.hpp"

#include "solve/difference_rooms.hpp"
#include "support/statistics.hpp"

namespace tests::solve_tdoa_chan {

using namespace uwbpos;

namespace {

// Stage 2 as the patent prints it, from the same stage 1: squares, [1 0; 0 1; 1 1], Ψ₂ = 4 B₂ P B₂,
// signed roots.
Vec<double, 2> patent_stage_two(const test::DifferenceRoom<double, 2>& room,
                                const std::vector<DifferenceTo<double, 2>>& differences) {
  const DifferenceView<double, 2> view{room.reference, differences, 0.1};
  Vec<double, 3> theta;
  theta.head<2>() = room.tag - room.reference;
  theta[2] = theta.head<2>().norm();
  const auto [lower, rhs] = chan_normal<double, 2>(view, &theta);
  const Mat<double, 3> normal = symmetric_from_lower(lower);
  const Vec<double, 3> first = normal.ldlt().solve(rhs);
  const Mat<double, 3> covariance = normal.inverse();
  const Mat<double, 3> b = first.asDiagonal();
  const Mat<double, 3> psi = 4 * b * covariance * b;
  Eigen::Matrix<double, 3, 2> g;
  g << 1, 0, 0, 1, 1, 1;
  const Vec<double, 3> squares = first.cwiseProduct(first);
  const Mat<double, 3> weight = psi.inverse();
  const Vec<double, 2> z =
      (g.transpose() * weight * g).ldlt().solve(g.transpose() * weight * squares);
  return room.reference + Vec<double, 2>{std::copysign(std::sqrt(std::abs(z[0])), first[0]),
                                         std::copysign(std::sqrt(std::abs(z[1])), first[1])};
}

}  // namespace

TEST_CASE("Chan: the patent's literal stage 2 agrees, exactly without noise, to first order with") {
  sim::Random random{"patent"};
  const std::vector<Vec<double, 2>> anchors{{0, 0}, {10, 1}, {9, 8}, {-1, 7}, {4, 11}};
  for (int trial = 0; trial < 500; ++trial) {
    // Away from the axes through the reference, where Ψ₂ is singular.
    const Vec<double, 2> tag{random.uniform(2, 8), random.uniform(2, 7)};
    const auto room = test::differences_between<double, 2>(tag, anchors);
    CHECK((patent_stage_two(room, room.differences) - tag).norm() < 1e-9);
    double apart[2] = {};
    const double sigmas[2] = {1e-3, 1e-4};
    std::vector<double> noise;
    for (std::size_t i = 0; i < anchors.size(); ++i) noise.push_back(random.normal());
    for (int k = 0; k < 2; ++k) {
      auto differences = room.differences;
      for (std::size_t i = 0; i < differences.size(); ++i) {
        differences[i].difference += sigmas[k] * (noise[i + 1] - noise[0]);
      }
      const auto ours = tdoa_chan(room.reference, differences, 0.1);
      REQUIRE(ours);
      apart[k] = (ours->position - patent_stage_two(room, differences)).norm();
    }
    // Second order: noise ten times smaller, disagreement about a hundred times smaller.
    CHECK(apart[0] < 1e-4);
    CHECK(apart[1] < 1e-6);
  }
}

TEST_CASE("Chan: on the axes through the reference it is as good as elsewhere") {
  sim::Random random{"chan on the axes"};
  const std::vector<Vec<double, 2>> anchors{{0, 0}, {10, -6}, {9, 8}, {-3, 7}, {4, 11}};
  for (const Vec<double, 2>& tag : {Vec<double, 2>{4, 0}, Vec<double, 2>{0, 5}}) {
    const auto room = test::differences_between<double, 2>(tag, anchors);
    const auto bound = cramer_rao_bound(room.reference, room.differences, 0.1, tag);
    REQUIRE(bound);
    double squares = 0;
    constexpr int kTrials = 4000;
    for (int i = 0; i < kTrials; ++i) {
      const auto fix = tdoa_chan(room.reference, test::noisy<double, 2>(random, room, 0.1), 0.1);
      REQUIRE(fix);
      squares += (fix->position - tag).squaredNorm();
    }
    // The mean of 4000 scatters by 2 %; the noise's second order adds a few more.
    CHECK(squares / kTrials / bound->trace() < 1.15);
  }
}

TEST_CASE_TEMPLATE("Chan: what it cannot solve is refused by name", S, float, double) {
  const std::vector<Vec<S, 2>> anchors{{0, 0}, {10, 0}, {10, 8}, {0, 8}};
  const auto room = test::differences_between<S, 2>({4, 3}, anchors);
  auto two = room.differences;
  two.resize(2);
  CHECK(tdoa_chan(room.reference, two, S(0.1)).error() == Error::TooFewMeasurements);
  auto impossible = room.differences;
  impossible[0].difference = 12;
  CHECK(tdoa_chan(room.reference, impossible, S(0.1)).error() == Error::ImpossibleDifference);
  CHECK(tdoa_chan(room.reference, room.differences, S(0)).error() == Error::NonPositiveSigma);
  auto nan = room.differences;
  nan[2].difference = std::numeric_limits<S>::quiet_NaN();
  CHECK(tdoa_chan(room.reference, nan, S(0.1)).error() == Error::NotFinite);
  // In one row: mirror images, which Chan's stage 1 cannot hold.
  const std::vector<Vec<S, 2>> row{{0, 0}, {3, 0}, {7, 0}, {9, 0}};
  const auto flat = test::differences_between<S, 2>({4, 3}, row);
  CHECK_FALSE(tdoa_chan(flat.reference, flat.differences, S(0.1)));
}

}  // namespace tests::solve_tdoa_chan
