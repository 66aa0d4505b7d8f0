// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Range bias that depends on how two antennas see each other (004): the group delay of an antenna
/// is a smooth function of azimuth and elevation in its own frame, here real spherical harmonics of
/// degrees one to three as polynomials of the direction \f$ u \f$,
/// \f[ b(u) = \textstyle\sum_k c_k\, Y_k(u), \qquad
///     \text{bias of a link} = b_\text{tag}(R_\text{tag}^T u) +
///                             b_\text{anchor}(-R_\text{anchor}^T u), \tag{1} \f]
/// \f$ u \f$ from tag to anchor. The mean over all directions is zero, coefficients fall off with
/// the square of the degree, and a scale makes the peak to peak what was asked for.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/sim/noise.hpp"

namespace uwbpos::sim {

/// The bias that one antenna adds, over the directions in its frame.
struct AntennaPattern {
  /// Of x, y, z; the five of degree two; the seven of degree three [m].
  std::array<double, 15> coefficients{};

  /// [m], in the direction of a unit vector.
  [[nodiscard]] double operator()(const Vec<double, 3>& u) const {
    const double x = u(0);
    const double y = u(1);
    const double z = u(2);
    // Normalised to a mean square of one over the sphere.
    const std::array<double, 15> harmonics{std::numbers::sqrt3 * x,
                                           std::numbers::sqrt3 * y,
                                           std::numbers::sqrt3 * z,
                                           std::sqrt(15.0) * x * y,
                                           std::sqrt(15.0) * y * z,
                                           std::sqrt(15.0) * z * x,
                                           std::sqrt(15.0) / 2 * (x * x - y * y),
                                           std::sqrt(5.0) / 2 * (3 * z * z - 1),
                                           std::sqrt(17.5) / 2 * y * (3 * x * x - y * y),
                                           std::sqrt(105.0) * x * y * z,
                                           std::sqrt(10.5) / 2 * y * (5 * z * z - 1),
                                           std::sqrt(7.0) / 2 * z * (5 * z * z - 3),
                                           std::sqrt(10.5) / 2 * x * (5 * z * z - 1),
                                           std::sqrt(105.0) / 2 * z * (x * x - y * y),
                                           std::sqrt(17.5) / 2 * x * (x * x - 3 * y * y)};
    double sum = 0;
    for (std::size_t i = 0; i < harmonics.size(); ++i) sum += coefficients[i] * harmonics[i];
    return sum;
  }
};

/// A pattern drawn at random with the given peak to peak [m], measured in 2000 directions.
[[nodiscard]] inline AntennaPattern random_antenna_pattern(double peak_to_peak, Random& random) {
  AntennaPattern pattern;
  for (std::size_t i = 0; i < pattern.coefficients.size(); ++i) {
    const double degree = i < 3 ? 1 : i < 8 ? 2 : 3;
    pattern.coefficients[i] = random.normal() / (degree * degree);
  }
  // Fibonacci's sphere: two degrees and a half from one direction to the next.
  constexpr int directions = 2000;
  constexpr double golden_angle = 2.39996322972865332;
  double low = 1e300;
  double high = -1e300;
  for (int i = 0; i < directions; ++i) {
    const double z = 1 - (2 * i + 1.0) / directions;
    const double level = std::sqrt(1 - z * z);
    const double b = pattern({level * std::cos(golden_angle * i),  //
                              level * std::sin(golden_angle * i), z});
    low = std::min(low, b);
    high = std::max(high, b);
  }
  for (double& c : pattern.coefficients) c *= peak_to_peak / (high - low);
  return pattern;
}

/// An antenna and how it is turned.
struct Antenna {
  AntennaPattern pattern{};  ///< over directions in the antenna's own frame
  /// Turns the antenna's frame into the map's.
  Quaternion<double> map_q_antenna = identity_quaternion<double>();
};

/// Any rotation, all equally likely.
[[nodiscard]] inline Quaternion<double> random_rotation(Random& random) {
  Quaternion<double> q;
  for (int i = 0; i < 4; ++i) q[i] = random.normal();
  return normalised<double>(q);
}

/// Equation (1) [m]. `offset`: from the tag's antenna to the anchor's, in the map; not zero.
[[nodiscard]] inline double link_bias(const Antenna& tag, const Antenna& anchor,
                                      const Vec<double, 3>& offset) {
  const Vec<double, 3> u = offset / norm(offset);
  const auto seen = [](const Antenna& antenna, const Vec<double, 3>& direction) {
    return antenna.pattern(rotate<double>(conjugate(antenna.map_q_antenna), direction));
  };
  return seen(tag, u) + seen(anchor, -u);
}

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
