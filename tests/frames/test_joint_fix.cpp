// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include "uwbpos/frames/joint_fix.hpp"

#include "frames/scenes.hpp"
#include "support/dense.hpp"
#include "support/nees.hpp"
#include "support/statistics.hpp"

namespace tests::frames_joint_fix {

using namespace uwbpos;

namespace {

template <class S, int D>
Sighting<S, D> random_sighting(sim::Random& random, int slot) {
  const auto map_T_subnet = test::random_transform<S, D>(random);
  return {.position = test::random_in_cube<S, D>(random, S(1)),
          .noise = test::random_covariance<S, D>(random, 0.05, 0.3),
          .jacobian = point_jacobian(map_T_subnet, test::random_in_cube<S, D>(random, S(10))),
          .slot = slot};
}

// Transforms whose errors are known to each other: any positive definite joint covariance.
template <class S, int D, int Slots>
TransformErrors<S, D, Slots> random_errors(sim::Random& random) {
  TransformErrors<S, D, Slots> errors;
  errors.covariance =
      test::random_covariance<S, TransformErrors<S, D, Slots>::kSize>(random, 0.003, 0.03);
  return errors;
}

// Everything at once: the stacked system's generalised least squares, by dense inverses.
template <int D, int Slots>
JointFix<double, D> stacked(const std::vector<Sighting<double, D>>& sightings,
                            const TransformErrors<double, D, Slots>& errors) {
  constexpr int K = kTransformDof<D>;
  const std::size_t n = sightings.size();
  test::Dense omega{n * D, n * D};
  test::Dense design{n * D, D};
  test::Dense z{n * D, 1};
  for (std::size_t i = 0; i < n; ++i) {
    const auto& a = sightings[i];
    design.put(i * D, 0, Mat<double, D>::Identity());
    z.put(i * D, 0, a.position);
    for (std::size_t j = 0; j < n; ++j) {
      const auto& b = sightings[j];
      const Mat<double, K> p = errors.covariance.template block<K, K>(a.slot * K, b.slot * K);
      Mat<double, D> block = product(product(a.jacobian, p), transposed(b.jacobian));
      if (i == j) block += a.noise;
      omega.put(i * D, j * D, block);
    }
  }
  const test::Dense weight = test::inverse(omega);
  const test::Dense covariance = test::inverse(test::transposed(design) * weight * design);
  const test::Dense position = covariance * (test::transposed(design) * (weight * z));
  const test::Dense r = z - design * position;
  JointFix<double, D> fix{};
  for (int i = 0; i < D; ++i) {
    const auto row = static_cast<std::size_t>(i);
    fix.position[i] = position(row, 0);
    for (int k = 0; k < D; ++k) fix.covariance(i, k) = covariance(row, static_cast<std::size_t>(k));
  }
  fix.chi_squared = (test::transposed(r) * (weight * r))(0, 0);
  fix.degrees_of_freedom = (static_cast<int>(n) - 1) * D;
  return fix;
}

template <class S, int D>
void agrees_with_stacked(sim::Random& random) {
  for (int trial = 0; trial < 100; ++trial) {
    const int count = random.integer(1, 4);
    std::vector<int> slots{0, 1, 2, 3};
    test::shuffle(random, slots);
    std::vector<Sighting<S, D>> sightings;
    for (int i = 0; i < count; ++i) {
      sightings.push_back(random_sighting<S, D>(random, slots[static_cast<std::size_t>(i)]));
    }
    const auto prior = random_errors<S, D, 4>(random);
    auto errors = prior;
    const auto joint = joint_fix<S, D, 4>(sightings, errors);
    REQUIRE(joint);

    std::vector<Sighting<double, D>> wide;
    for (const auto& s : sightings) {
      wide.push_back({s.position.template cast<double>(), s.noise.template cast<double>(),
                      s.jacobian.template cast<double>(), s.slot});
    }
    TransformErrors<double, D, 4> wide_prior;
    wide_prior.covariance = prior.covariance.template cast<double>();
    const auto expected = stacked<D, 4>(wide, wide_prior);
    // Conditions up to a hundred, sums over 24 unknowns.
    const double tolerance = 2e4 * static_cast<double>(std::numeric_limits<S>::epsilon());
    CHECK((joint->position.template cast<double>() - expected.position).norm() < tolerance);
    CHECK((joint->covariance.template cast<double>() - expected.covariance).norm() <
          tolerance * expected.covariance.norm());
    CHECK(static_cast<double>(joint->chi_squared) ==
          doctest::Approx(expected.chi_squared).epsilon(tolerance).scale(1));
    CHECK(joint->degrees_of_freedom == expected.degrees_of_freedom);
    CHECK(errors.covariance == errors.covariance.transpose());
    if (count == 1) {
      CHECK(errors.mean.isZero(0));
      CHECK(errors.covariance == prior.covariance);
    }
  }
}

// Positions and transforms' errors drawn from what is claimed, 4,000 times.
template <class S, int D>
void honest(sim::Random& random) {
  constexpr int N = TransformErrors<S, D, 2>::kSize;
  constexpr int trials = 4000;
  double position_error = 0;
  double transform_error = 0;
  double disagreement = 0;
  for (int trial = 0; trial < trials; ++trial) {
    std::array<Sighting<S, D>, 2> sightings{random_sighting<S, D>(random, 0),
                                            random_sighting<S, D>(random, 1)};
    auto errors = random_errors<S, D, 2>(random);
    const Vec<double, N> xi =
        test::draw<N>(random, Mat<double, N>{errors.covariance.template cast<double>()});
    const Vec<double, D> truth = test::random_in_cube<double, D>(random, 1.0);
    for (auto& s : sightings) {
      const Vec<double, D> noise =
          test::draw<D>(random, Mat<double, D>{s.noise.template cast<double>()});
      const Vec<double, kTransformDof<D>> own =
          xi.template segment<kTransformDof<D>>(s.slot * kTransformDof<D>);
      s.position = (truth - s.jacobian.template cast<double>() * own + noise).template cast<S>();
    }
    const auto joint = joint_fix<S, D, 2>(sightings, errors);
    REQUIRE(joint);
    position_error +=
        test::normalised_squared_error<S, D>(joint->position, joint->covariance, truth);
    transform_error += test::normalised_squared_error<S, N>(errors.mean, errors.covariance, xi);
    disagreement += static_cast<double>(joint->chi_squared);
  }
  const auto within = [&](double sum, int dimension) {
    return test::mean_nees_interval(dimension, trials, 0.999).contains(sum / trials);
  };
  CHECK(within(position_error, D));
  CHECK(within(transform_error, N));
  CHECK(within(disagreement, D));
}

}  // namespace

TEST_CASE_TEMPLATE("one fix after the other gives what all at once would", S, float, double) {
  sim::Random random{"joint fix stacked"};
  agrees_with_stacked<S, 2>(random);
  agrees_with_stacked<S, 3>(random);
}

TEST_CASE_TEMPLATE("fix, transforms and disagreement are as far off as claimed", S, float, double) {
  sim::Random random{"joint fix honest"};
  honest<S, 2>(random);
  honest<S, 3>(random);
}

TEST_CASE_TEMPLATE("independent fixes are weighted by their information", S, float, double) {
  sim::Random random{"information"};
  for (int trial = 0; trial < 50; ++trial) {
    std::array<Sighting<S, 2>, 2> s{random_sighting<S, 2>(random, 0),
                                    random_sighting<S, 2>(random, 1)};
    TransformErrors<S, 2, 2> none;
    const auto joint = joint_fix<S, 2, 2>(s, none);
    REQUIRE(joint);
    const Mat<S, 2> a = s[0].noise.inverse();
    const Mat<S, 2> b = s[1].noise.inverse();
    const Mat<S, 2> c = (a + b).inverse();
    CHECK((joint->covariance - c).norm() < S(1e-4) * c.norm());
    CHECK((joint->position - c * (a * s[0].position + b * s[1].position)).norm() < S(1e-4));
  }
}

TEST_CASE_TEMPLATE("an error that two subnets share is neither averaged nor a disagreement", S,
                   float, double) {
  // Both transforms are off by the same unknown metre; noise is 0.1 m each.
  TransformErrors<S, 2, 2> errors;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) errors.covariance.template block<2, 2>(3 * i, 3 * j).setIdentity();
  }
  std::array<Sighting<S, 2>, 2> s;
  for (int k = 0; k < 2; ++k) {
    auto& sighting = s[static_cast<std::size_t>(k)];
    sighting.position = Vec<S, 2>::Zero();
    sighting.noise = Mat<S, 2>::Identity() * S(0.01);
    sighting.jacobian.setZero();
    sighting.jacobian.template leftCols<2>().setIdentity();
    sighting.slot = k;
  }
  s[1].position = {S(0.2), 0};
  const auto joint = joint_fix<S, 2, 2>(s, errors);
  REQUIRE(joint);
  CHECK(joint->position[0] == doctest::Approx(0.1).epsilon(1e-4));
  CHECK(joint->covariance(0, 0) == doctest::Approx(1.005).epsilon(1e-4));
  // What rounding may have lost counts as noise: 32 ε of 4 m² is 8e-4 of 0.02 m² in float.
  CHECK(joint->chi_squared == doctest::Approx(0.2 * 0.2 / 0.02).epsilon(1e-3));
}

