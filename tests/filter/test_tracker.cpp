// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/filter/motion/planar_robot.hpp"
#include "uwbpos/filter/tracker.hpp"

#include "filter/flights.hpp"
#include "support/random_geometry.hpp"

namespace tests::filter_tracker {

namespace {

using namespace uwbpos;

constexpr double kHeight = 0.5;

template <class S>
using Robot = Tracker<PlanarRobot<S>>;

// A robot that drives circles of 3 m at 1 m/s in the hall, two tags 40 cm apart.
struct Drive {
  [[nodiscard]] static double heading(double t) { return wrap_angle(1.5707963267949 + t / 3); }
  [[nodiscard]] static Vec<double, 3> centre(double t) {
    return {6 + 3 * std::cos(t / 3), 5 + 3 * std::sin(t / 3), kHeight};
  }
  [[nodiscard]] static Vec<double, 3> lever(std::uint32_t tag) {
    return {0, tag == 0 ? 0.2 : -0.2, 0.1};
  }
  [[nodiscard]] static Vec<double, 3> place(double t, std::uint32_t tag) {
    const Vec<double, 3> l = lever(tag);
    const double c = std::cos(heading(t));
    const double s = std::sin(heading(t));
    return centre(t) + Vec<double, 3>{c * l[0] - s * l[1], s * l[0] + c * l[1], l[2]};
  }
};

template <class S>
TrackerOptions<PlanarRobot<S>> robot_options() {
  TrackerOptions<PlanarRobot<S>> options;
  options.model.motion.height = static_cast<S>(kHeight);
  options.model.motion.acceleration = S(0.3);
  options.model.motion.turn_acceleration = S(0.3);
  return options;
}

template <class S>
Robot<S> robot(bool with_tags = true,
               const TrackerOptions<PlanarRobot<S>>& options = robot_options<S>()) {
  Robot<S> tracker{options};
  test::hang_anchors(tracker);
  for (std::uint32_t tag = 0; tag < 2 && with_tags; ++tag) {
    REQUIRE(tracker.add_tag(tag, Drive::lever(tag).cast<S>()));
  }
  return tracker;
}

// The ranges of a drive, one every 10 ms, anchor by anchor, tags in turn.
template <class S>
std::vector<TimedRange<S>> ranges_of_drive(double seconds, double sigma, bool with_tags = true) {
  sim::Random random{"drive"};
  std::vector<TimedRange<S>> ranges;
  for (int i = 0; 0.01 * i < seconds; ++i) {
    const double t = 0.01 * i;
    const auto anchor = static_cast<std::uint32_t>(i) % test::kHallAnchors;
    const auto tag = static_cast<std::uint32_t>(i) / test::kHallAnchors % 2;
    const Vec<double, 3> place = with_tags ? Drive::place(t, tag) : Drive::centre(t);
    const double range = test::hall_range(anchor, place) + random.normal(0, sigma);
    ranges.push_back({i * test::kSlot, anchor, static_cast<S>(range), S(0.05), tag});
  }
  return ranges;
}

template <class S>
void check_follows(const Robot<S>& tracker, double t, double position, double heading) {
  const auto pose = tracker.pose();
  REQUIRE(pose);
  const Vec<double, 3> truth = Drive::centre(t);
  CHECK(std::hypot(static_cast<double>(pose->pose.position[0]) - truth[0],
                   static_cast<double>(pose->pose.position[1]) - truth[1]) < position);
  CHECK(std::abs(angle_difference(static_cast<double>(pose->pose.heading), Drive::heading(t))) <
        heading);
}

}  // namespace

TEST_CASE_TEMPLATE("tracker: begins by itself and follows a robot by its two tags", S, float,
                   double) {
  auto tracker = robot<S>();
  CHECK(tracker.pose().error() == Error::NotYetLocated);
  CHECK(tracker.predict_to(0).error() == Error::NotYetLocated);
  int started = 0;
  for (const auto& range : ranges_of_drive<S>(20, 0.05)) {
    const auto told = tracker.update(range);
    // 3.3 sigma are exceeded by one in a thousand, and by the first while it learns its speed.
    if (!told) CHECK(told.error() == Error::OutlierRejected);
    if (told && told->event == TrackEvent::Started) ++started;
  }
  CHECK(started == 1);
  CHECK(tracker.counters().used() > 1900);
  // Several times what the covariance says.
  check_follows(tracker, 19.99, 0.1, 0.15);
  const auto pose = tracker.pose();
  CHECK(std::sqrt(pose->pose.covariance(0, 0)) < S(0.05));
  CHECK(pose->speed == doctest::Approx(1).epsilon(0.1));
  CHECK(pose->turn_rate == doctest::Approx(1.0 / 3).epsilon(0.3));
}

TEST_CASE_TEMPLATE("tracker: a late measurement leaves the same bits as one in time", S, float,
                   double) {
  const auto ranges = ranges_of_drive<S>(8, 0.05);
  auto in_order = robot<S>();
  auto shuffled = robot<S>();
  sim::Random random{"shuffled"};
  std::vector<TimedRange<S>> waiting;
  for (const auto& range : ranges) {
    static_cast<void>(in_order.update(range));
    if (range.time < 1'000'000) {
      static_cast<void>(shuffled.update(range));
      continue;
    }
    // Up to twenty wait, and any of them may come next.
    waiting.push_back(range);
    if (waiting.size() < 20) continue;
    const auto next = static_cast<std::size_t>(random.integer(0, 19));
    std::swap(waiting[next], waiting.back());
    const auto told = shuffled.update(waiting.back());
    if (!told) CHECK(told.error() != Error::TooOld);
    waiting.pop_back();
    // None waits longer than forty turns, so that the window holds it.
    for (auto& w : waiting) {
      if (range.time - w.time < 400'000) continue;
      static_cast<void>(shuffled.update(w));
      std::swap(w, waiting.back());
      waiting.pop_back();
      break;
    }
  }
  for (const auto& range : waiting) static_cast<void>(shuffled.update(range));
  CHECK(shuffled.track().time == in_order.track().time);
  CHECK(shuffled.track().state == in_order.track().state);
  CHECK(shuffled.track().covariance.matrix() == in_order.track().covariance.matrix());
}

TEST_CASE_TEMPLATE("tracker: at the edge of its memory, the same bits or a refusal", S, float,
                   double) {
  const auto ranges = ranges_of_drive<S>(3, 0.05);
  int taken = 0;
  int refused = 0;
  // Whatever the window's filling, lengths of wait on either side of what it holds.
  for (std::size_t last = 200; last < 217; ++last) {
    for (std::size_t wait = 44; wait < 68; ++wait) {
      auto in_order = robot<S>();
      auto late = robot<S>();
      for (std::size_t i = 0; i < last; ++i) {
        static_cast<void>(in_order.update(ranges[i]));
        if (i != last - wait) static_cast<void>(late.update(ranges[i]));
      }
      const auto before = late.track();
      const auto told = late.update(ranges[last - wait]);
      const bool too_old = !told && told.error() == Error::TooOld;
      ++(too_old ? refused : taken);
      const auto& wanted = too_old ? before : in_order.track();
      CHECK(late.track().state == wanted.state);
      CHECK(late.track().covariance.matrix() == wanted.covariance.matrix());
    }
  }
  CHECK(taken > 20);
  CHECK(refused > 20);
}

TEST_CASE_TEMPLATE("tracker: a blink that its memory holds in part is not done over", S, float,
                   double) {
  // Ranges for a first fix, then blinks of seven differences that share an arrival; a turn rate
  // comes late, up to the whole of the memory.
  const std::vector<TimedRange<S>> ranges = ranges_of_drive<S>(1, 0.05, false);
  sim::Random random{"cut blinks"};
  std::vector<TimedDifference<S>> blinks;
  for (int i = 0; i < 20; ++i) {
    const std::int64_t time = 1'000'000 + i * 70'000;
    const Vec<double, 3> place = Drive::centre(1e-6 * static_cast<double>(time));
    const double arrival = test::hall_range(0, place) + random.normal(0, 0.1);
    for (std::uint32_t id = 1; id < test::kHallAnchors; ++id) {
      const double other = test::hall_range(id, place) + random.normal(0, 0.1);
      TimedDifference<S> blink{time, 0, id, static_cast<S>(other - arrival)};
      blink.shared = true;
      blinks.push_back(blink);
    }
  }
  auto options = robot_options<S>();
  options.heading = Measured<S>{static_cast<S>(Drive::heading(0)), S(0.01)};
  int taken = 0;
  int refused = 0;
  for (std::size_t last = 120; last < 137; ++last) {
    for (std::size_t wait = 44; wait < 68; ++wait) {
      auto in_order = robot<S>(false, options);
      auto late = robot<S>(false, options);
      for (const auto& range : ranges) {
        static_cast<void>(in_order.update(range));
        static_cast<void>(late.update(range));
      }
      REQUIRE(late.tracking());
      // Between the blinks, as all in its place is known by its time.
      const TimedTurnRate<S> turn{blinks[last - wait].time + 10'000, S(1.0 / 3)};
      bool told_in_order = false;
      for (std::size_t i = 0; i < last; ++i) {
        if (!told_in_order && blinks[i].time > turn.time) {
          told_in_order = true;
          static_cast<void>(in_order.update(turn));
        }
        static_cast<void>(in_order.update(blinks[i]));
        static_cast<void>(late.update(blinks[i]));
      }
      REQUIRE(told_in_order);
      const auto before = late.track();
      const auto told = late.update(turn);
      const bool too_old = !told && told.error() == Error::TooOld;
      ++(too_old ? refused : taken);
      const auto& wanted = too_old ? before : in_order.track();
      CHECK(late.track().state == wanted.state);
      CHECK(late.track().covariance.matrix() == wanted.covariance.matrix());
    }
  }
  CHECK(taken > 20);
  CHECK(refused > 20);
}

TEST_CASE_TEMPLATE("tracker: what is older than its memory is refused by name", S, float, double) {
  auto tracker = robot<S>();
  const auto ranges = ranges_of_drive<S>(3, 0.05);
  for (const auto& range : ranges) static_cast<void>(tracker.update(range));
  const auto before = tracker.track();
  CHECK(tracker.update(ranges[100]).error() == Error::TooOld);
  CHECK(tracker.track().state == before.state);
  CHECK(tracker.counters().refused(Error::TooOld) == 1);
  // One stamp from the far future does not end the track.
  TimedRange<S> future = ranges.back();
  future.time = std::numeric_limits<std::int64_t>::max();
  CHECK(tracker.update(future).error() == Error::GapTooLong);
  future.time = std::numeric_limits<std::int64_t>::min();
  CHECK(tracker.update(future).error() == Error::TooOld);
  CHECK(tracker.track().state == before.state);
  check_follows(tracker, 2.99, 0.1, 0.2);
}

TEST_CASE_TEMPLATE("tracker: no bad number passes, and each has its name", S, float, double) {
  auto tracker = robot<S>();
  for (const auto& range : ranges_of_drive<S>(3, 0.05)) static_cast<void>(tracker.update(range));
  const auto before = tracker.track();
  constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  constexpr S infinity = std::numeric_limits<S>::infinity();
  const std::int64_t t = 3'000'000;
  const auto error = [&](const auto& m) {
    const auto told = tracker.update(m);
    return told ? Error::NotConverged : told.error();
  };
  for (const S bad : {nan, infinity, -infinity}) {
    CHECK(error(TimedRange<S>{t, 0, bad}) == Error::NotFinite);
    CHECK(error(TimedRange<S>{t, 0, S(3), bad}) == Error::NotFinite);
    CHECK(error(TimedDifference<S>{t, 0, 1, bad}) == Error::NotFinite);
    CHECK(error(TimedHeading<S>{t, bad}) == Error::NotFinite);
    CHECK(error(TimedSpeed<S>{t, bad}) == Error::NotFinite);
    CHECK(error(TimedTurnRate<S>{t, bad}) == Error::NotFinite);
    CHECK(error(TimedPosition<S>{t, {bad, S(0), S(0)}, Mat<S, 3>::Identity()}) == Error::NotFinite);
    CHECK(error(TimedVelocity<S>{t, {S(0), bad, S(0)}}) == Error::NotFinite);
    CHECK(error(ImuSample<S>{t, {bad, S(0), S(0)}, {S(0), S(0), S(9)}}) == Error::NotFinite);
  }
  CHECK(error(TimedRange<S>{t, 0, S(3), S(0)}) == Error::NonPositiveSigma);
  CHECK(error(TimedRange<S>{t, 0, S(3), S(-1)}) == Error::NonPositiveSigma);
  CHECK(error(TimedRange<S>{t, 0, S(-3)}) == Error::NegativeRange);
  CHECK(error(TimedRange<S>{t, 99, S(3)}) == Error::UnknownAnchor);
  CHECK(error(TimedRange<S>{t, 0, S(3), S(0.1), 7}) == Error::UnknownTag);
  CHECK(error(TimedDifference<S>{t, 0, 99, S(1)}) == Error::UnknownAnchor);
  CHECK(error(TimedDifference<S>{t, 2, 2, S(0)}) == Error::DuplicateAnchor);
  CHECK(error(TimedDifference<S>{t, 0, 1, S(50)}) == Error::ImpossibleDifference);
  CHECK(error(TimedPosition<S>{t, {S(6), S(5), S(0)}, -Mat<S, 3>::Identity()}) ==
        Error::InvalidCovariance);
  CHECK(error(TimedVelocity<S>{t, {S(0), S(0), S(0)}, S(0)}) == Error::NonPositiveSigma);
  CHECK(error(TimedHeight<S>{t, S(1)}) == Error::InvalidOption);
  CHECK(tracker.track().state == before.state);
  CHECK(tracker.track().covariance.matrix() == before.covariance.matrix());
  // Finite, but not from this track.
  CHECK(error(TimedRange<S>{t, 0, S(40)}) == Error::Unreachable);
  CHECK(tracker.add_anchor(0, Vec<S, 3>::Zero()).error() == Error::DuplicateAnchor);
  CHECK(tracker.add_tag(3, {nan, S(0), S(0)}).error() == Error::NotFinite);

  auto options = robot_options<S>();
  options.model.gate.sigmas = nan;
  auto misled = robot<S>(true, options);
  CHECK(misled.update(TimedRange<S>{0, 0, S(3)}).error() == Error::InvalidOption);
}

TEST_CASE_TEMPLATE("tracker: options outside their domain are refused with every measurement", S,
                   float, double) {
  const auto refused = [](const auto& change) {
    auto options = robot_options<S>();
    REQUIRE(is_valid(options));
    change(options);
    auto tracker = robot<S>(true, options);
    const auto told = tracker.update(TimedRange<S>{0, 0, S(3)});
    return !told && told.error() == Error::InvalidOption;
  };
  using O = TrackerOptions<PlanarRobot<S>>;
  for (const S bad : {std::numeric_limits<S>::quiet_NaN(), S(-1), S(2e6)}) {
    CAPTURE(bad);
    CHECK(refused([&](O& o) { o.model.motion.acceleration = bad; }));
    CHECK(refused([&](O& o) { o.model.motion.turn_acceleration = bad; }));
    CHECK(refused([&](O& o) { o.model.motion.slip = bad; }));
    CHECK(refused([&](O& o) { o.model.motion.gyro_sigma = bad; }));
    CHECK(refused([&](O& o) { o.model.motion.height = bad == S(-1) ? S(-2e6) : bad; }));
    CHECK(refused([&](O& o) { o.model.bias_sigma = bad; }));
    CHECK(refused([&](O& o) { o.speed_sigma = bad; }));
    CHECK(refused([&](O& o) { o.heading = Measured<S>{S(0), bad}; }));
  }
  CHECK(refused([](O& o) { o.model.motion.gyro_sigma = S(0); }));
  CHECK(refused([](O& o) { o.max_gap = 0; }));
  CHECK(refused([](O& o) { o.max_gap = kLongestTrackGap + 1; }));
  CHECK(!refused([](O& o) { o.max_gap = kLongestTrackGap; }));
}

TEST_CASE_TEMPLATE("tracker: asked for later, it is less sure; asked for too late, it is lost", S,
                   float, double) {
  auto tracker = robot<S>();
  for (const auto& range : ranges_of_drive<S>(5, 0.05)) static_cast<void>(tracker.update(range));
  CHECK(tracker.predict_to(1'000'000).error() == Error::TimeNotIncreasing);
  S last = S(0);
  for (const std::int64_t t : {5'000'000, 5'500'000, 6'500'000}) {
    REQUIRE(tracker.predict_to(t));
    const auto pose = tracker.pose();
    REQUIRE(pose);
    CHECK(pose->time == t);
    CHECK(pose->pose.covariance(0, 0) > last);
    last = pose->pose.covariance(0, 0);
    // A metre driven unseen on the arc that it was on.
    check_follows(tracker, 1e-6 * static_cast<double>(t), 0.5, 0.5);
  }
  CHECK(tracker.predict_to(20'000'000).error() == Error::TrackLost);
  CHECK(tracker.pose());
}

TEST_CASE_TEMPLATE("tracker: a robot of one tag learns its heading by driving", S, float, double) {
  auto tracker = robot<S>(false);
  std::int64_t started = 0;
  for (const auto& range : ranges_of_drive<S>(15, 0.02, false)) {
    const auto told = tracker.update(range);
    if (told && told->event == TrackEvent::Started) started = range.time;
  }
  CHECK(started > 100'000);  // not before it has moved
  check_follows(tracker, 14.99, 0.15, 0.3);
}

TEST_CASE_TEMPLATE("tracker: heading, odometry, gyro, position and velocity are heard", S, float,
                   double) {
  auto options = robot_options<S>();
  options.heading = Measured<S>{S(1.5), S(0.1)};
  auto tracker = robot<S>(false, options);
  REQUIRE(tracker.update(TimedPosition<S>{0, {S(9), S(5), S(0)}, Mat<S, 3>::Identity()}));
  REQUIRE(tracker.tracking());
  for (int i = 1; i < 500; ++i) {
    const double t = 0.01 * i;
    const std::int64_t time = i * test::kSlot;
    const Vec<S, 3> place = Drive::centre(t).cast<S>();
    const S heading = static_cast<S>(Drive::heading(t));
    Result<TrackUpdate<S>> told = std::unexpected(Error::NotConverged);
    switch (i % 5) {
      case 0:
        told = tracker.update(TimedHeading<S>{time, heading + S(6.283185307), S(0.1)});
        break;
      case 1:
        told = tracker.update(TimedSpeed<S>{time, S(1), S(0.1)});
        break;
      case 2:
        told = tracker.update(ImuSample<S>{time, {S(0), S(0), S(1) / S(3)}, {S(0), S(0), S(9.8)}});
        break;
      case 3:
        told = tracker.update(TimedPosition<S>{time, place, Mat<S, 3>::Identity() * S(0.01)});
        break;
      default:
        told = tracker.update(
            TimedVelocity<S>{time, {std::cos(heading), std::sin(heading), S(0)}, S(0.2)});
    }
    REQUIRE(told);
    CHECK(told->event == TrackEvent::Used);
    CHECK(told->innovation.dimension == (i % 5 >= 3 ? 2 : 1));
  }
  check_follows(tracker, 4.99, 0.03, 0.03);
}

TEST_CASE("tracker: float follows double within a millimetre, hours after the epoch") {
  // Two weeks of microseconds: as float seconds they would be told apart by 64 ms.
  constexpr std::int64_t epoch = 1'209'600'000'000;
  auto single = robot<float>();
  auto precise = robot<double>();
  const auto ranges = ranges_of_drive<double>(20, 0.05);
  for (TimedRange<double> range : ranges) {
    range.time += epoch;
    range.range = static_cast<double>(static_cast<float>(range.range));
    const auto a = precise.update(range);
    const auto b = single.update(TimedRange<float>{
        range.time, range.anchor, static_cast<float>(range.range), 0.05f, range.tag});
    CHECK(a.has_value() == b.has_value());
  }
  const auto a = precise.pose();
  const auto b = single.pose();
  REQUIRE((a && b));
  CHECK((a->pose.position - b->pose.position.cast<double>()).norm() < 1e-3);
  CHECK(std::abs(a->pose.heading - static_cast<double>(b->pose.heading)) < 1e-3);
  CHECK((a->covariance - b->covariance.cast<double>()).cwiseAbs().maxCoeff() <
        1e-3 * a->covariance.cwiseAbs().maxCoeff());
}

}  // namespace tests::filter_tracker
