// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdint>
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/frames/subnet.hpp"

#include "frames/scenes.hpp"

namespace tests::frames_subnet {

using namespace uwbpos;

TEST_CASE_TEMPLATE("a subnet that was added is found, its control anchor at its origin", S, float,
                   double) {
  Subnets<S, 2> subnets;
  CHECK(subnets.empty());
  const auto map_T_subnet = transform_from_yaw(S(0.5), Vec<S, 2>{20, 10});
  REQUIRE(map_T_subnet);
  REQUIRE(subnets.add({.id = 7, .control_anchor = 0xA0, .map_T_subnet = *map_T_subnet}));
  REQUIRE(subnets.add({.id = 3, .control_anchor = 0xB0, .map_T_subnet = {}}));
  CHECK(subnets.size() == 2);
  CHECK(*subnets.place(3) == 1);
  CHECK(subnets[0].id == 7);
  CHECK(subnets.end() - subnets.begin() == 2);
  const auto found = subnets.find(7);
  REQUIRE(found);
  CHECK(found->control_anchor == 0xA0);
  CHECK(apply(found->map_T_subnet, {0, 0}) == Vec<S, 2>{20, 10});
}

TEST_CASE_TEMPLATE("what is no subnet is refused by name and changes nothing", S, float, double) {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  Subnets<S, 2, 2> subnets;
  const auto refused = [&](std::uint32_t id, const Transform<S, 2>& t) {
    const int before = subnets.size();
    const auto added = subnets.add({id, 0, t});
    REQUIRE_FALSE(added);
    CHECK(subnets.size() == before);
    return added.error();
  };
  CHECK(subnets.find(1).error() == Error::UnknownSubnet);
  CHECK(subnets.place(1).error() == Error::UnknownSubnet);
  Transform<S, 2> t;
  t.rotation(0, 0) = -1;
  CHECK(refused(1, t) == Error::NotARotation);
  t = {};
  t.translation[0] = nan;
  CHECK(refused(1, t) == Error::NotFinite);
  t = {};
  t.covariance(0, 0) = -1;
  CHECK(refused(1, t) == Error::InvalidCovariance);
  t = {};
  t.covariance(2, 2) = 1;
  CHECK(refused(1, t) == Error::RotationUndetermined);
  REQUIRE(subnets.add({1, 0, {}}));
  CHECK(refused(1, {}) == Error::DuplicateSubnet);
  REQUIRE(subnets.add({2, 0, {}}));
  CHECK(refused(3, {}) == Error::CapacityExceeded);
  CHECK(refused(2, {}) == Error::DuplicateSubnet);
  CHECK(subnets.find(3).error() == Error::UnknownSubnet);
}

TEST_CASE_TEMPLATE("errors that were learned correct the transforms", S, float, double) {
  sim::Random random{"absorbed errors"};
  const S tolerance = S(400) * std::numeric_limits<S>::epsilon();  // 50 m, a few roundings
  for (int trial = 0; trial < 50; ++trial) {
    const auto truth = test::random_transform<double, 3>(random);
    const Vec<double, 6> xi = test::random_normal<double, 6>(random, 0.05);
    const Vec<double, 6> back = -xi;
    const auto off = test::perturbed<3>(truth, back);  // Exp(ξ) brings it back, but for order ξ²
    Subnets<S, 3, 3> subnets;
    for (std::uint32_t id = 0; id < 2; ++id) {
      REQUIRE(subnets.add({id,
                           0,
                           {.rotation = off.rotation.template cast<S>(),
                            .translation = off.translation.template cast<S>(),
                            .covariance = Mat<S, 6>::Identity() * S(0.0025)}}));
    }
    auto errors = subnets.errors();
    CHECK(errors.mean.isZero(0));
    CHECK(errors.covariance(0, 0) == S(0.0025));
    CHECK(errors.covariance(0, 6) == S(0));
    CHECK(errors.covariance(12, 12) == S(0));
    errors.mean.template segment<6>(6) = xi.template cast<S>();
    errors.covariance *= S(0.25);
    errors.covariance(0, 6) = errors.covariance(6, 0) = S(0.0005);
    REQUIRE(subnets.absorb(errors));
    const auto& now = subnets[1].map_T_subnet;
    CHECK((now.translation.template cast<double>() - truth.translation).norm() < tolerance);
    // Cayley's map departs from the exponential by θ³/12 of up to 0.2 rad: 7e-4.
    CHECK((now.rotation.template cast<double>() - truth.rotation).norm() < 7e-4);
    CHECK(test::rotation_defect<S, 3>(now.rotation) <
          8 * static_cast<double>(std::numeric_limits<S>::epsilon()));
    CHECK(now.covariance(0, 0) == S(0.000625));
    CHECK(subnets.covariance(0, 1)(0, 0) == S(0.0005));
    CHECK(subnets[0].map_T_subnet.translation == off.translation.template cast<S>());

    errors.mean[0] = std::numeric_limits<S>::quiet_NaN();
    CHECK(subnets.absorb(errors).error() == Error::NumericOverflow);
    CHECK(subnets.covariance(0, 1)(0, 0) == S(0.0005));
  }
}

TEST_CASE_TEMPLATE("errors that rounding made more than alike are alike once learned", S, float,
                   double) {
  Subnets<S, 3, 3> subnets;
  for (std::uint32_t id = 0; id < 2; ++id) {
    REQUIRE(subnets.add({id, 0, {.covariance = Mat<S, 6>::Identity() * S(0.0025)}}));
  }
  auto errors = subnets.errors();
  errors.covariance(6, 0) = errors.covariance(0, 6) = S(0.0025) * S(1.0003);
  REQUIRE(subnets.absorb(errors));
  const S kept = subnets.covariance(0, 1)(0, 0);
  const Mat<S, 6> own = subnets.covariance(0, 0);
  CHECK(kept <= std::sqrt(own(0, 0)) * std::sqrt(own(0, 0)));
  CHECK(kept >= S(0.0024999));
  CHECK(subnets.covariance(1, 0)(0, 0) == kept);
}

}  // namespace tests::frames_subnet
