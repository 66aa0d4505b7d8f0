// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A flight of a multicopter through a box: along each axis, and in heading, a sum of three sines
/// whose frequencies, phases and shares chance chooses; it leans so that its thrust points along
/// the acceleration less gravity.

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/sim/noise.hpp"

namespace uwbpos::sim {

/// A sum of sines; its derivatives are exact.
struct SlowWander {
  /// One of them.
  struct Sine {
    double amplitude = 0;  ///< in units of the sum
    double rate = 0;       ///< [rad/s]
    double phase = 0;      ///< [rad]
  };
  std::array<Sine, 3> sines{};  ///< what is summed

  /// The derivative of this order, 0 … 2, at time t [s].
  [[nodiscard]] double at(double t, int order = 0) const {
    double sum = 0;
    for (const Sine& s : sines) {
      sum += s.amplitude * std::pow(s.rate, order) *
             std::sin(s.rate * t + s.phase + order * std::numbers::pi / 2);
    }
    return sum;
  }
};

/// Never farther from zero than `reach`; rates in [slow, fast] [rad/s].
[[nodiscard]] inline SlowWander random_wander(double reach, double slow, double fast,
                                              Random& random) {
  SlowWander wander;
  double sum = 0;
  for (SlowWander::Sine& s : wander.sines) {
    s = {random.uniform(0.3, 1), random.uniform(slow, fast),
         random.uniform(0, 2 * std::numbers::pi)};
    sum += s.amplitude;
  }
  for (SlowWander::Sine& s : wander.sines) s.amplitude *= reach / sum;
  return wander;
}

/// How a multicopter lies that flies with this acceleration [m/s²] and looks that way [rad]:
/// heading first, then the lean.
[[nodiscard]] inline Quaternion<double> leaning(const Vec<double, 3>& acceleration,
                                                double heading) {
  constexpr double gravity = 9.80665;
  const Vec<double, 3> force = acceleration + Vec<double, 3>{0, 0, gravity};
  return multiply<double>(quaternion_between<double>({0, 0, 1}, force),
                          quaternion_from_yaw<double>(heading));
}

/// Where the body is and how it lies at any time.
struct Flight {
  Vec<double, 3> centre = Vec<double, 3>::Zero();  ///< [m]
  std::array<SlowWander, 3> axes{};                ///< x, y, z less the centre [m]
  SlowWander heading{};                            ///< [rad]

  /// Position [m] at time t [s].
  [[nodiscard]] Vec<double, 3> position(double t) const { return centre + along(t, 0); }
  /// Velocity [m/s].
  [[nodiscard]] Vec<double, 3> velocity(double t) const { return along(t, 1); }
  /// Acceleration [m/s²].
  [[nodiscard]] Vec<double, 3> acceleration(double t) const { return along(t, 2); }
  /// Attitude.
  [[nodiscard]] Quaternion<double> attitude(double t) const {
    return leaning(acceleration(t), heading.at(t));
  }

 private:
  [[nodiscard]] Vec<double, 3> along(double t, int order) const {
    return {axes[0].at(t, order), axes[1].at(t, order), axes[2].at(t, order)};
  }
};

/// A flight within the box between two corners [m] at some 1 … 2 m/s in boxes of ten metres,
/// turning both ways and leaning up to some fifteen degrees.
[[nodiscard]] inline Flight random_flight(const Vec<double, 3>& low, const Vec<double, 3>& high,
                                          Random& random) {
  Flight flight;
  flight.centre = (low + high) / 2;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    flight.axes[axis] = random_wander((high(i) - low(i)) / 2, 0.15, 0.9, random);
  }
  flight.heading = random_wander(3 * std::numbers::pi, 0.05, 0.3, random);
  return flight;
}

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
