// SPDX-License-Identifier: MIT
#include <cmath>
#include <numbers>
#include <vector>

#include <calibrate.hpp>
#include <doctest/doctest.h>
#include <replay.hpp>

#include <uwbpos/sim/noise.hpp>

namespace tests::host_replay {

namespace {

using namespace uwbpos;
using namespace uwbpos::host;

// A body that drives along x at 2 m/s and turns by 0.5 rad/s, two tags ahead of and beside its
// centre.
constexpr double kSpeed = 2;
constexpr double kTurn = 0.5;

StampedPose pose_at(double t) {
  const double half = kTurn * t / 2;
  return {t, {kSpeed * t, 1, 1}, {0, 0, std::sin(half), std::cos(half)}};
}

Site turning_site() {
  Site site;
  site.anchors = {{1, {0, 0, 2}}, {2, {10, 0, 2}}, {3, {10, 8, 2}}, {4, {0, 8, 2}}};
  site.tags = {{0, {0.5, 0, 0}}, {7, {0, 0.5, 0}}};
  std::vector<StampedPose> poses;
  for (const double t : {0.0, 1.0, 2.0, 3.0}) poses.push_back(pose_at(t));
  site.truth = Trajectory{poses};
  return site;
}

// Exact ranges, ten rounds a second from `from` to `to`, `bias` added on anchor 3.
std::vector<Reading> exact_readings(const Site& site, double from, double to, double bias = 0) {
  std::vector<Reading> readings;
  for (double t = from; t < to; t += 0.1) {
    const double angle = kTurn * t;
    for (const auto& [tag, lever] : site.tags) {
      const Vec3 turned{std::cos(angle) * lever.x() - std::sin(angle) * lever.y(),
                        std::sin(angle) * lever.x() + std::cos(angle) * lever.y(), lever.z()};
      const Vec3 position = pose_at(t).position + turned;
      for (const auto& [id, anchor] : site.anchors) {
        readings.push_back(
            {t, tag, id, (position - anchor).norm() + (id == 3 ? bias : 0), {}, {}, 0});
      }
    }
  }
  return readings;
}

TEST_CASE("Truth is interpolated between poses: the position straight, the attitude by slerp") {
  const Trajectory truth = turning_site().truth;
  // The path is straight and the turn is steady: between poses both are exact.
  for (const double t : {0.0, 0.25, 0.5, 1.9, 3.0}) {
    const auto point = truth.point_at(t, {0.5, 0, 0.25});
    REQUIRE(point);
    CHECK(point->x() == doctest::Approx(kSpeed * t + 0.5 * std::cos(kTurn * t)).epsilon(1e-12));
    CHECK(point->y() == doctest::Approx(1 + 0.5 * std::sin(kTurn * t)).epsilon(1e-12));
    CHECK(point->z() == doctest::Approx(1.25));
  }
  CHECK_FALSE(truth.at(-1e-9));
  CHECK_FALSE(truth.at(3.0 + 1e-9));
  CHECK_FALSE(truth.at(std::nan("")));
}

TEST_CASE("Slerp takes the shorter way, also between q and -q, and stands still for equal ones") {
  const Rotation turned{0, 0, std::sin(0.2), std::cos(0.2)};
  const Rotation negative{-turned.x, -turned.y, -turned.z, -turned.w};
  const Rotation half = slerp({}, negative, 0.5);
  CHECK(std::abs(half.z) == doctest::Approx(std::sin(0.1)));
  CHECK(slerp(turned, turned, 0.3).z == doctest::Approx(turned.z));
}

TEST_CASE("Exact ranges of a turning body give exact positions of its tags") {
  const Site site = turning_site();
  for (const int dim : {2, 3}) {
    CAPTURE(dim);
    Settings settings;
    settings.dim = dim;
    settings.side = Side::kBelow;
    if (dim == 2) settings.height = 1;
    const Replay result = replay(settings, site, exact_readings(site, 0, 3));
    CHECK(result.all.epochs == 60);
    CHECK(result.all.solved == 60);
    CHECK(result.all.scored == 60);
    CHECK(result.of_tag.at(7).scored == 30);
    // Ranges are exact to 1e-15; solving in doubles within ten metres keeps six orders more than
    // this.
    CHECK(result.all.error.max < 1e-6);
    for (const auto& [link, residuals] : result.residuals) {
      for (const Residual& residual : residuals) CHECK(std::abs(residual.value) < 1e-9);
    }
  }
}

TEST_CASE("Positions outside the truth's time span are solved and not scored") {
  const Site site = turning_site();
  Settings settings;
  settings.height = 1;
  const Replay result = replay(settings, site, exact_readings(site, -1.05, 4));
  CHECK(result.all.solved == 102);
  CHECK(result.all.scored == 60);
  CHECK(result.outside_truth == 42);
  CHECK(result.all.error.max < 1e-6);
}

TEST_CASE("Unknown anchors and tags are counted; an unknown tag is solved, not scored") {
  Site site = turning_site();
  auto readings = exact_readings(site, 0, 3);
  site.anchors.erase(2);
  site.tags.erase(7);
  Settings settings;
  settings.height = 1;
  const Replay result = replay(settings, site, readings);
  CHECK(result.unknown_anchors == std::map<Id, std::size_t>{{2, 60}});
  CHECK(result.unknown_tags.at(7) == 90);
  CHECK(result.all.solved == 60);
  CHECK(result.all.scored == 30);
  CHECK(result.all.error.max < 1e-6);
}

TEST_CASE("In space below a ceiling, a side, a start, or the given height chooses the image") {
  const Site site = turning_site();
  const auto readings = exact_readings(site, 0, 3);
  Settings settings;
  settings.dim = 3;
  Replay result = replay(settings, site, readings);
  CHECK(result.all.rejected == Counts{{"ambiguous_solution", 60}});
  settings.prior = Vec3{0, 1, 0};
  result = replay(settings, site, readings);
  CHECK(result.all.solved == 60);
  CHECK(result.chosen_by_prior == 60);
  CHECK(result.all.error.max < 1e-6);
  settings.prior = Vec3{0, 1, 5};  // the wrong image, consistently
  CHECK(replay(settings, site, readings).all.error.median > 1.5);
  settings.prior.reset();
  settings.height = 1;
  CHECK(replay(settings, site, readings).all.error.max < 1e-6);
}

TEST_CASE("Readings that cannot be ranges are left out by reason, and their epochs go on") {
  const Site site = turning_site();
  auto readings = exact_readings(site, 0, 1);
  readings[0].range = -3;
  readings[9].range = 1e12;
  readings[18].range = 0.3;  // the anchor is a metre above the tag
  Settings settings;
  settings.height = 1;
  const Replay result = replay(settings, site, readings);
  CHECK(result.refused_readings ==
        Counts{{"height_exceeds_range", 1}, {"negative_range", 1}, {"range_beyond_maximum", 1}});
  CHECK(result.all.solved == result.all.epochs);
  CHECK(result.all.error.max < 1e-6);
}

TEST_CASE("Without --dim, anchors of one height or a known height mean the plane") {
  Points level = {{1, {0, 0, 2}}, {2, {5, 0, 2}}};
  Points tilted = {{1, {0, 0, 2}}, {2, {5, 0, 3}}};
  Settings settings;
  CHECK(choose_dim(settings, level) == 2);
  CHECK(choose_dim(settings, tilted) == 3);
  settings.height = 1;
  CHECK(choose_dim(settings, tilted) == 2);
  settings.dim = 3;
  CHECK(choose_dim(settings, level) == 3);
}

TEST_CASE("The given height is the mean of the tags' heights; lever arms tell them apart") {
  const Points tags = {{1, {0, 0, 0.2}}, {2, {0, 0, 0.4}}};
  CHECK(tag_height(1, tags, 1) == doctest::Approx(0.9));
  CHECK(tag_height(1, tags, 2) == doctest::Approx(1.1));
  CHECK(tag_height(1, {}, 2) == 1);
}

TEST_CASE("Calibration finds a link's bias through noise, and is as sure of it as it says") {
  const Site site = turning_site();
  sim::Random random{"calibration of one biased anchor"};
  constexpr double bias = 0.25;
  int inside = 0;
  int links = 0;
  for (int run = 0; run < 40; ++run) {
    auto readings = exact_readings(site, 0, 3, bias);
    for (Reading& reading : readings) reading.range += random.normal(0, 0.1);
    Settings settings;
    for (const LinkBias& found : calibrate(compare_with_truth(settings, site, readings))) {
      const double truth = found.anchor == 3 ? bias : 0;
      CHECK(found.readings == 30);
      CHECK(found.stretches == 2);
      // 0.1 m over the root of 30 readings is 0.018 m, Huber's estimate 4 % more; six sigma.
      CHECK(std::abs(found.bias - truth) < 0.115);
      ++links;
      if (std::abs(found.bias - truth) < 0.04) ++inside;
    }
  }
  // 0.04 m are 2.1 sigma, 96 % of links; 320 of them, at most five sigma (0.011) fewer.
  CHECK(static_cast<double>(inside) / links > 0.9);
}

TEST_CASE("Biases that calibration found, taken off, leave the positions exact") {
  const Site site = turning_site();
  Settings settings;
  settings.height = 1;
  const auto readings = exact_readings(site, 0, 3, 0.4);
  const Replay raw = replay(settings, site, readings);
  CHECK(raw.all.error.median > 0.1);
  Site calibrated = site;
  for (const LinkBias& b : calibrate(compare_with_truth(settings, site, readings))) {
    calibrated.bias.of_link[{b.tag, b.anchor}] = b.bias;
  }
  const Replay result = replay(settings, calibrated, readings);
  CHECK(result.without_bias == 0);
  CHECK(result.all.error.max < 1e-5);
}

TEST_CASE("Huber's location is the mean of what agrees, and outliers pull it by little") {
  const std::vector<double> even = {1, 2, 3, 4, 5};
  CHECK(huber_location(even, 1.5) == doctest::Approx(3));
  std::vector<double> values;
  sim::Random random{"location among outliers"};
  for (int i = 0; i < 1000; ++i) values.push_back(random.normal(0, 0.1));
  for (int i = 0; i < 50; ++i) values.push_back(10);
  // 5 % outliers pull by at most their share of 1.5 spreads: 0.05 · 0.15 / 0.87 = 0.009 m, and
  // 0.003 m of noise; the mean is off by 0.48 m.
  CHECK(std::abs(huber_location(values, 1.5)) < 0.02);
  CHECK(huber_location({2, 2, 2}, 1.5) == 2);
}

}  // namespace

}  // namespace tests::host_replay
