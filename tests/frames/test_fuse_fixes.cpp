// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Eigenvalues>
#include <doctest/doctest.h>

#include "uwbpos/frames/fuse_fixes.hpp"

#include "frames/scenes.hpp"
#include "support/nees.hpp"
#include "support/statistics.hpp"

namespace tests::frames_fuse_fixes {

using namespace uwbpos;

namespace {

template <class S>
using Fixes = std::vector<SubnetFix<S, 2>>;

// Three subnets at (0, 0), (10, 0), (20, 0), turned by 0, 1 and 2 rad, known to `sigma` and
// `sigma` / 10 m.
template <class S>
Subnets<S, 2, 4> three_subnets(S sigma = S(0)) {
  Subnets<S, 2, 4> subnets;
  for (std::uint32_t id = 1; id <= 3; ++id) {
    Mat<S, 3> c = Mat<S, 3>::Identity() * (sigma * sigma);
    c(2, 2) *= S(0.01);
    const auto t = transform_from_yaw(static_cast<S>(id - 1), Vec<S, 2>{S(10) * S(id - 1), 0}, c);
    REQUIRE(subnets.add({id, 100 + id, *t}));
  }
  return subnets;
}

// A fix of standard deviation `sigma` that the subnet's transform takes to `in_map`.
template <class S>
SubnetFix<S, 2> fix_at(const Subnets<S, 2, 4>& subnets, std::uint32_t id, Vec<S, 2> in_map,
                       S sigma) {
  const auto subnet_T_map = inverse(subnets.find(id)->map_T_subnet);
  return {id, {apply(subnet_T_map, in_map), Mat<S, 2>::Identity() * (sigma * sigma), S(2), 3}};
}

}  // namespace

TEST_CASE_TEMPLATE("one fix alone is the transformed fix", S, float, double) {
  const auto subnets = three_subnets<S>(S(0.1));
  const Fixes<S> fixes{fix_at<S>(subnets, 2, {12, 3}, S(0.2))};
  const auto fused = fuse_fixes(subnets, fixes);
  REQUIRE(fused);
  const auto expected = apply(subnets.find(2)->map_T_subnet, fixes[0].fix);
  CHECK(fused->fix.position == expected.position);
  CHECK((fused->fix.covariance - expected.covariance).norm() < S(1e-6));
  CHECK(fused->fix.chi_squared == S(2));
  CHECK(fused->fix.degrees_of_freedom == 3);
  CHECK(fused->heard == 1);
  CHECK(fused->fused == 1);
  CHECK(fused->used == std::array{true, false, false, false});
  CHECK(fused->leading == 2);
  CHECK(fused->disagreement == S(0));
  CHECK(fused->disagreement_dof == 0);
}

TEST_CASE_TEMPLATE("fixes that agree are fused and counted", S, float, double) {
  const auto subnets = three_subnets<S>();
  const Fixes<S> fixes{fix_at<S>(subnets, 1, {5, 1}, S(0.2)),
                       fix_at<S>(subnets, 3, {S(5.2), 1}, S(0.1))};
  const auto fused = fuse_fixes(subnets, fixes);
  REQUIRE(fused);
  // Weights 25 and 100.
  CHECK(fused->fix.position[0] == doctest::Approx(5.16));
  CHECK(fused->fix.covariance(0, 0) == doctest::Approx(1.0 / 125).epsilon(1e-4));
  CHECK(fused->disagreement == doctest::Approx(0.04 / 0.05).epsilon(1e-4));
  CHECK(fused->disagreement_dof == 2);
  CHECK(fused->fix.chi_squared == doctest::Approx(4 + 0.8).epsilon(1e-4));
  CHECK(fused->fix.degrees_of_freedom == 8);
  CHECK(fused->fused == 2);
  CHECK(fused->leading == 3);
}

TEST_CASE_TEMPLATE("of two fixes that contradict the better is chosen, and said so", S, float,
                   double) {
  const auto subnets = three_subnets<S>();
  const Fixes<S> fixes{fix_at<S>(subnets, 1, {5, 1}, S(0.2)),
                       fix_at<S>(subnets, 2, {7, 1}, S(0.15))};
  auto fused = fuse_fixes(subnets, fixes);
  REQUIRE(fused);
  CHECK(fused->heard == 2);
  CHECK(fused->fused == 1);
  CHECK(fused->leading == 2);
  CHECK(fused->used == std::array{false, true, false, false});
  CHECK(fused->fix.position[0] == doctest::Approx(7));
  CHECK(fused->fix.covariance(0, 0) == doctest::Approx(0.0225));
  CHECK(fused->fix.degrees_of_freedom == 3);
  CHECK(fused->disagreement == doctest::Approx(64).epsilon(1e-3));
  CHECK(fused->disagreement_dof == 2);

  // The subnet that the tag had is kept while its fix is not much worse.
  CHECK(fuse_fixes(subnets, fixes, {.preferred = 1})->leading == 1);
  CHECK(fuse_fixes(subnets, fixes, {.preferred = 1, .preference = S(1.5)})->leading == 2);
  CHECK(fuse_fixes(subnets, fixes, {.preferred = 3})->leading == 2);
  // A preference is no veto where fixes agree.
  CHECK(fuse_fixes(subnets, fixes, {.gate = S(20), .preferred = 1})->fused == 2);
}

TEST_CASE_TEMPLATE("of three fixes the odd one is left out, good as it claims to be", S, float,
                   double) {
  const auto subnets = three_subnets<S>(S(0.01));
  for (std::uint32_t odd = 1; odd <= 3; ++odd) {
    Fixes<S> fixes;
    for (std::uint32_t id = 1; id <= 3; ++id) {
      fixes.push_back(
          fix_at<S>(subnets, id, {id == odd ? S(9) : S(5), 1}, id == odd ? S(0.05) : S(0.1)));
    }
    const auto fused = fuse_fixes(subnets, fixes);
    REQUIRE(fused);
    CHECK(fused->heard == 3);
    CHECK(fused->fused == 2);
    CHECK_FALSE(fused->used[odd - 1]);
    CHECK(fused->leading != odd);
    CHECK(fused->fix.position[0] == doctest::Approx(5).epsilon(1e-4));
    CHECK(fused->disagreement_dof == 4);
    CHECK(fused->disagreement > S(100));
  }
  // All three apart: one is left.
  const Fixes<S> apart{fix_at<S>(subnets, 1, {5, 1}, S(0.2)), fix_at<S>(subnets, 2, {9, 1}, S(0.2)),
                       fix_at<S>(subnets, 3, {15, 1}, S(0.1))};
  const auto fused = fuse_fixes(subnets, apart);
  REQUIRE(fused);
  CHECK(fused->fused == 1);
}

TEST_CASE_TEMPLATE("a fused fix errs as it claims, and false contradictions are rare", S, float,
                   double) {
  sim::Random random{"fused nees"};
  constexpr int trials = 6000;
  double error = 0;
  double disagreement = 0;
  int split = 0;
  const auto subnets = three_subnets<S>(S(0.1));
  for (int trial = 0; trial < trials; ++trial) {
    const Vec<double, 2> truth = test::random_in_cube<double, 2>(random, 8.0);
    Fixes<S> fixes;
    for (std::uint32_t id = 1; id <= 3; ++id) {
      const auto believed = test::in_double(subnets.find(id)->map_T_subnet);
      const auto actual = test::perturbed<2>(believed, test::draw<3>(random, believed.covariance));
      const Mat<S, 2> c = test::random_covariance<S, 2>(random, 0.05, 0.3);
      const Vec<double, 2> at = apply(inverse(actual), truth) +
                                test::draw<2>(random, Mat<double, 2>{c.template cast<double>()});
      fixes.push_back({id, {at.cast<S>(), c, S(0), 0}});
    }
    const auto fused = fuse_fixes(subnets, fixes);
    REQUIRE(fused);
    error +=
        test::normalised_squared_error<S, 2>(fused->fix.position, fused->fix.covariance, truth);
    disagreement += static_cast<double>(fused->disagreement);
    split += fused->fused < fused->heard ? 1 : 0;
  }
  CHECK(test::mean_nees_interval(2, trials, 0.999).contains(error / trials));
  CHECK(test::mean_nees_interval(4, trials, 0.999).contains(disagreement / trials));
  CHECK(split <= 3);  // one in 30,000: above 3 of 6,000 less than one time in 10,000
}

TEST_CASE_TEMPLATE("overlaps teach the subnets how they lie to each other", S, float, double) {
  sim::Random random{"learning"};
  auto subnets = three_subnets<S>(S(0.3));
  std::array<Transform<double, 2>, 3> actual;
  for (int k = 0; k < 3; ++k) {
    const auto believed = test::in_double(subnets[k].map_T_subnet);
    actual[static_cast<std::size_t>(k)] =
        test::perturbed<2>(believed, test::draw<3>(random, believed.covariance));
  }
  // How far subnets 1 and 2 put one tag apart, and how far they say that they may.
  const auto apart = [&](const Vec<double, 2>& p) {
    const auto one = apply(subnets[0].map_T_subnet, apply(inverse(actual[0]), p).cast<S>());
    const auto two = apply(subnets[1].map_T_subnet, apply(inverse(actual[1]), p).cast<S>());
    return static_cast<double>((one - two).norm());
  };
  const Vec<double, 2> middle{5, 0};
  const double before = apart(middle);
  const S own_before = subnets[0].map_T_subnet.covariance(0, 0);
  const auto third = subnets[2].map_T_subnet;
  for (int i = 0; i < 300; ++i) {
    const Vec<double, 2> p = middle + test::random_in_cube<double, 2>(random, 3.0);
    Fixes<S> fixes;
    for (std::uint32_t id = 1; id <= 2; ++id) {
      const Vec<double, 2> at =
          apply(inverse(actual[id - 1]), p) + test::random_normal<double, 2>(random, 0.1);
      fixes.push_back({id, {at.cast<S>(), Mat<S, 2>::Identity() * S(0.01), S(0), 0}});
    }
    const auto fused = fuse_and_learn(subnets, fixes, {.correlated_fixes = S(1)});
    REQUIRE(fused);
    CHECK(fused->fused == 2);
  }
  // 0.1 m · √2 / √300 = 8 mm, and learning ends at a thousandth of the variance, 4.5 mm.
  CHECK(before > 0.1);
  CHECK(apart(middle) < 0.03);
  // Of where both lie together the overlap told at most half.
  CHECK(subnets[0].map_T_subnet.covariance(0, 0) > S(0.45) * own_before);
  CHECK(subnets[0].map_T_subnet.covariance(0, 0) < own_before);
  CHECK(subnets.covariance(0, 1)(0, 0) > S(0.4) * own_before);
  // The third subnet was not heard.
  CHECK(subnets[2].map_T_subnet.translation == third.translation);
  CHECK(subnets[2].map_T_subnet.covariance == third.covariance);
  CHECK(subnets.covariance(0, 2).isZero(0));
}

TEST_CASE_TEMPLATE("transforms far worse than the fixes are learned and exhaust no digits", S,
                   float, double) {
  sim::Random random{"coarse transforms"};
  Subnets<S, 3, 3> subnets;
  std::array<Transform<double, 3>, 3> actual;
  for (std::uint32_t id = 0; id < 3; ++id) {
    auto believed = exact(test::random_transform<double, 3>(random));
    believed.covariance.diagonal() << 1, 1, 1, 0.01, 0.01, 0.01;  // 1 m and 6°; fixes of 2 cm
    actual[id] = test::perturbed<3>(believed, test::draw<6>(random, believed.covariance));
    REQUIRE(subnets.add({id,
                         0,
                         {.rotation = believed.rotation.template cast<S>(),
                          .translation = believed.translation.template cast<S>(),
                          .covariance = believed.covariance.template cast<S>()}}));
  }
  double first = 0;
  double last = 0;
  int contradictions = 0;
  constexpr int rounds = 3000;
  for (int i = 0; i < rounds; ++i) {
    const Vec<double, 3> p = test::random_in_cube<double, 3>(random, 20.0);
    std::vector<SubnetFix<S, 3>> fixes;
    for (std::uint32_t k = 0; k < 2; ++k) {
      const std::uint32_t id = (static_cast<std::uint32_t>(i) + k) % 3;
      const Vec<double, 3> at =
          apply(inverse(actual[id]), p) + test::random_normal<double, 3>(random, 0.02);
      fixes.push_back({id, {at.cast<S>(), Mat<S, 3>::Identity() * S(0.0004), S(0), 0}});
    }
    const auto one = apply(subnets.find(fixes[0].subnet)->map_T_subnet, fixes[0].fix.position);
    const auto two = apply(subnets.find(fixes[1].subnet)->map_T_subnet, fixes[1].fix.position);
    if (i < 3) first += static_cast<double>((one - two).norm()) / 3;
    if (i >= rounds - 100) last += static_cast<double>((one - two).norm()) / 100;
    const auto fused = fuse_and_learn(subnets, fixes);
    REQUIRE(fused);
    contradictions += fused->fused < 2 ? 1 : 0;
  }
  CHECK(contradictions == 0);
  CHECK(first > 1);
  // In double down to the noise: 0.02 · √6 = 49 mm, and as much for what is left of rotations 70 m
  // from the map's origin. A float stops at a thousand ε of (1 m)² + (0.1 · 35 m)²: 0.05 m each
  // way.
  CHECK(last < (sizeof(S) == 4 ? 0.25 : 0.1));
}

TEST_CASE_TEMPLATE("what is learned of tags far away stays a covariance", S, float, double) {
  // At 30 km, turns known to 0.01 rad are 300 m, and a fix is good to 1 cm: of what the subnets
  // learn some directions are left with a billionth of the variance, and a float has seven digits.
  sim::Random random{"tags far away"};
  double most_learned = 1;
  int fused = 0;
  for (int trial = 0; trial < 100; ++trial) {
    Subnets<S, 3, 3> subnets;
    for (std::uint32_t id = 0; id < 3; ++id) {
      auto t = exact(test::random_transform<S, 3>(random));
      t.covariance.diagonal().setConstant(S(1e-4));
      REQUIRE(subnets.add({id, 0, t}));
    }
    for (int step = 0; step < 20; ++step) {
      const S reach = S(30) * S(std::pow(10.0, random.uniform(0.0, 3.0)));
      const Vec<S, 3> tag = test::random_in_cube<S, 3>(random, 1.0) * reach;
      std::vector<SubnetFix<S, 3>> fixes;
      for (std::uint32_t id = 0; id < 3; ++id) {
        fixes.push_back({id,
                         {apply(inverse(subnets.find(id)->map_T_subnet), tag),
                          Mat<S, 3>::Identity() * S(1e-4), S(0), 0}});
      }
      fused += fuse_and_learn(subnets, fixes) ? 1 : 0;
      const Mat<double, 18> joint = subnets.errors().covariance.template cast<double>();
      REQUIRE((joint.diagonal().array() > 0).all());
      const Vec<double, 18> scale = joint.diagonal().cwiseSqrt().cwiseInverse();
      const Mat<double, 18> correlations = scale.asDiagonal() * joint * scale.asDiagonal();
      const Eigen::SelfAdjointEigenSolver<Mat<double, 18>> directions{correlations,
                                                                      Eigen::EigenvaluesOnly};
      REQUIRE(directions.eigenvalues()[0] > -18 * 8 * double(std::numeric_limits<S>::epsilon()));
      most_learned = std::min(most_learned, joint(3, 3) / 1e-4);
    }
  }
  CHECK(most_learned < 0.01);
  CHECK(fused > 1000);  // of those far off, a float refuses some whose variances it cannot hold
}

TEST_CASE("errors that persist for ten fixes do not make the transforms overconfident") {
  sim::Random random{"persisting errors"};
  constexpr int trials = 400;
  double counted = 0;
  double believed = 0;
  for (int trial = 0; trial < trials; ++trial) {
    auto subnets = three_subnets<double>(0.1);
    auto naive = subnets;
    std::array<Transform<double, 2>, 2> actual;
    for (int k = 0; k < 2; ++k) {
      const auto t = subnets[k].map_T_subnet;
      actual[static_cast<std::size_t>(k)] =
          test::perturbed<2>(t, test::draw<3>(random, t.covariance));
    }
    std::array<Vec<double, 2>, 2> noise;
    for (int i = 0; i < 100; ++i) {
      const Vec<double, 2> p = test::random_in_cube<double, 2>(random, 5.0);
      std::vector<SubnetFix<double, 2>> fixes;
      for (std::uint32_t k = 0; k < 2; ++k) {
        if (i % 10 == 0) noise[k] = test::random_normal<double, 2>(random, 0.1);
        const Vec<double, 2> at = apply(inverse(actual[k]), p) + noise[k];
        fixes.push_back({k + 1, {at, Mat<double, 2>::Identity() * 0.01, 0, 0}});
      }
      REQUIRE(fuse_and_learn(subnets, fixes));
      REQUIRE(fuse_and_learn(naive, fixes, {.correlated_fixes = 1}));
    }
    // The distance that the two put between the places of one point, over what they claim.
    const auto over_claim = [&](const Subnets<double, 2, 4>& by) {
      const Vec<double, 2> p{1, 1};
      Vec<double, 2> apart = Vec<double, 2>::Zero();
      Mat<double, 2> claimed = Mat<double, 2>::Zero();
      std::array<Eigen::Matrix<double, 2, 3>, 2> j;
      for (int k = 0; k < 2; ++k) {
        const auto at = apply(inverse(actual[static_cast<std::size_t>(k)]), p);
        apart += (k == 0 ? 1 : -1) * apply(by[k].map_T_subnet, at);
        j[static_cast<std::size_t>(k)] = point_jacobian(by[k].map_T_subnet, at);
      }
      for (int a = 0; a < 2; ++a) {
        for (int b = 0; b < 2; ++b) {
          claimed += (a == b ? 1 : -1) * j[static_cast<std::size_t>(a)] * by.covariance(a, b) *
                     j[static_cast<std::size_t>(b)].transpose();
        }
      }
      return test::normalised_squared_error<double, 2>(apart, claimed, Vec<double, 2>::Zero());
    };
    counted += over_claim(subnets);
    believed += over_claim(naive);
  }
  CHECK(counted / trials < test::mean_nees_interval(2, trials, 0.999).high);
  CHECK(counted / trials > 1);
  CHECK(believed / trials > 4);  // what ten times too much confidence does
}

TEST_CASE_TEMPLATE("nothing is learned from one subnet, from a contradiction or from an error", S,
                   float, double) {
  auto subnets = three_subnets<S>(S(0.05));
  const auto errors = subnets.errors().covariance;
  Fixes<S> fixes{fix_at<S>(subnets, 1, {5, 1}, S(0.1))};
  CHECK(fuse_and_learn(subnets, fixes));
  fixes.push_back(fix_at<S>(subnets, 2, {9, 1}, S(0.1)));
  CHECK(fuse_and_learn(subnets, fixes)->fused == 1);
  fixes[1].subnet = 9;
  CHECK(fuse_and_learn(subnets, fixes).error() == Error::UnknownSubnet);
  CHECK(subnets.errors().covariance == errors);
  fixes[1] = fix_at<S>(subnets, 2, {S(5.1), 1}, S(0.1));
  CHECK(fuse_and_learn(subnets, fixes)->fused == 2);
  CHECK(subnets.errors().covariance != errors);
}

TEST_CASE_TEMPLATE("a covariance too long for the scalar is refused where turning it leaves none",
                   S, float, double) {
  const S eps = std::numeric_limits<S>::epsilon();
  int refused = 0;
  for (int i = 0; i < 64; ++i) {
    Subnets<S, 2, 4> subnets;
    REQUIRE(subnets.add({1, 7, *transform_from_yaw<S, 2>(S(0.1) * S(i), {S(1), S(2)})}));
    SubnetFix<S, 2> fix{1, {}};
    fix.fix.position = {S(3), S(4)};
    fix.fix.covariance << S(1) / (eps * eps), S(0), S(0), S(1);
    const auto fused = fuse_fixes(subnets, std::array{fix});
    if (fused) {
      CHECK(Ldlt<S, 2>{fused->fix.covariance}.positive_definite());
    } else {
      CHECK(fused.error() == Error::InvalidCovariance);
      ++refused;
    }
  }
  CHECK(refused > 10);
}

TEST_CASE_TEMPLATE("fixes that cannot be fused are refused by name", S, float, double) {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  auto subnets = three_subnets<S>(S(0.1));
  const auto good = fix_at<S>(subnets, 1, {5, 1}, S(0.1));
  const auto other = fix_at<S>(subnets, 2, {5, 1}, S(0.1));
  const auto error = [&](const Fixes<S>& fixes, FuseOptions<S> options = {}) {
    const auto fused = fuse_fixes(subnets, fixes, options);
    const auto learned = fuse_and_learn(subnets, fixes, options);
    REQUIRE_FALSE(fused);
    REQUIRE_FALSE(learned);
    CHECK(fused.error() == learned.error());
    return fused.error();
  };
  CHECK(error({}) == Error::TooFewMeasurements);
  CHECK(error({good, good, good, good, good}) == Error::TooManyMeasurements);
  CHECK(error({good, good}) == Error::DuplicateSubnet);
  auto bad = other;
  bad.subnet = 17;
  CHECK(error({good, bad}) == Error::UnknownSubnet);
  bad = other;
  bad.fix.position[1] = nan;
  CHECK(error({good, bad}) == Error::NotFinite);
  bad = other;
  bad.fix.covariance(0, 0) = nan;
  CHECK(error({good, bad}) == Error::NotFinite);
  bad.fix.covariance.setZero();
  CHECK(error({bad}) == Error::InvalidCovariance);
  bad.fix.covariance << 1, 2, 2, 1;
  CHECK(error({good, bad}) == Error::InvalidCovariance);
  // As far apart as the scalar goes: an answer without a NaN, or what is wrong by name.
  for (const S far : {S(1e18), S(1e25), S(1e37)}) {
    bad = other;
    bad.fix.position = {far, -far};
    bad.fix.covariance << S(0.01), S(0.005), S(0.005), S(0.01);
    const auto fused = fuse_fixes(subnets, std::array{good, bad});
    if (fused) {
      CHECK(fused->disagreement >= S(0));
      CHECK(std::isfinite(fused->fix.chi_squared));
      CHECK(Ldlt<S, 2>{fused->fix.covariance}.positive_definite());
    } else {
      const bool named =
          fused.error() == Error::NumericOverflow || fused.error() == Error::InvalidCovariance;
      CHECK(named);
    }
  }
  CHECK(error({good}, {.gate = 0}) == Error::InvalidOption);
  CHECK(error({good}, {.gate = nan}) == Error::InvalidOption);
  CHECK(error({good}, {.preference = S(0.5)}) == Error::InvalidOption);
  CHECK(error({good}, {.correlated_fixes = S(0.5)}) == Error::InvalidOption);
  CHECK(error({good}, {.correlated_fixes = std::numeric_limits<S>::infinity()}) ==
        Error::InvalidOption);
  CHECK(fuse_fixes(subnets, Fixes<S>{good, other}));
}

}  // namespace tests::frames_fuse_fixes
