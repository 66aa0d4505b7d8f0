// SPDX-License-Identifier: MIT
// Trackers fed with ranges at 200 Hz, now and then one late, wrong or lost; a call is a measurement
// with its step of time, the pose asked for beside it.
#include "uwbpos/filter/tracker.hpp"

#include "uwbpos/filter/motion/constant_velocity.hpp"
#include "uwbpos/filter/motion/inertial.hpp"
#include "uwbpos/filter/motion/planar_robot.hpp"

#include "cases/entries.hpp"

namespace uwbpos {

template <class Words, int D>
void transfer(Words& words, MovingPoint<float, D>& p) {
  firmware::transfer_all(words, p.time, p.position, p.velocity, p.covariance);
}
template <class Words>
void transfer(Words& words, RobotPose<float>& p) {
  firmware::transfer_all(words, p.time, p.pose, p.speed, p.turn_rate, p.covariance);
}
template <class Words>
void transfer(Words& words, InertialPose<float>& p) {
  firmware::transfer_all(words, p.time, p.body.position, p.body.orientation, p.body.velocity,
                         p.body.gyro_bias, p.body.accelerometer_bias, p.heading, p.heading_variance,
                         p.covariance);
}

}  // namespace uwbpos

namespace {

using namespace uwbpos;

constexpr TrackerSize kSize{.anchors = 8, .tags = 2, .biases = 0, .window = 16, .stride = 4};
constexpr std::uint32_t kAnchors = 8;

struct Event {
  TimedRange<float> range;
  ImuSample<float> imu;
  bool is_imu;
};

template <class Words>
void transfer(Words& words, Event& e) {
  firmware::transfer_all(words, e.is_imu, e.range.time, e.range.anchor, e.range.range,
                         e.range.sigma, e.range.tag, e.imu.time, e.imu.gyro, e.imu.accelerometer);
}

template <class Pose>
struct Told {
  Result<TrackEvent> event = TrackEvent::Gathered;
  Result<Pose> pose{};
};

template <class Words, class Pose>
void transfer(Words& words, Told<Pose>& t) {
  firmware::transfer_all(words, t.event, t.pose);
}

// Of the corners of a hall, high and low.
Vec<float, 3> anchor_place(std::uint32_t id) {
  return {(id & 1u) != 0 ? 12.0f : 0.0f, (id & 2u) != 0 ? 10.0f : 0.0f,
          ((id >> 2) ^ id) % 2 != 0 ? 0.5f : 4.0f};
}

template <class Motion>
TrackerOptions<Motion> options() {
  TrackerOptions<Motion> chosen;
  if constexpr (Motion::kHasHeading) chosen.heading = Measured<float>{0.3f, 0.01f};
  return chosen;
}

template <class Motion>
Tracker<Motion, kSize>& tracker() {
  static Tracker<Motion, kSize> instance{options<Motion>()};
  return instance;
}

template <class Motion>
struct Flight {
  static constexpr int kRounds = 160;
  static constexpr bool kStateful = true;
  using Input = Event;
  using Output = Told<typename Motion::Pose>;
  static Output run(const Input& in) {
    Output told;
    auto& follows = tracker<Motion>();
    if (in.range.time == 0) {
      for (std::uint32_t id = 0; id < kAnchors; ++id) {
        static_cast<void>(follows.add_anchor(id, anchor_place(id)));
      }
    }
    const auto update = in.is_imu ? follows.update(in.imu) : follows.update(in.range);
    if (update) {
      told.event = update->event;
    } else {
      told.event = std::unexpected(update.error());
    }
    // A late range is what shows whether the window was replayed alike.
    if (in.range.time % 25'000 == 0) {
      told.pose = follows.pose();
    } else {
      told.pose = std::unexpected(Error::NotYetTracked);
    }
    return told;
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int round) {
    constexpr bool kFlies = Motion::kDof == 15;
    std::int64_t time = round * std::int64_t{5'000};
    if (round % 13 == 12) time -= 11'000;  // told late
    const double t = 1e-6 * static_cast<double>(time);
    const double height = Motion::kDimension == 3 ? 1.5 : 0.0;
    const Vec<double, 3> place{6 + 2 * std::sin(t + 0.3), 5 - 2 * std::cos(t + 0.3), height};
    in = {};
    in.range.time = in.imu.time = time;
    in.range.anchor = static_cast<std::uint32_t>(kFlies ? round / 2 : round) % kAnchors;
    in.range.sigma = 0.08f;
    const double range =
        (place - anchor_place(in.range.anchor).cast<double>()).norm() + random.normal(0, 0.08);
    in.range.range = firmware::to_float(round % 29 == 28 ? range + 3 : range);
    in.is_imu = kFlies && round % 2 == 0;
    in.imu.gyro = {0, 0, firmware::to_float(1 + random.normal(0, 0.02))};
    in.imu.accelerometer = {firmware::to_float(random.normal(0, 0.05)), 2.0f, 9.80665f};
  }
#endif
};

using FlightOfPoint = Flight<ConstantVelocity<float, 3>>;
using FlightOfRobot = Flight<PlanarRobot<float>>;
using FlightOfDrone = Flight<Inertial<float>>;

}  // namespace

FIRMWARE_FUNCTION(tracker_point_3d, FlightOfPoint)
FIRMWARE_FUNCTION(tracker_planar_robot, FlightOfRobot)
FIRMWARE_FUNCTION(tracker_inertial, FlightOfDrone)

std::span<const firmware::Entry> firmware::tracker_entries() {
  static constexpr Entry kEntries[] = {FIRMWARE_ENTRY(tracker_point_3d, FlightOfPoint),
                                       FIRMWARE_ENTRY(tracker_planar_robot, FlightOfRobot),
                                       FIRMWARE_ENTRY(tracker_inertial, FlightOfDrone)};
  return kEntries;
}
