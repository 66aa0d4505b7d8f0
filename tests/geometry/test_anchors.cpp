// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include <uwbpos/geometry/anchors.hpp>

#include "../support/random_geometry.hpp"

namespace tests::geometry_anchors {

namespace {

using uwbpos::Anchors;
using uwbpos::Error;
using uwbpos::Vec;

TEST_CASE_TEMPLATE("An anchor that was added is found under its id", S, float, double) {
  Anchors<S, 3> anchors;
  CHECK(anchors.empty());
  REQUIRE(anchors.add(0xDEADBEEF, {S(1), S(2), S(3)}));
  REQUIRE(anchors.add(0, {S(4), S(5), S(6)}));
  CHECK(anchors.size() == 2);
  CHECK_FALSE(anchors.empty());
  const auto found = anchors.find(0xDEADBEEF);
  REQUIRE(found);
  CHECK(*found == Vec<S, 3>(S(1), S(2), S(3)));
  CHECK(anchors.contains(0));
  CHECK_FALSE(anchors.contains(1));
}

TEST_CASE_TEMPLATE("Anchors stand in the order of their ids however they were added", S, float,
                   double) {
  uwbpos::sim::Random random{"anchor order"};
  std::vector<std::uint32_t> ids;
  for (std::uint32_t i = 0; i < 64; ++i) ids.push_back(i * 0x04000001u);
  for (int round = 0; round < 50; ++round) {
    uwbpos::test::shuffle(random, ids);
    Anchors<S, 2> anchors;
    for (const std::uint32_t id : ids) {
      REQUIRE(anchors.add(id, {static_cast<S>(id % 97), S(1)}));
    }
    REQUIRE(anchors.size() == 64);
    CHECK(std::is_sorted(anchors.begin(), anchors.end(),
                         [](const auto& a, const auto& b) { return a.id < b.id; }));
    for (int i = 0; i < anchors.size(); ++i) {
      CHECK(anchors[i].position(0) == static_cast<S>(anchors[i].id % 97));
      CHECK(*anchors.find(anchors[i].id) == anchors[i].position);
    }
  }
}

TEST_CASE_TEMPLATE("Every wrong use of an anchor table is refused by name and changes nothing", S,
                   float, double) {
  Anchors<S, 2, 2> anchors;
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const S inf = std::numeric_limits<S>::infinity();
  CHECK(anchors.find(7).error() == Error::UnknownAnchor);
  CHECK(anchors.add(7, {nan, S(0)}).error() == Error::NotFinite);
  CHECK(anchors.add(7, {S(0), -inf}).error() == Error::NotFinite);
  CHECK(anchors.size() == 0);
  REQUIRE(anchors.add(7, {S(1), S(2)}));
  CHECK(anchors.add(7, {S(3), S(4)}).error() == Error::DuplicateAnchor);
  CHECK(*anchors.find(7) == Vec<S, 2>(S(1), S(2)));
  REQUIRE(anchors.add(3, {S(3), S(4)}));
  CHECK(anchors.add(5, {S(5), S(6)}).error() == Error::CapacityExceeded);
  CHECK(anchors.add(7, {S(5), S(6)}).error() == Error::DuplicateAnchor);
  CHECK(anchors.size() == 2);
  CHECK(anchors[0].id == 3);
  CHECK(anchors[1].id == 7);
  CHECK(anchors.find(5).error() == Error::UnknownAnchor);
  CHECK(anchors.find(0).error() == Error::UnknownAnchor);
  CHECK(anchors.find(0xFFFFFFFF).error() == Error::UnknownAnchor);
}

}  // namespace

}  // namespace tests::geometry_anchors