TEST_CASE_TEMPLATE("a fix that is good in one direction alone is good in it, whatever the order", S,
                   float, double) {
  for (const std::size_t long_one : {0U, 1U}) {
    std::array<Sighting<S, 2>, 2> s;
    for (std::size_t i = 0; i < 2; ++i) {
      s[i] = {.position = i == long_one ? Vec<S, 2>{0, 0} : Vec<S, 2>{S(0.1), S(0.1)},
              .noise = S(0.01) * Mat<S, 2>::Identity(),
              .jacobian = point_jacobian(Transform<S, 2>{}, {0, 0}),
              .slot = static_cast<int>(i)};
    }
    s[long_one].noise.diagonal() << S(1e4), S(1e-4);
    TransformErrors<S, 2, 2> errors;
    const auto joint = joint_fix<S, 2, 2>(s, errors);
    REQUIRE(joint);
    CHECK(joint->covariance(0, 0) == doctest::Approx(0.01).epsilon(0.01));
    CHECK(joint->covariance(1, 1) == doctest::Approx(1e-4 / 1.01).epsilon(0.02));
    CHECK(joint->position[1] == doctest::Approx(0.1 * 0.01 / 1.01).epsilon(0.3));
  }
}

TEST_CASE("the gate is the quantile it approximates") {
  for (const int dof : {2, 3, 4, 6, 9}) {
    for (const double sigmas : {2.0, 3.0, 4.0}) {
      const double share = 1 - std::erfc(sigmas / std::sqrt(2.0)) / 2;
      const double exact = test::chi_squared_quantile(share, dof);
      CAPTURE(dof);
      CAPTURE(sigmas);
      CHECK(chi_squared_gate(dof, sigmas) == doctest::Approx(exact).epsilon(0.06));
    }
  }
}

