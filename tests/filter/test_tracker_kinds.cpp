// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/filter/motion/inertial.hpp"
#include "uwbpos/filter/tracker.hpp"

#include "filter/flights.hpp"

namespace tests::filter_tracker_kinds {

// Trackers of other kinds than the planar robot: points in the plane and in space, anchors with
// biases, bodies with an inertial unit.

namespace {

using namespace uwbpos;
using test::Radio;

double at_seconds(std::int64_t time) { return 1e-6 * static_cast<double>(time); }

}  // namespace

TEST_CASE_TEMPLATE("tracker kinds: a point on the floor, by differences alone", S, float, double) {
  sim::Random random{"floor"};
  TrackerOptions<ConstantVelocity<S, 2>> options;
  options.model.motion.height = S(1.2);
  Tracker<ConstantVelocity<S, 2>> tracker{options};
  test::hang_anchors(tracker);  // at two heights
  const test::Course course{1};
  std::int64_t time = 0;
  for (; time < 6'000'000; time += test::kSlot) {
    Vec<double, 3> place = course.position(at_seconds(time));
    place[2] = 1.2;
    test::measure(Radio::PairDifferences, time, place, 0.05, 0.05, random, tracker, test::unspoiled,
                  [](auto, const auto&) {});
  }
  const auto pose = tracker.pose();
  REQUIRE(pose);
  const Vec<double, 3> truth = course.position(at_seconds(pose->time));
  CHECK(std::hypot(static_cast<double>(pose->position[0]) - truth[0],
                   static_cast<double>(pose->position[1]) - truth[1]) < 0.15);
}

TEST_CASE_TEMPLATE("tracker kinds: heights and positions in space", S, float, double) {
  Tracker<ConstantVelocity<S, 3>> tracker;
  test::hang_anchors(tracker);
  CHECK(tracker.add_tag(0, {S(0.1), S(0), S(0)}).error() == Error::InvalidOption);
  CHECK(tracker.update(TimedHeading<S>{0, S(1)}).error() == Error::InvalidOption);
  CHECK(tracker.update(TimedSpeed<S>{0, S(1)}).error() == Error::InvalidOption);
  REQUIRE(tracker.update(TimedPosition<S>{0, {S(5), S(5), S(1)}, Mat<S, 3>::Identity() * S(0.25)}));
  for (int i = 1; i <= 50; ++i) {
    REQUIRE(tracker.update(TimedHeight<S>{i * test::kSlot, S(1.5), S(0.1)}));
  }
  auto pose = tracker.pose();
  REQUIRE(pose);
  // The speed may have been 1 m/s, of half a second: 0.1/√50 m, and twice as much at the end.
  CHECK(std::abs(pose->position[2] - S(1.5)) < S(0.1));
  CHECK(pose->covariance(2, 2) < S(0.01));
  CHECK(pose->covariance(0, 0) > S(0.2));

  // Correlated components: what is measured well is the sum.
  Mat<S, 3> r = Mat<S, 3>::Identity() * S(4);
  r(0, 1) = r(1, 0) = S(-3.999);
  const auto told = tracker.update(TimedPosition<S>{510'000, {S(5.5), S(5.5), S(1.5)}, r});
  REQUIRE(told);
  CHECK(told->innovation.dimension == 3);
  pose = tracker.pose();
  CHECK(std::abs(pose->position[0] + pose->position[1] - S(11)) < S(0.1));
  CHECK(std::abs(pose->position[0] - pose->position[1]) < S(0.01));
  // A metre off in the sum is thirty deviations; the same in the difference is nothing.
  CHECK(tracker.update(TimedPosition<S>{520'000, {S(6), S(6), S(1.5)}, r}).error() ==
        Error::OutlierRejected);
  CHECK(tracker.update(TimedPosition<S>{520'000, {S(6), S(5), S(1.5)}, r}));
}

TEST_CASE_TEMPLATE("tracker kinds: anchors' biases are found, those that can be", S, float,
                   double) {
  sim::Random random{"biases"};
  constexpr TrackerSize size{.biases = static_cast<int>(test::kHallAnchors)};
  TrackerOptions<ConstantVelocity<S, 3>> options;
  options.model.bias_sigma = S(0.2);
  options.model.bias_time = S(1000);
  Tracker<ConstantVelocity<S, 3>, size> tracker{options};
  test::hang_anchors(tracker);
  REQUIRE(tracker.add_anchor(77, {S(30), S(30), S(2)}));
  CHECK(tracker.bias(2).error() == Error::NotYetLocated);
  const test::Course course{0};
  const auto biased = [](std::uint32_t id, double range) {
    return range + (id == 2 ? 0.3 : id == 5 ? -0.2 : 0);
  };
  for (std::int64_t time = 0; time < 60'000'000; time += test::kSlot) {
    test::measure(Radio::Ranges, time, course.position(at_seconds(time)), 0.05, 0.05, random,
                  tracker, biased, [](auto, const auto&) {});
  }
  for (std::uint32_t id = 0; id < test::kHallAnchors; ++id) {
    const auto bias = tracker.bias(id);
    REQUIRE(bias);
    const double error = static_cast<double>(bias->value) - biased(id, 0);
    CHECK(std::abs(error) < 3.5 * std::sqrt(static_cast<double>(bias->variance)));
    CHECK(bias->variance < S(0.1 * 0.1));
  }
  CHECK(tracker.bias(77).error() == Error::UnknownAnchor);  // never heard

  // Three anchors and an uncertain position: nothing tells their biases from it.
  Tracker<ConstantVelocity<S, 3>, size> few{options};
  test::hang_anchors(few);
  REQUIRE(few.update(TimedPosition<S>{0, {S(6), S(5), S(1.5)}, Mat<S, 3>::Identity()}));
  for (int i = 1; i < 100; ++i) {
    const auto id = static_cast<std::uint32_t>(i % 3);
    const auto range = static_cast<S>(test::hall_range(id, {6, 5, 1.5}));
    REQUIRE(few.update(TimedRange<S>{i * test::kSlot, id, range, S(0.05)}));
  }
  for (std::uint32_t id = 0; id < 3; ++id) CHECK(few.bias(id).error() == Error::NotYetTracked);
}

TEST_CASE_TEMPLATE("tracker kinds: one anchor expected to lie, and its lie is found", S, float,
                   double) {
  sim::Random random{"an expected lie"};
  constexpr TrackerSize size{.biases = 1};
  TrackerOptions<ConstantVelocity<S, 3>> options;
  options.model.bias_sigma = S(3);
  options.model.bias_time = S(2000);
  Tracker<ConstantVelocity<S, 3>, size> tracker{options};
  test::hang_anchors(tracker);
  REQUIRE(tracker.expect_bias(2));
  CHECK(tracker.expect_bias(2));
  CHECK(tracker.expect_bias(5).error() == Error::CapacityExceeded);
  const test::Course course{0};
  for (std::int64_t time = 0; time < 20'000'000; time += test::kSlot) {
    test::measure(
        Radio::Ranges, time, course.position(at_seconds(time)), 0.05, 0.05, random, tracker,
        [](std::uint32_t id, double range) { return range + (id == 2 ? 2 : 0); },
        [](auto, const auto&) {});
  }
  const auto lie = tracker.bias(2);
  REQUIRE(lie);
  CHECK(std::abs(static_cast<double>(lie->value) - 2) <
        3.5 * std::sqrt(static_cast<double>(lie->variance)));
  CHECK(lie->variance < S(0.1 * 0.1));
  CHECK(tracker.bias(5).error() == Error::UnknownAnchor);
  CHECK(refused_share(tracker.counters(2)) < 0.1f);
}

TEST_CASE_TEMPLATE("tracker kinds: biases of links tell tags apart", S, float, double) {
  sim::Random random{"biases of links"};
  constexpr TrackerSize size{.biases = 2 * static_cast<int>(test::kHallAnchors),
                             .bias_by_link = true};
  TrackerOptions<ConstantVelocity<S, 3>> options;
  options.model.bias_sigma = S(0.2);
  options.model.bias_time = S(1000);
  Tracker<ConstantVelocity<S, 3>, size> tracker{options};
  test::hang_anchors(tracker);
  const test::Course course{1};
  const auto biased = [](std::uint32_t id, std::uint32_t tag) {
    return id == 2 && tag == 1 ? 0.4 : 0.0;
  };
  for (std::int64_t time = 0; time < 40'000'000; time += test::kSlot) {
    const auto slot = static_cast<std::uint32_t>(time / test::kSlot);
    const std::uint32_t id = slot % test::kHallAnchors;
    const std::uint32_t tag = slot / test::kHallAnchors % 2;
    const double range = test::hall_range(id, course.position(1e-6 * static_cast<double>(time))) +
                         biased(id, tag) + random.normal(0, 0.05);
    static_cast<void>(tracker.update(TimedRange<S>{time, id, static_cast<S>(range), S(0.05), tag}));
  }
  for (const std::uint32_t tag : {0u, 1u}) {
    for (std::uint32_t id = 0; id < test::kHallAnchors; ++id) {
      const auto bias = tracker.bias(id, tag);
      REQUIRE(bias);
      const double error = static_cast<double>(bias->value) - biased(id, tag);
      // 16 of them within four standard deviations, and the anchor's mean of both tags is not.
      CHECK(std::abs(error) < 4 * std::sqrt(static_cast<double>(bias->variance)));
      CHECK(std::abs(error) < 0.2);
    }
  }
  CHECK(tracker.bias(2, 7).error() == Error::UnknownAnchor);
}

TEST_CASE("tracker kinds: float follows double in flight, with an inertial unit and lever arms") {
  sim::Random random{"flight"};
  const test::Course course{2};
  TrackerOptions<Inertial<double>> precise_options;
  precise_options.heading = Measured<double>{course.heading(0), 0.01};
  TrackerOptions<Inertial<float>> single_options;
  single_options.heading = Measured<float>{static_cast<float>(course.heading(0)), 0.01f};
  Tracker<Inertial<double>> precise{precise_options};
  Tracker<Inertial<float>> single{single_options};
  test::hang_anchors(precise);
  test::hang_anchors(single);
  const Vec<double, 3> lever{0.1, -0.05, 0.02};
  REQUIRE(precise.add_tag(0, lever));
  REQUIRE(single.add_tag(0, lever.cast<float>()));
  const test::CourseImu imu{.course = course, .gyro_noise = 0.005, .accelerometer_noise = 0.05};
  for (std::int64_t time = 0; time < 10'000'000; time += 5'000) {
    const auto sample = imu.sample<double>(time, random);
    static_cast<void>(precise.update(sample));
    static_cast<void>(single.update(
        ImuSample<float>{time, sample.gyro.cast<float>(), sample.accelerometer.cast<float>()}));
    if (time % test::kSlot != 0) continue;
    const double t = at_seconds(time);
    const Vec<double, 3> place = course.position(t) + rotate<double>(course.orientation(t), lever);
    const auto id = static_cast<std::uint32_t>(time / test::kSlot) % test::kHallAnchors;
    const double range = test::hall_range(id, place) + random.normal(0, 0.05);
    const auto a = precise.update(TimedRange<double>{time, id, range, 0.05});
    const auto b = single.update(TimedRange<float>{time, id, static_cast<float>(range), 0.05f});
    CHECK(a.has_value() == b.has_value());
  }
  const auto a = precise.pose();
  const auto b = single.pose();
  REQUIRE((a && b));
  const double t = at_seconds(a->time);
  CHECK((a->body.position - course.position(t)).norm() < 0.1);
  CHECK((a->body.velocity - course.velocity(t)).norm() < 0.3);
  CHECK(std::abs(angle_difference(a->heading, course.heading(t))) < 0.1);
  CHECK((a->body.position - b->body.position.cast<double>()).norm() < 2e-3);
  CHECK((a->body.velocity - b->body.velocity.cast<double>()).norm() < 5e-3);
  CHECK(std::abs(a->heading - static_cast<double>(b->heading)) < 2e-3);

  // Samples stop: the body coasts, and is the less sure of its place the longer it does.
  const double sure = a->covariance(0, 0);
  REQUIRE(precise.predict_to(a->time + 1'000'000));
  const auto later = precise.pose();
  REQUIRE(later);
  CHECK(later->covariance(0, 0) > 100 * sure);
  CHECK((later->body.position - course.position(t + 1)).norm() <
        4 * std::sqrt(later->covariance.topLeftCorner<3, 3>().trace()));
}

}  // namespace tests::filter_tracker_kinds
