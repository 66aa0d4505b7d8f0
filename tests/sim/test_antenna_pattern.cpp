// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>

#include <doctest/doctest.h>

#include <uwbpos/sim/antenna_pattern.hpp>
#include <uwbpos/sim/flight.hpp>

namespace tests::sim_antenna_pattern {

namespace {

using namespace uwbpos;
using namespace uwbpos::sim;

Vec<double, 3> random_direction(Random& random) {
  return rotate<double>(random_rotation(random), {0, 0, 1});
}

}  // namespace

TEST_CASE("A pattern has the peak to peak asked for, mean zero, and is smooth") {
  Random random{"patterns"};
  for (int trial = 0; trial < 5; ++trial) {
    const AntennaPattern pattern = random_antenna_pattern(0.3, random);
    double low = 1;
    double high = -1;
    double sum = 0;
    double steepest = 0;
    constexpr int count = 20000;
    for (int i = 0; i < count; ++i) {
      const Vec<double, 3> u = random_direction(random);
      const Vec<double, 3> near = (u + 1e-4 * random_direction(random)).normalized();
      const double b = pattern(u);
      low = std::min(low, b);
      high = std::max(high, b);
      sum += b;
      if ((near - u).norm() > 1e-5) {
        steepest = std::max(steepest, std::abs(pattern(near) - b) / (near - u).norm());
      }
    }
    // Directions are 2° apart: (2°)²/2 times the curvature, at most 9 of its half, is below 1 %.
    CHECK(high - low == doctest::Approx(0.3).epsilon(0.01));
    CHECK(std::abs(sum / count) < 4 * 0.15 / std::sqrt(1.0 * count));
    // Bernstein: a polynomial of degree three within ±0.15 m about its middle.
    CHECK(steepest < 3 * 0.15 * 1.01);
  }
}

TEST_CASE("Harmonics are orthonormal: the mean square is the sum of squared coefficients") {
  Random random{"harmonics"};
  AntennaPattern pattern;
  double squares = 0;
  for (double& c : pattern.coefficients) {
    c = random.normal();
    squares += c * c;
  }
  double sum = 0;
  constexpr int count = 100000;
  for (int i = 0; i < count; ++i) {
    const double b = pattern(random_direction(random));
    sum += b * b / count;
  }
  // A square's spread is some one and a half of its mean: four sigmas.
  CHECK(sum == doctest::Approx(squares).epsilon(0.02));
}

TEST_CASE("A link's bias is the tag's in its frame plus the anchor's, looking back") {
  Random random{"links"};
  const Antenna tag{random_antenna_pattern(0.1, random), random_rotation(random)};
  const Antenna anchor{random_antenna_pattern(0.2, random), random_rotation(random)};
  const Vec<double, 3> offset{1, -2, 0.5};
  const Vec<double, 3> u = offset.normalized();
  const double expected =
      tag.pattern(rotation_matrix(tag.map_q_antenna).transpose() * u) +
      anchor.pattern(rotation_matrix(anchor.map_q_antenna).transpose() * Vec<double, 3>{-u});
  CHECK(link_bias(tag, anchor, offset) == doctest::Approx(expected).epsilon(1e-12));
  CHECK(link_bias(tag, anchor, 3 * offset) == doctest::Approx(expected).epsilon(1e-12));
}

TEST_CASE("A flight stays in its box, leans and turns, and derivatives are what they say") {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    Random random{seed};
    const Flight flight = random_flight({1, 1, 0.5}, {9, 7, 3}, random);
    double lean = 0;
    double left = 0;
    double right = 0;
    for (double t = 0; t < 120; t += 0.5) {
      const Vec<double, 3> p = flight.position(t);
      CHECK((p - Vec<double, 3>{5, 4, 1.75}).cwiseAbs().maxCoeff() <= 4);
      CHECK(std::abs(p(2) - 1.75) <= 1.25);
      constexpr double h = 1e-4;
      CHECK((flight.position(t + h) - flight.position(t - h) - 2 * h * flight.velocity(t)).norm() <
            1e-10);
      CHECK((flight.velocity(t + h) - flight.velocity(t - h) - 2 * h * flight.acceleration(t))
                .norm() < 1e-10);
      lean = std::max(lean, std::acos(rotate<double>(flight.attitude(t), {0, 0, 1})(2)));
      left = std::max(left, flight.heading.at(t));
      right = std::min(right, flight.heading.at(t));
    }
    CHECK(lean > 0.02);
    CHECK(lean < 0.35);
    CHECK(left - right > 3.14159);
  }
}

}  // namespace tests::sim_antenna_pattern