TEST_CASE_TEMPLATE("a good fix keeps its covariance beside one that says next to nothing", S, float,
                   double) {
  // Subtracted from the worse covariance, the better one would vanish in rounding.
  const S worse = S(4e-4) / std::numeric_limits<S>::epsilon();
  for (const bool good_first : {false, true}) {
    std::array<Sighting<S, 2>, 2> s;
    for (int i = 0; i < 2; ++i) {
      s[static_cast<std::size_t>(i)] = {.position = {S(1), S(2)},
                                        .noise = S(1e-4) * Mat<S, 2>::Identity(),
                                        .jacobian = point_jacobian(Transform<S, 2>{}, {S(1), S(2)}),
                                        .slot = i};
    }
    TransformErrors<S, 2, 2> errors;
    const int bad = good_first ? 3 : 0;
    errors.covariance.diagonal().template segment<2>(bad).setConstant(worse);
    const auto joint = joint_fix<S, 2, 2>(s, errors);
    REQUIRE(joint);
    CHECK(joint->covariance(0, 0) == doctest::Approx(1e-4).epsilon(0.01));
    CHECK(joint->covariance(1, 1) == doctest::Approx(1e-4).epsilon(0.01));
    CHECK(std::abs(joint->covariance(0, 1)) < S(1e-8));
  }
}

TEST_CASE_TEMPLATE("fixes with no covariance are refused", S, float, double) {
  sim::Random random{"joint fix refused"};
  std::array<Sighting<S, 2>, 2> s{random_sighting<S, 2>(random, 0),
                                  random_sighting<S, 2>(random, 1)};
  s[0].noise.setZero();
  s[1].noise.setZero();
  TransformErrors<S, 2, 2> none;
  CHECK(joint_fix<S, 2, 2>(s, none).error() == Error::InvalidCovariance);
}

}  // namespace tests::frames_joint_fix
