// SPDX-License-Identifier: MIT
#include "tag.hpp"

#include <cmath>

#include <uwbpos/solve/locate.hpp>

#include "text.hpp"

namespace tag {

namespace {

using namespace uwbpos;

// Enough for the stations here; 64 measurements are remembered for late ones by default.
constexpr TrackerSize kSize{.anchors = 8, .tags = 2, .biases = 0, .window = 16, .stride = 4};
using RobotTracker = Tracker<PlanarRobot<float>, kSize>;

// One exchange to a horizontal range.
Result<Measured<float>> to_range(const Exchange& exchange, const Settings& s,
                                 const RangeBias<float>& bias) {
  TwrOptions<float> radio;
  radio.antenna_delay_a = radio.antenna_delay_b = s.antenna_delay;
  const auto slant = ds_twr_range(exchange.stamps, radio);
  if (!slant) return std::unexpected(slant.error());
  const auto unbiased = correct_range_bias(*slant, exchange.power, bias);
  if (!unbiased) return std::unexpected(unbiased.error());
  return horizontal_range(*unbiased, s.stations[exchange.station][2], s.tag_height);
}

// The ranges of one tag in a round.
struct Round {
  std::array<RangeTo<float, 2>, kStations> ranges;
  std::size_t count = 0;

  [[nodiscard]] Result<Fix<float, 2>> fix() const {
    return locate(RangeSpan<float, 2>{ranges.data(), count});
  }
};

// What the columns of `print` are.
constexpr const char* kHeadline =
    "          from two tags                tracked\n"
    "  time s      x m     y m     deg          x m     y m     deg    m/s\n";

// Time, the two-tag pose, the tracked pose and speed; or why there is none.
void print(Put put, std::int64_t time, const Result<Pose2<float>>& seen,
           const Result<RobotPose<float>>& tracked) {
  const auto pose = [&](const Pose2<float>& p) {
    write_fixed(put, p.position[0], 2, 9);
    write_fixed(put, p.position[1], 2, 8);
    write_fixed(put, radians_to_degrees(p.heading), 1, 8);
  };
  const auto reason = [&](Error error) {
    put(' ');
    for (const char c : describe(error)) put(c);
  };
  write_fixed(put, static_cast<float>(time / 1000) / 1000.0f, 3, 8);
  seen ? pose(*seen) : reason(seen.error());
  write_text(put, "    ");
  if (tracked) {
    pose(tracked->pose);
    write_fixed(put, tracked->speed, 2, 7);
  } else {
    reason(tracked.error());
  }
  put('\n');
}

// No round goes on over a longer silence [µs].
constexpr std::int64_t kPause = 50'000;

}  // namespace

const Settings& settings() {
  static constexpr float kHigh = 2.5f;
  static const Settings kHall{
      {Vec<float, 3>{0, 0, kHigh}, {16, 0, kHigh}, {16, 12, kHigh}, {0, 12, kHigh}},
      0.5f,
      0.6f,
      515e-9f,
      {{{-95, 0.11f}, {-89, 0.06f}, {-83, 0}, {-77, -0.08f}}}};
  return kHall;
}

int run(Radio& radio, const Settings& s, Put put) {
  const auto bias = RangeBias<float>::make(s.power_bias);
  if (!bias) return 0;
  TrackerOptions<PlanarRobot<float>> options;
  options.model.motion.height = s.tag_height;
  // Static: a stack of a few kilobytes is enough.
  static RobotTracker tracker{options};
  for (std::uint32_t id = 0; id < kStations; ++id) {
    if (!tracker.add_anchor(id, s.stations[id])) return 0;
  }
  for (std::uint32_t tag = 0; tag < 2; ++tag) {
    if (!tracker.add_tag(tag, {0, tag == 0 ? s.baseline / 2 : -s.baseline / 2, 0})) return 0;
  }

  write_text(put, kHeadline);
  int headings = 0;
  std::array<Round, 2> round;
  std::int64_t newest = 0;
  std::size_t turn = 0;  // after that of the newest exchange; zero: the round has none
  const auto close = [&] {
    const auto left = round[0].fix();
    const auto right = round[1].fix();
    Result<Pose2<float>> pose = std::unexpected(left ? Error::TooFewMeasurements : left.error());
    if (left && right) pose = two_tag_pose(*left, *right, s.baseline);
    headings += pose ? 1 : 0;
    print(put, newest, pose, tracker.pose());
    round = {};
    turn = 0;
  };
  while (const auto exchange = radio.next()) {
    if (exchange->tag > 1 || exchange->station >= kStations) continue;
    // Stations take turns, one tag after the other; frames may be lost, the last ones too.
    const std::size_t its_turn = exchange->tag * kStations + exchange->station;
    if (turn > 0 && (its_turn < turn || exchange->time - newest > kPause)) close();
    turn = its_turn + 1;
    newest = exchange->time;
    const auto range = to_range(*exchange, s, *bias);
    if (range) {
      const float sigma = std::sqrt(range->variance);
      const Vec<float, 3>& station = s.stations[exchange->station];
      Round& of_tag = round[exchange->tag];
      if (of_tag.count < kStations) {
        of_tag.ranges[of_tag.count++] = {station.head<2>(), range->value, sigma};
      }
      // The tracker knows heights itself and takes the slant range of this horizontal one.
      const float drop = station[2] - s.tag_height;
      const float slant = std::sqrt(range->value * range->value + drop * drop);
      static_cast<void>(tracker.update(
          TimedRange<float>{exchange->time, exchange->station, slant, sigma, exchange->tag}));
    }
  }
  if (turn > 0) close();
  return headings;
}

}  // namespace tag
