// SPDX-License-Identifier: MIT
// Trackers fed with ranges at 200 Hz, now and then one late, wrong or lost, and with recordings; a
// call is a measurement with its step of time, the pose asked for beside it.
#include "uwbpos/filter/tracker.hpp"

#include "uwbpos/filter/motion/constant_velocity.hpp"
#include "uwbpos/filter/motion/inertial.hpp"
#include "uwbpos/filter/motion/planar_body.hpp"
#include "uwbpos/filter/motion/planar_robot.hpp"

#include "bench.hpp"

namespace firmware::tracker {

using namespace uwbpos;

namespace {

constexpr TrackerSize kSize{.anchors = 8, .tags = 3, .biases = 0, .window = 16, .stride = 4};
constexpr std::uint32_t kAnchors = 8;

// Of the corners of a hall, high and low.
Vec<float, 3> anchor_place(std::uint32_t id) {
  return {(id & 1u) != 0 ? 12.0f : 0.0f, (id & 2u) != 0 ? 10.0f : 0.0f,
          ((id >> 2) ^ id) % 2 != 0 ? 0.5f : 4.0f};
}

// An anchor or a tag, told before the first measurement.
struct Place {
  std::uint32_t id;
  Vec<float, 3> position;
};

// What all cases have in common. `F` says what is fed (`Input`, `feed`), to which tracker
// (`options`, `anchors`, `tags`), and when its pose is asked for (`asks`).
template <class F, class M, TrackerSize Size = kSize>
struct Flight {
  using Motion = M;
  static constexpr bool kStateful = true;
  using Output = std::pair<Result<TrackEvent>, Result<typename M::Pose>>;
  template <class Event>
  static Output run(const Event& in) {
    static Tracker<M, Size> tracker = [] {
      Tracker<M, Size> made{F::options()};
      for (const Place& anchor : F::anchors()) {
        static_cast<void>(made.add_anchor(anchor.id, anchor.position));
      }
      for (const Place& tag : F::tags()) static_cast<void>(made.add_tag(tag.id, tag.position));
      return made;
    }();
    const auto update = F::feed(tracker, in);
    Output told{std::unexpected(Error::NotYetTracked), std::unexpected(Error::NotYetTracked)};
    if (update) {
      told.first = update->event;
    } else {
      told.first = std::unexpected(update.error());
    }
    // A late range is what shows whether the window was replayed alike.
    if (F::asks(in)) told.second = tracker.pose();
    return told;
  }
};

struct RangeOrImu {
  TimedRange<float> range;
  ImuSample<float> imu;
  bool is_imu;
};

// Round a hall, ranges alone or every other one a sample of an inertial unit.
template <class M>
struct Circling : Flight<Circling<M>, M> {
  using Motion = M;
  using Input = RangeOrImu;
  static constexpr int kRounds = 160;
  static TrackerOptions<Motion> options() {
    TrackerOptions<Motion> chosen;
    if constexpr (Motion::kHasHeading) chosen.heading = Measured<float>{0.3f, 0.01f};
    return chosen;
  }
  static std::array<Place, kAnchors> anchors() {
    std::array<Place, kAnchors> all;
    for (std::uint32_t id = 0; id < kAnchors; ++id) all[id] = {id, anchor_place(id)};
    return all;
  }
  static std::array<Place, 0> tags() { return {}; }
  static bool asks(const Input& in) { return in.range.time % 25'000 == 0; }
  template <class T>
  static auto feed(T& tracker, const Input& in) {
    return in.is_imu ? tracker.update(in.imu) : tracker.update(in.range);
  }
#ifndef FIRMWARE_TARGET
  static Vec<double, 3> place_at(double t) {
    return {6 + 2 * std::sin(t + 0.3), 5 - 2 * std::cos(t + 0.3),
            Motion::kDimension == 3 ? 1.5 : 0.0};
  }
  static std::int64_t time_of(int round) {
    return round * std::int64_t{5'000} - (round % 13 == 12 ? 11'000 : 0);  // some told late
  }
  static void make(Input& in, sim::Random& random, int round) {
    constexpr bool kFlies = Motion::kDof == 15;
    const std::int64_t time = time_of(round);
    const Vec<double, 3> place = place_at(1e-6 * static_cast<double>(time));
    in = {};
    in.range.time = in.imu.time = time;
    in.range.anchor = static_cast<std::uint32_t>(kFlies ? round / 2 : round) % kAnchors;
    in.range.sigma = 0.08f;
    const double range =
        (place - anchor_place(in.range.anchor).cast<double>()).norm() + random.normal(0, 0.08);
    in.range.range = to_float(round % 29 == 28 ? range + 3 : range);
    in.is_imu = kFlies && round % 2 == 0;
    in.imu.gyro = {0, 0, to_float(1 + random.normal(0, 0.02))};
    in.imu.accelerometer = {to_float(random.normal(0, 0.05)), 2.0f, 9.80665f};
  }
#endif
};

// One measurement of any kind.
struct Any {
  std::uint32_t kind;
  std::int64_t time;
  std::uint32_t anchor, other;
  float value, sigma;
  Vec<float, 3> vector;
};

constexpr TrackerSize kBiased{.anchors = 8, .tags = 1, .biases = 4, .window = 16, .stride = 4};

// Everything a robot can be told, in turn, with biases of anchors.
struct Kinds : Flight<Kinds, PlanarRobot<float>, kBiased> {
  using Input = Any;
  using Circle = Circling<Motion>;
  static constexpr int kRounds = 160;
  static TrackerOptions<Motion> options() { return Circle::options(); }
  static std::array<Place, kAnchors> anchors() { return Circle::anchors(); }
  static std::array<Place, 0> tags() { return {}; }
  static bool asks(const Input& in) { return in.kind == 0; }
  template <class T>
  static typename T::Told feed(T& tracker, const Input& in) {
    switch (in.kind) {
      case 1:
        return tracker.update(TimedDifference<float>{in.time, in.anchor, in.other, in.value});
      case 2:
        return tracker.update(TimedHeading<float>{in.time, in.value, in.sigma});
      case 3:
        return tracker.update(TimedSpeed<float>{in.time, in.value, in.sigma});
      case 4:
        return tracker.update(TimedTurnRate<float>{in.time, in.value, in.sigma});
      case 5:
        return tracker.update(TimedVelocity<float>{in.time, in.vector, in.sigma});
      case 6: {
        const Mat<float, 3> covariance = Mat<float, 3>::Identity() * (in.sigma * in.sigma);
        return tracker.update(TimedPosition<float>{in.time, in.vector, covariance});
      }
      case 7:
        return tracker.update(TimedHeight<float>{in.time, in.value, in.sigma});
      default:
        return tracker.update(TimedRange<float>{in.time, in.anchor, in.value, in.sigma});
    }
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int round) {
    const std::int64_t time = Circle::time_of(round);
    const double t = 1e-6 * static_cast<double>(time);
    const Vec<double, 3> place = Circle::place_at(t);
    const auto to = [&](std::uint32_t id) {
      return (place - anchor_place(id).cast<double>()).norm() + (id < 4 ? 0.1 : 0.0);
    };
    const auto anchor = static_cast<std::uint32_t>(round) % kAnchors;
    const std::uint32_t other = (anchor + 3) % kAnchors;
    in = {static_cast<std::uint32_t>(round % 3 == 2 && round > 20 ? round / 3 % 8 : 0),
          time,
          anchor,
          other,
          0,
          0.1f,
          Vec<float, 3>::Zero()};
    const double noise = random.normal(0, 0.1);
    const double heading = t + 0.3;
    switch (in.kind) {
      case 1:
        in.value = to_float(to(other) - to(anchor) + noise);
        break;
      case 2:
        in.value = to_float(heading + noise);
        break;
      case 3:
        in.value = to_float(2 + noise);
        break;
      case 4:
        in.value = to_float(1 + noise);
        break;
      case 5:
        in.vector = {to_float(2 * std::cos(heading) + noise),
                     to_float(2 * std::sin(heading) - noise), 0};
        break;
      case 6:
        in.vector = (place.array() + noise).matrix().cast<float>();
        break;
      case 7:
        in.value = 0;
        break;
      default:
        in.value = to_float(to(anchor) + noise);
    }
  }
#endif
};

// A walk among four anchors with a measured height.
struct Walk : Flight<Walk, ConstantVelocity<float, 3>> {
  using Input = Any;
  static constexpr int kRounds = 160;
  static TrackerOptions<Motion> options() { return {}; }
  static std::array<Place, 4> anchors() {
    return {Place{3, {2.58f, -0.87f, 1.97f}},
            {5, {-2.58f, 0.87f, 1.97f}},
            {9, {-1.79f, 0.87f, 0.5f}},
            {12, {-2.58f, -0.87f, 1.97f}}};
  }
  static std::array<Place, 0> tags() { return {}; }
  static bool asks(const Input& in) { return in.kind != 0; }
  template <class T>
  static typename T::Told feed(T& tracker, const Input& in) {
    if (in.kind != 0) return tracker.update(TimedHeight<float>{in.time, in.value, in.sigma});
    return tracker.update(TimedRange<float>{in.time, in.anchor, in.value, in.sigma});
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random&, int round) {
    const std::vector<Row> rows = recorded("hanyang_trajectory");
    const Row& row = rows[static_cast<std::size_t>(round)];
    in = {};
    in.kind = round % 8 == 7 ? 1 : 0;
    in.time = microseconds(row[0]);
    in.anchor = static_cast<std::uint32_t>(row[2]);
    in.value = in.kind != 0 ? 1.0f : to_float(row[3]);
    in.sigma = 0.2f;
  }
#endif
};

// A trolley with three tags.
struct Trolley : Flight<Trolley, PlanarBody<float>> {
  using Input = TimedRange<float>;
  static constexpr int kRounds = 240;
  static TrackerOptions<Motion> options() {
    TrackerOptions<Motion> chosen;
    chosen.model.motion.height = 0.96f;
    return chosen;
  }
  static std::array<Place, kAnchors> anchors() {
    return {Place{0, {-3.4203f, 3.0053f, 1.0442f}}, {1, {0.0016f, 3.0110f, 1.0446f}},
            {2, {3.6056f, 2.9795f, 1.0463f}},       {3, {3.6011f, -0.0008f, 1.0422f}},
            {4, {3.5674f, -3.0087f, 1.0443f}},      {5, {-0.0072f, -2.9652f, 1.0444f}},
            {6, {-3.4673f, -2.9587f, 1.0445f}},     {7, {-3.4858f, -0.0098f, 1.0457f}}};
  }
  static std::array<Place, 3> tags() {
    return {Place{0, {-0.0689f, -0.1423f, 0.0011f}},
            {1, {-0.0750f, 0.1402f, 0.0016f}},
            {2, {0.2034f, 0.1451f, -0.0008f}}};
  }
  static bool asks(const Input& in) { return in.anchor == 7; }
  template <class T>
  static auto feed(T& tracker, const Input& in) {
    return tracker.update(in);
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random&, int round) {
    const std::vector<Row> rows = recorded("lias_mid");
    const Row& row = rows[static_cast<std::size_t>(round)];
    in = {microseconds(row[0]), static_cast<std::uint32_t>(row[2]), to_float(row[3]), 0.1f,
          static_cast<std::uint32_t>(row[1])};
  }
#endif
};

using FlightOfPoint = Circling<ConstantVelocity<float, 3>>;
using FlightOfRobot = Circling<PlanarRobot<float>>;
using FlightOfDrone = Circling<Inertial<float>>;

}  // namespace

#define TRACKER_CASES(X)                   \
  X(tracker_point_3d, FlightOfPoint)       \
  X(tracker_point_3d_recorded, Walk)       \
  X(tracker_planar_robot, FlightOfRobot)   \
  X(tracker_planar_robot_biases, Kinds)    \
  X(tracker_planar_body_recorded, Trolley) \
  X(tracker_inertial, FlightOfDrone)
FIRMWARE_UNIT(TRACKER_CASES)

}  // namespace firmware::tracker
