// SPDX-License-Identifier: MIT
// A robot with two tags is followed through a hall: ranges come one by one, some late, some wrong,
// for a second none; its pose is asked for once a second.

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>

#include <uwbpos/filter/motion/planar_robot.hpp>
#include <uwbpos/filter/tracker.hpp>
#include <uwbpos/sim/hall.hpp>
#include <uwbpos/sim/noise.hpp>
#include <uwbpos/sim/path.hpp>

namespace {

using namespace uwbpos;

constexpr double kHeight = 0.4;  // of the robot's origin [m]
constexpr double kSigma = 0.08;  // of a range [m]

// A line a second: where the robot is believed to be, ± one standard deviation, and how far off.
void print(double t, const Tracker<PlanarRobot<float>>& tracker, const sim::BodyState& truth) {
  const auto robot = tracker.pose();
  if (!robot) {
    const auto reason = describe(robot.error());
    std::printf("%4.0f s  %.*s\n", t, static_cast<int>(reason.size()), reason.data());
    return;
  }
  const auto& pose = robot->pose;
  const auto x = static_cast<double>(pose.position[0]);
  const auto y = static_cast<double>(pose.position[1]);
  const double off = std::hypot(x - truth.position[0], y - truth.position[1]);
  const double turned = angle_difference(static_cast<double>(pose.heading), sim::heading(truth));
  const auto sigma = [&](int i) { return std::sqrt(static_cast<double>(pose.covariance(i, i))); };
  std::printf("%4.0f s  %6.2f ±%.2f %6.2f ±%.2f m  %4.0f ±%.0f deg  off by %.2f m, %.0f deg\n", t,
              x, sigma(0), y, sigma(1), radians_to_degrees(static_cast<double>(pose.heading)),
              radians_to_degrees(sigma(2)), off, radians_to_degrees(std::abs(turned)));
}

}  // namespace

int main() {
  const sim::Path path =
      sim::Circle{.centre = {10, 7, kHeight}, .radius = 4, .speed = 1.2, .laps = 1};
  const auto anchors = sim::hang_anchors({}, 6, sim::Placement::Perimeter);
  if (!anchors) return 1;

  TrackerOptions<PlanarRobot<float>> options;
  options.model.motion.height = static_cast<float>(kHeight);
  Tracker<PlanarRobot<float>> tracker{options};
  for (const auto& anchor : *anchors) {
    if (!tracker.add_anchor(anchor.id, anchor.position.cast<float>())) return 1;
  }
  const Vec<double, 3> levers[2] = {{0.1, 0.25, 0.1}, {0.1, -0.25, 0.1}};
  for (std::uint32_t tag = 0; tag < 2; ++tag) {
    if (!tracker.add_tag(tag, levers[tag].cast<float>())) return 1;
  }

  sim::Random random{"a robot in a hall"};
  std::optional<TimedRange<float>> late;
  std::uint32_t round = 0;
  for (std::int64_t time = 0; time < 20'000'000; time += 10'000, ++round) {
    const double t = 1e-6 * static_cast<double>(time);
    const sim::BodyState truth = sim::state_at(path, t);
    if (time % 1'000'000 == 0) {
      static_cast<void>(tracker.predict_to(time));
      print(t, tracker, truth);
    }
    if (t > 12 && t < 13) continue;  // behind a lorry

    const auto& anchor = (*anchors)[static_cast<int>(round) % anchors->size()];
    const std::uint32_t tag = round / 6 % 2;
    const Vec<double, 3> place = sim::tag_motion(truth, levers[tag]).position;
    double range = (place - anchor.position).norm() + random.normal(0, kSigma);
    if (random.chance(0.05)) range += random.uniform(1, 10);  // an echo
    const TimedRange<float> reading{time, anchor.id, static_cast<float>(range),
                                    static_cast<float>(kSigma), tag};
    // One in ten is told after the next.
    if (!late && random.chance(0.1)) {
      late = reading;
      continue;
    }
    static_cast<void>(tracker.update(reading));
    if (late) static_cast<void>(tracker.update(*late));
    late.reset();
  }
  const GateCounters& counters = tracker.counters();
  std::printf("%u ranges used, %u refused as outliers, %u as out of reach\n", counters.used(),
              counters.refused(Error::OutlierRejected), counters.refused(Error::Unreachable));
  return 0;
}
