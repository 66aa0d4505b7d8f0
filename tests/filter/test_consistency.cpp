// SPDX-License-Identifier: MIT
#include <cmath>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/filter/motion/inertial.hpp"
#include "uwbpos/filter/tracker.hpp"

#include "filter/flights.hpp"
#include "support/nees.hpp"
#include "support/statistics.hpp"

namespace tests::filter_consistency {

// Normalised squared errors of states (NEES) at the end of independent runs, and of innovations
// (NIS) over all of them, against their χ² intervals.

namespace {

using namespace uwbpos;
using test::Radio;

constexpr int kRuns = 100;
constexpr int kFewRuns = 30;  // are enough to show a wrong noise
constexpr double kSigma = 0.1;
constexpr std::int64_t kFlight = 5'000'000;  // [µs]

struct Consistency {
  std::vector<double> nees;
  std::vector<double> nis;
  int refused = 0;
  int reopened = 0;

  void take(const Result<TrackUpdate<double>>& told, std::int64_t time) {
    if (!told) {
      ++refused;
    } else if (told->event == TrackEvent::Reopened) {
      ++reopened;
    } else if (told->event == TrackEvent::Used && told->innovation.dimension > 0 &&
               time > 2'000'000) {
      nis.push_back(told->innovation.normalised_square);
    }
  }
};

// Both inside the 95 % interval of their mean.
void check_inside(const std::string& what, const Consistency& c, int dimension) {
  const auto nees = test::mean_nees_interval(dimension, c.nees.size(), 0.95);
  const auto nis = test::mean_nees_interval(1, c.nis.size(), 0.95);
  MESSAGE(what << ": NEES " << test::mean(c.nees) << " in [" << nees.low << ", " << nees.high
               << "], NIS " << test::mean(c.nis) << " in [" << nis.low << ", " << nis.high << "]");
  CHECK(c.nees.size() == kRuns);
  CHECK(nees.contains(test::mean(c.nees)));
  CHECK(nis.contains(test::mean(c.nis)));
  CHECK(c.reopened == 0);
}

// Both outside.
void check_outside(const Consistency& c, int dimension) {
  CHECK_FALSE(
      test::mean_nees_interval(dimension, c.nees.size(), 0.95).contains(test::mean(c.nees)));
  CHECK_FALSE(test::mean_nees_interval(1, c.nis.size(), 0.95).contains(test::mean(c.nis)));
}

// Points that wander for 8 s; what is believed of their noises is wrong by these factors.
Consistency wander(Radio radio, double of_process, double of_measurement, int runs) {
  constexpr double kAcceleration = 0.5;
  Consistency result;
  for (int run = 0; run < runs; ++run) {
    sim::Random random{"consistency " + std::to_string(run)};
    test::Wanderer truth{random, kAcceleration};
    TrackerOptions<ConstantVelocity<double, 3>> options;
    options.model.motion.acceleration = of_process * kAcceleration;
    // So wide that it cuts nothing from the statistics, which a narrower gate would.
    options.model.gate.sigmas = 8;
    Tracker<ConstantVelocity<double, 3>> tracker{options};
    test::hang_anchors(tracker);
    std::int64_t time = 0;
    for (; time < 8'000'000; time += test::kSlot) {
      test::measure(radio, time, truth.position(), kSigma, of_measurement * kSigma, random, tracker,
                    test::unspoiled, [&](auto, const auto& told) { result.take(told, time); });
      truth.step();
    }
    REQUIRE(tracker.predict_to(time));
    const auto pose = tracker.pose();
    REQUIRE(pose);
    Vec<double, 6> state;
    state << pose->position, pose->velocity;
    result.nees.push_back(
        test::normalised_squared_error<double, 6>(state, pose->covariance, truth.state()));
  }
  return result;
}

// Bodies with an inertial unit, whose noises are believed wrong by these factors.
Consistency fly(Radio radio, double of_process, double of_measurement, int runs) {
  Consistency result;
  for (int run = 0; run < runs; ++run) {
    sim::Random random{"consistency in flight " + std::to_string(run)};
    TrackerOptions<Inertial<double>> options;
    auto& motion = options.model.motion;
    test::CourseImu imu{.course = {random.uniform(0, 6)}, .period = 1e-6 * test::kSlot};
    // As a frame that shakes makes them, so that they matter beside the radio's.
    motion.accelerometer_noise = 0.4;
    motion.gyro_noise = 0.02;
    imu.accelerometer_noise = motion.accelerometer_noise;
    imu.gyro_noise = motion.gyro_noise;
    motion.accelerometer_noise *= of_process;
    motion.gyro_noise *= of_process;
    for (int k = 0; k < 3; ++k) {
      imu.gyro_bias[k] = random.normal(0, motion.gyro_bias_sigma);
      imu.accelerometer_bias[k] = random.normal(0, motion.accelerometer_bias_sigma);
    }
    motion.gyro_wander = motion.accelerometer_wander = 1e-6;
    options.model.gate.sigmas = 8;
    options.heading = Measured<double>{imu.course.heading(0) + random.normal(0, 0.1), 0.01};
    Tracker<Inertial<double>> tracker{options};
    test::hang_anchors(tracker);
    std::int64_t time = 0;
    for (; time < kFlight; time += test::kSlot) {
      static_cast<void>(tracker.update(imu.sample<double>(time, random)));
      const Vec<double, 3> place = imu.course.position(1e-6 * static_cast<double>(time));
      test::measure(radio, time, place, kSigma, of_measurement * kSigma, random, tracker,
                    test::unspoiled, [&](auto, const auto& told) { result.take(told, time); });
    }
    REQUIRE(tracker.predict_to(time));
    const auto pose = tracker.pose();
    REQUIRE(pose);
    const double t = 1e-6 * static_cast<double>(time);
    // Position and velocity; what they say of the attitude they have from the same errors.
    Vec<double, 6> state;
    state << pose->body.position, pose->body.velocity;
    Vec<double, 6> truth;
    truth << imu.course.position(t), imu.course.velocity(t);
    Mat<double, 6> p;
    p << pose->covariance.topLeftCorner<3, 3>(), pose->covariance.block<3, 3>(0, 6),
        pose->covariance.block<3, 3>(6, 0), pose->covariance.block<3, 3>(6, 6);
    result.nees.push_back(test::normalised_squared_error<double, 6>(state, p, truth));
  }
  return result;
}

}  // namespace

TEST_CASE("consistency: points seen by ranges, by differences, alone and shared") {
  check_inside("ranges", wander(Radio::Ranges, 1, 1, kRuns), 6);
  check_inside("differences of pairs", wander(Radio::PairDifferences, 1, 1, kRuns), 6);
  check_inside("differences of one arrival", wander(Radio::SharedDifferences, 1, 1, kRuns), 6);
}

TEST_CASE("consistency: noises believed wrong by three show") {
  for (const Radio radio : {Radio::Ranges, Radio::PairDifferences, Radio::SharedDifferences}) {
    for (const double factor : {1.0 / 3, 3.0}) {
      check_outside(wander(radio, factor, 1, kFewRuns), 6);
      check_outside(wander(radio, 1, factor, kFewRuns), 6);
    }
  }
}

TEST_CASE("consistency: bodies with an inertial unit") {
  check_inside("inertial, ranges", fly(Radio::Ranges, 1, 1, kRuns), 6);
  check_inside("inertial, differences of pairs", fly(Radio::PairDifferences, 1, 1, kRuns), 6);
  check_inside("inertial, differences of one arrival", fly(Radio::SharedDifferences, 1, 1, kRuns),
               6);
}

TEST_CASE("consistency: noises of bodies with an inertial unit believed wrong by three show") {
  // An inertial unit says less about innovations than wandering does: more runs.
  for (const double factor : {1.0 / 3, 3.0}) {
    check_outside(fly(Radio::Ranges, factor, 1, kRuns), 6);
    check_outside(fly(Radio::Ranges, 1, factor, kFewRuns), 6);
  }
}

}  // namespace tests::filter_consistency
