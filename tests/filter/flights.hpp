// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Simulated runs for trackers: a hall with eight anchors, a point that moves as the constant
/// velocity model says, a body that flies a smooth course with an inertial unit, and what radios
/// measure of them.

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/filter/measurements.hpp"
#include "uwbpos/filter/motion/constant_velocity.hpp"
#include "uwbpos/sim/flight.hpp"
#include "uwbpos/sim/noise.hpp"

namespace uwbpos::test {

inline constexpr std::uint32_t kHallAnchors = 8;
inline constexpr std::int64_t kSlot = 10'000;  // from one measurement to the next [µs]

/// Around a hall of 12 m × 10 m, high and low by turns.
inline Vec<double, 3> hall_anchor(std::uint32_t id) {
  const double angle = 2 * 3.14159265358979 * id / kHallAnchors;
  return {6 + 7 * std::cos(angle), 5 + 6 * std::sin(angle), id % 2 == 0 ? 3.0 : 0.3};
}

/// Tells a tracker of these anchors.
template <class Tracker>
void hang_anchors(Tracker& tracker) {
  using S = typename Tracker::S;
  for (std::uint32_t id = 0; id < kHallAnchors; ++id) {
    static_cast<void>(tracker.add_anchor(id, hall_anchor(id).cast<S>()));
  }
}

/// The true distance to an anchor.
inline double hall_range(std::uint32_t id, const Vec<double, 3>& place) {
  return (place - hall_anchor(id)).norm();
}

/// A point driven by white acceleration, for some ten seconds within the hall. Moved in steps of a
/// slot.
class Wanderer {
 public:
  Wanderer(sim::Random& random, double acceleration) : random_{random}, motion_{acceleration} {
    state_ << 6, 5, 1.5, random.normal(0, 0.3), random.normal(0, 0.3), random.normal(0, 0.1);
  }

  void step() {
    const auto step = motion_.propagate(state_, {}, 1e-6 * kSlot);
    for (int k = 0; k < 6; ++k) {
      state_ += step.g.col(k) * (std::sqrt(step.q[k]) * random_.normal());
    }
  }

  [[nodiscard]] const Vec<double, 6>& state() const { return state_; }
  [[nodiscard]] Vec<double, 3> position() const { return state_.head<3>(); }

 private:
  sim::Random& random_;
  ConstantVelocity<double, 3> motion_;
  Vec<double, 6> state_;
};

/// A body on a smooth course through the hall, as a multicopter flies.
struct Course {
  double phase = 0;

  [[nodiscard]] Vec<double, 3> position(double t) const {
    return {6 + 3 * std::sin(0.5 * t + phase), 5 + 2.5 * std::sin(0.7 * t + 2 * phase),
            1.5 + 0.4 * std::sin(0.9 * t)};
  }
  [[nodiscard]] Vec<double, 3> velocity(double t) const {
    return {1.5 * std::cos(0.5 * t + phase), 1.75 * std::cos(0.7 * t + 2 * phase),
            0.36 * std::cos(0.9 * t)};
  }
  [[nodiscard]] Vec<double, 3> acceleration(double t) const {
    return {-0.75 * std::sin(0.5 * t + phase), -1.225 * std::sin(0.7 * t + 2 * phase),
            -0.324 * std::sin(0.9 * t)};
  }
  [[nodiscard]] double heading(double t) const { return 0.8 * std::sin(0.4 * t + phase); }
  /// Leans into its acceleration, and looks where `heading` says.
  [[nodiscard]] Quaternion<double> orientation(double t) const {
    return sim::leaning(acceleration(t), heading(t));
  }
};

/// The inertial unit of a body on a course: constant biases and white noise.
struct CourseImu {
  Course course;
  double period = 0.005;
  Vec<double, 3> gyro_bias = Vec<double, 3>::Zero();
  Vec<double, 3> accelerometer_bias = Vec<double, 3>::Zero();
  double gyro_noise = 0;           ///< density
  double accelerometer_noise = 0;  ///< density

  template <class S>
  [[nodiscard]] ImuSample<S> sample(std::int64_t time, sim::Random& random) const {
    // The middle of the period that the sample stands for.
    const double t = 1e-6 * static_cast<double>(time) + period / 2;
    const Quaternion<double> back = conjugate(course.orientation(t));
    const Vec<double, 3> force =
        rotate<double>(back, course.acceleration(t) + Vec<double, 3>{0, 0, 9.80665});
    const Quaternion<double> turn = multiply<double>(back, course.orientation(t + 1e-4));
    ImuSample<S> sample{time, {}, {}};
    for (int k = 0; k < 3; ++k) {
      const double rate = 2 * turn[1 + k] / 1e-4;
      const double spread = 1 / std::sqrt(period);
      sample.gyro[k] = static_cast<S>(rate + gyro_bias[k] + gyro_noise * spread * random.normal());
      sample.accelerometer[k] = static_cast<S>(force[k] + accelerometer_bias[k] +
                                               accelerometer_noise * spread * random.normal());
    }
    return sample;
  }
};

/// How a body is measured: a range, a difference to one reference in each round of all anchors, or
/// a difference of neighbours, one a slot; blinks against the reference come all at once.
enum class Radio { Ranges, SharedDifferences, PairDifferences };

/// Feeds what the radio measures at one slot; `spoil` may change a value.
template <class Tracker, class Spoil, class Use>
void measure(Radio radio, std::int64_t time, const Vec<double, 3>& place, double sigma,
             double believed, sim::Random& random, Tracker& tracker, const Spoil& spoil,
             const Use& use) {
  using S = typename Tracker::S;
  const auto slot = static_cast<std::uint32_t>(time / kSlot);
  const std::uint32_t id = slot % kHallAnchors;
  const auto to_s = [](double x) { return static_cast<S>(x); };
  if (radio == Radio::Ranges) {
    const double range = spoil(id, hall_range(id, place) + random.normal(0, sigma));
    use(id, tracker.update(TimedRange<S>{time, id, to_s(range), to_s(believed)}));
  } else if (radio == Radio::PairDifferences) {
    const std::uint32_t next = (id + 1) % kHallAnchors;
    const double difference = hall_range(next, place) - hall_range(id, place);
    const double value = spoil(next, difference + random.normal(0, sigma));
    use(next, tracker.update(TimedDifference<S>{time, id, next, to_s(value), to_s(believed)}));
  } else if (id == 0) {
    const double arrival = hall_range(0, place) + random.normal(0, sigma);
    for (std::uint32_t other = 1; other < kHallAnchors; ++other) {
      const double value =
          spoil(other, hall_range(other, place) + random.normal(0, sigma) - arrival);
      use(other, tracker.update(TimedDifference<S>{time, 0, other, to_s(value),
                                                   to_s(believed * std::sqrt(2.0)), 0, true}));
    }
  }
}

/// For runs that nothing spoils.
inline double unspoiled(std::uint32_t, double value) { return value; }

}  // namespace uwbpos::test
