// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <numbers>

#include <doctest/doctest.h>

#include <uwbpos/sim/hall.hpp>
#include <uwbpos/sim/site.hpp>

namespace tests::sim_site {

namespace {

using namespace uwbpos::sim;
using uwbpos::Anchors;
using uwbpos::Error;
using uwbpos::Vec;

Anchors<double, 3> eight() {
  return hang_anchors({.width = 20, .depth = 15}, 8, Placement::Perimeter).value();
}

TEST_CASE("A subnet holds the anchors that it is made of, and knows its control anchor") {
  const auto subnet = make_subnet(eight(), 5, 0.25);
  REQUIRE(subnet);
  CHECK(subnet->anchors.size() == 8);
  CHECK(subnet->anchors[subnet->control].id == 5);
  CHECK(subnet->heading == 0.25);
  CHECK(make_subnet(eight(), 99).error() == Error::UnknownAnchor);
  CHECK(make_subnet({}, 1).error() == Error::UnknownAnchor);
  CHECK(make_subnet(eight(), 5, std::numeric_limits<double>::quiet_NaN()).error() ==
        Error::NotFinite);
  const auto many = hang_anchors({}, kMaxSubnetAnchors + 1, Placement::Grid);
  REQUIRE(many);
  CHECK(make_subnet(*many, 1).error() == Error::CapacityExceeded);
}

TEST_CASE("A subnet's own frame has its control anchor at the origin and keeps distances") {
  const auto subnet = make_subnet(eight(), 3, std::numbers::pi / 2);
  REQUIRE(subnet);
  const Vec<double, 3> control = subnet->anchors[subnet->control].position;
  CHECK(in_subnet(*subnet, control).norm() == 0);
  // Turned by +90° against the map: the map's y is the subnet's x.
  const Vec<double, 3> north = in_subnet(*subnet, control + Vec<double, 3>(0, 2, 1));
  CHECK((north - Vec<double, 3>(2, 0, 1)).norm() < 1e-15);
  const Vec<double, 3> p{3, 4, 1};
  const Vec<double, 3> q{11, -2, 0.5};
  CHECK((in_subnet(*subnet, p) - in_subnet(*subnet, q)).norm() ==
        doctest::Approx((p - q).norm()).epsilon(1e-14));
}

TEST_CASE("A site takes eight subnets, and only whole ones") {
  Site site;
  const Subnet subnet = make_subnet(eight(), 1).value();
  Subnet headless = subnet;
  headless.control = 8;
  CHECK(add(site, headless).error() == Error::InvalidOption);
  headless.control = -1;
  CHECK(add(site, headless).error() == Error::InvalidOption);
  CHECK(add(site, Subnet{}).error() == Error::TooFewMeasurements);
  CHECK(site.subnet_count == 0);
  for (int i = 0; i < kMaxSubnets; ++i) CHECK(add(site, subnet));
  CHECK(add(site, subnet).error() == Error::CapacityExceeded);
  CHECK(anchor_count(site) == 8 * kMaxSubnets);
}

}  // namespace

}  // namespace tests::sim_site
