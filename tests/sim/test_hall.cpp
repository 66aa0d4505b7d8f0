// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include <uwbpos/sim/hall.hpp>

namespace tests::sim_hall {

namespace {

using namespace uwbpos::sim;
using uwbpos::Error;
using uwbpos::Vec;

constexpr Hall kHall{.width = 30, .depth = 20, .height = 3};

TEST_CASE("The paper's hall has its three base stations on the axes") {
  const auto anchors = hang_anchors(kHall, 3, Placement::Axes);
  REQUIRE(anchors);
  REQUIRE(anchors->size() == 3);
  CHECK(*anchors->find(1) == Vec<double, 3>(0, 0, 3));
  CHECK(*anchors->find(2) == Vec<double, 3>(30, 0, 3));
  CHECK(*anchors->find(3) == Vec<double, 3>(0, 20, 3));
}

TEST_CASE("Corners and edges stand where their names say") {
  const auto corners = hang_anchors(kHall, 4, Placement::Corners);
  REQUIRE(corners);
  CHECK(*corners->find(3) == Vec<double, 3>(30, 20, 3));
  CHECK(*corners->find(4) == Vec<double, 3>(0, 20, 3));
  const auto edges = hang_anchors(kHall, 4, Placement::Edges);
  REQUIRE(edges);
  CHECK(*edges->find(1) == Vec<double, 3>(15, 0, 3));
  CHECK(*edges->find(4) == Vec<double, 3>(0, 10, 3));
}

TEST_CASE("A perimeter is walked in equal steps along the walls") {
  for (const int count : {1, 2, 3, 5, 8, 10, 64}) {
    CAPTURE(count);
    const auto anchors = hang_anchors(kHall, count, Placement::Perimeter);
    REQUIRE(anchors);
    REQUIRE(anchors->size() == count);
    for (const auto& anchor : *anchors) {
      const double x = anchor.position(0);
      const double y = anchor.position(1);
      CHECK((x == 0 || x == 30 || y == 0 || y == 20));
      CHECK((0 <= x && x <= 30 && 0 <= y && y <= 20));
    }
  }
  const auto ten = hang_anchors(kHall, 10, Placement::Perimeter);
  CHECK(*ten->find(1) == Vec<double, 3>(0, 0, 3));
  CHECK(*ten->find(4) == Vec<double, 3>(30, 0, 3));
  CHECK(*ten->find(6) == Vec<double, 3>(30, 20, 3));
  CHECK(*ten->find(9) == Vec<double, 3>(0, 20, 3));
}

TEST_CASE("A grid is spread over the whole hall without two anchors in one place") {
  for (int count = 1; count <= 64; ++count) {
    CAPTURE(count);
    const auto anchors = hang_anchors(kHall, count, Placement::Grid);
    REQUIRE(anchors);
    REQUIRE(anchors->size() == count);
    Vec<double, 3> sum = Vec<double, 3>::Zero();
    for (const auto& a : *anchors) {
      CHECK((0 < a.position(0) && a.position(0) < 30 && 0 < a.position(1) && a.position(1) < 20));
      sum += a.position;
      for (const auto& b : *anchors) {
        if (a.id != b.id) CHECK((a.position - b.position).norm() > 1);
      }
    }
    // Every row is centred.
    CHECK(std::abs(sum(0) / count - 15) < 1e-9);
  }
  const auto six = hang_anchors(kHall, 6, Placement::Grid);
  CHECK(*six->find(1) == Vec<double, 3>(5, 5, 3));
  CHECK(*six->find(6) == Vec<double, 3>(25, 15, 3));
}

TEST_CASE("Every second anchor hangs at the second height") {
  const auto flat = hang_anchors({.height = 4}, 4, Placement::Corners);
  for (const auto& anchor : *flat) CHECK(anchor.position(2) == 4);
  const auto stepped = hang_anchors({.height = 4, .second_height = 1}, 4, Placement::Corners);
  for (const auto& anchor : *stepped) CHECK(anchor.position(2) == (anchor.id % 2 == 1 ? 4 : 1));
}

TEST_CASE("A hall that cannot be is refused by name") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(hang_anchors(kHall, 0, Placement::Grid).error() == Error::InvalidOption);
  CHECK(hang_anchors(kHall, 5, Placement::Corners).error() == Error::InvalidOption);
  CHECK(hang_anchors(kHall, 5, Placement::Edges).error() == Error::InvalidOption);
  CHECK(hang_anchors(kHall, 4, Placement::Axes).error() == Error::InvalidOption);
  CHECK(hang_anchors(kHall, 65, Placement::Perimeter).error() == Error::CapacityExceeded);
  CHECK(hang_anchors({.width = 0}, 4, Placement::Grid).error() == Error::InvalidOption);
  CHECK(hang_anchors({.depth = nan}, 4, Placement::Grid).error() == Error::InvalidOption);
  CHECK(hang_anchors({.height = nan}, 4, Placement::Grid).error() == Error::NotFinite);
  CHECK(hang_anchors({.width = std::numeric_limits<double>::infinity()}, 3, Placement::Axes)
            .error() == Error::NotFinite);
}

}  // namespace

}  // namespace tests::sim_hall
