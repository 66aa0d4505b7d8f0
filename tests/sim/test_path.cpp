// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>
#include <numbers>

#include <doctest/doctest.h>

#include <uwbpos/sim/path.hpp>

#include "../support/random_geometry.hpp"

namespace tests::sim_path {

namespace {

using namespace uwbpos::sim;
using uwbpos::Error;
using uwbpos::Vec;

Route route_over(std::initializer_list<Vec<double, 3>> waypoints, double speed, double radius) {
  Route route;
  for (const auto& waypoint : waypoints) REQUIRE(add(route, waypoint));
  route.speed = speed;
  route.radius = radius;
  return route;
}

// What must hold along any path: velocity and turn rate are the derivatives of position and
// heading (central differences over 2e-5 s: truncation below 1e-8, rounding below 1e-9), and
// the path does not jump.
template <class P>
void check_derivatives(const P& path, double speed) {
  constexpr double kStep = 1e-5;
  const double end = duration(path);
  int smooth = 0;
  for (int i = 1; i < 1000; ++i) {
    const double time = end * i / 1000;
    CAPTURE(time);
    const BodyState now = state_at(path, time);
    const BodyState before = state_at(path, time - kStep);
    const BodyState after = state_at(path, time + kStep);
    REQUIRE(std::abs(now.forward.norm() - 1) < 1e-12);
    REQUIRE((after.position - before.position).norm() <= 2 * kStep * speed * (1 + 1e-9));
    CHECK(std::abs(now.velocity.norm() - speed) < 1e-9);
    if (std::abs(before.turn_rate - after.turn_rate) > 1e-2) continue;  // where a leg meets an arc
    ++smooth;
    const Vec<double, 3> velocity = (after.position - before.position) / (2 * kStep);
    CHECK((velocity - now.velocity).norm() < 1e-8);
    // Truncation of the difference: h²/6 times the heading's third derivative, which on a
    // sloping arc reaches some ten times rate³.
    const double bend = 2 * kStep * kStep * std::pow(1 + std::abs(now.turn_rate), 3);
    const double cross =
        before.forward(0) * after.forward(1) - before.forward(1) * after.forward(0);
    CHECK(std::abs(std::asin(cross) / (2 * kStep) - now.turn_rate) < 1e-8 + bend);
    CHECK(std::abs(std::remainder(heading(now) - std::atan2(now.velocity(1), now.velocity(0)),
                                  6.283185307179586)) < 1e-9);
  }
  CHECK(smooth > 900);
}

TEST_CASE("A square route with rounded corners has the length and the places of one") {
  const Route route = route_over({{0, 0, 1}, {10, 0, 1}, {10, 5, 1}}, 2, 1);
  // 9 m, a quarter circle of radius 1, 4 m.
  const double arc = std::numbers::pi / 2;
  CHECK(length(route) == doctest::Approx(13 + arc).epsilon(1e-12));
  CHECK(duration(route) == doctest::Approx((13 + arc) / 2).epsilon(1e-12));
  CHECK(state_at(route, 0).position == Vec<double, 3>(0, 0, 1));
  CHECK(state_at(route, 0).velocity == Vec<double, 3>(2, 0, 0));
  CHECK((state_after(route, 4.5).position - Vec<double, 3>(4.5, 0, 1)).norm() < 1e-12);
  const BodyState middle = state_after(route, 9 + arc / 2);
  const double h = std::numbers::sqrt2 / 2;
  CHECK((middle.position - Vec<double, 3>(9 + h, 1 - h, 1)).norm() < 1e-12);
  CHECK(heading(middle) == doctest::Approx(std::numbers::pi / 4));
  CHECK(middle.turn_rate == doctest::Approx(2));
  const BodyState end = state_at(route, 100);
  CHECK((end.position - Vec<double, 3>(10, 5, 1)).norm() < 1e-12);
  CHECK(end.velocity.norm() == 0);
  CHECK(end.turn_rate == 0);
  CHECK(heading(end) == doctest::Approx(std::numbers::pi / 2));
  CHECK(state_at(route, -1).position == Vec<double, 3>(0, 0, 1));
}

TEST_CASE("Velocity and turn rate are the derivatives of position and heading") {
  check_derivatives(
      route_over({{0, 0, 1}, {10, 0, 1}, {12, 7, 1}, {3, 4, 1}, {3, -9, 1}}, 1.5, 0.8), 1.5);
  check_derivatives(route_over({{0, 0, 1}, {4, 0, 2}, {8, 3, 0.5}, {0, 9, 3}}, 0.7, 2), 0.7);
  check_derivatives(Circle{.centre = {5, 5, 1}, .radius = 3, .speed = 1.2, .laps = 2}, 1.2);
  uwbpos::sim::Random random{"routes"};
  for (int i = 0; i < 20; ++i) {
    Route route;
    for (int k = 0; k < 8; ++k) {
      REQUIRE(add(route, uwbpos::test::random_in_box<double, 3>(random, {0, 0, 0}, {20, 20, 3})));
    }
    route.radius = random.uniform(0.2, 1);
    check_derivatives(route, 1);
  }
}

TEST_CASE("Corners closer together than their arcs need are rounded less, and nothing jumps") {
  const Route route =
      route_over({{0, 0, 0}, {1, 0, 0}, {1, 0.2, 0}, {0, 0.2, 0}, {0, 0.4, 0}, {3, 0.4, 0}}, 1, 5);
  double longest = 0;
  Vec<double, 3> last = state_after(route, 0).position;
  for (double s = 0; s < length(route); s += 0.001) {
    const Vec<double, 3> now = state_after(route, s).position;
    longest = std::max(longest, (now - last).norm());
    last = now;
  }
  CHECK(longest <= 0.001 * (1 + 1e-9));
  CHECK((last - Vec<double, 3>(3, 0.4, 0)).norm() < 0.0011);
}

TEST_CASE("A route may reverse, repeat a waypoint, climb straight up, or be empty") {
  const Route there_and_back = route_over({{0, 0, 0}, {4, 0, 0}, {0, 0, 0}}, 1, 1);
  CHECK(length(there_and_back) == doctest::Approx(8));
  CHECK(heading(state_at(there_and_back, 3)) == 0);
  CHECK(std::abs(heading(state_at(there_and_back, 5))) == doctest::Approx(std::numbers::pi));
  CHECK((state_at(there_and_back, 5).position - Vec<double, 3>(3, 0, 0)).norm() < 1e-12);

  const Route repeating = route_over({{0, 0, 0}, {2, 0, 0}, {2, 0, 0}, {2, 3, 0}}, 1, 0.5);
  CHECK(length(repeating) == doctest::Approx(5));
  CHECK((state_at(repeating, 4).position - Vec<double, 3>(2, 2, 0)).norm() < 1e-12);

  const Route climbing = route_over({{1, 1, 0}, {1, 1, 5}}, 1, 0.5);
  CHECK((state_at(climbing, 2).position - Vec<double, 3>(1, 1, 2)).norm() < 1e-12);
  CHECK(state_at(climbing, 2).forward == Vec<double, 2>(1, 0));

  CHECK(duration(Route{}) == 0);
  CHECK(state_at(Route{}, 1).position == Vec<double, 3>(0, 0, 0));
  const Route one = route_over({{1, 2, 3}}, 1, 1);
  CHECK(duration(one) == 0);
  CHECK(state_at(one, 1).position == Vec<double, 3>(1, 2, 3));
}

TEST_CASE("A lawn mower covers its rectangle lane by lane") {
  const auto route = lawn_mower({1, 2, 0.5}, {9, 8, 0.5}, 4);
  REQUIRE(route);
  CHECK(route->size == 8);
  CHECK(route->waypoints[0] == Vec<double, 3>(1, 2, 0.5));
  CHECK(route->waypoints[1] == Vec<double, 3>(9, 2, 0.5));
  CHECK(route->waypoints[2] == Vec<double, 3>(9, 4, 0.5));
  CHECK(route->waypoints[7] == Vec<double, 3>(1, 8, 0.5));
  CHECK(lawn_mower({0, 0, 0}, {1, 1, 0}, 1)->waypoints[0](1) == 0.5);
  CHECK(lawn_mower({0, 0, 0}, {1, 1, 0}, 0).error() == Error::InvalidOption);
  CHECK(lawn_mower({0, 0, 0}, {1, 1, 0}, 1000).error() == Error::CapacityExceeded);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(lawn_mower({0, 0, nan}, {1, 1, 0}, 2).error() == Error::NotFinite);
}

TEST_CASE("A circle comes round as often as it should and then stands still") {
  const Circle circle{.centre = {5, 5, 1}, .radius = 2, .speed = 1, .laps = 1.5};
  CHECK(duration(circle) == doctest::Approx(6 * std::numbers::pi));
  CHECK((state_at(circle, 0).position - Vec<double, 3>(7, 5, 1)).norm() < 1e-12);
  CHECK((state_at(circle, std::numbers::pi).position - Vec<double, 3>(5, 7, 1)).norm() < 1e-12);
  CHECK((state_at(circle, 1000).position - Vec<double, 3>(3, 5, 1)).norm() < 1e-12);
  CHECK(state_at(circle, 1000).velocity.norm() == 0);
}

TEST_CASE("Stops are visited one after the other, each once at multiples of the dwell") {
  Random random{"stops"};
  const auto stops = random_stops({0, 0, 1}, {30, 20, 1}, 100, random);
  REQUIRE(stops);
  for (const double dwell : {1.0, 0.1, 0.7, 1.0 / 3}) {
    Stops paced = *stops;
    paced.dwell = dwell;
    CHECK(duration(paced) == doctest::Approx(100 * dwell));
    for (int i = 0; i < 100; ++i) {
      const auto& place = paced.places[static_cast<std::size_t>(i)];
      CHECK(state_at(paced, i / (1 / dwell)).position == place);
      CHECK(state_at(paced, i * dwell).position == place);
      CHECK(state_at(paced, (i + 0.99) * dwell).position == place);
    }
  }
  for (int i = 0; i < 100; ++i) {
    const auto& place = stops->places[static_cast<std::size_t>(i)];
    CHECK((0 <= place(0) && place(0) < 30 && 0 <= place(1) && place(1) < 20 && place(2) == 1));
  }
  CHECK(state_at(*stops, -5).position == stops->places[0]);
  CHECK(state_at(*stops, 5000).position == stops->places[99]);
  CHECK(random_stops({0, 0, 1}, {1, 1, 1}, -1, random).error() == Error::InvalidOption);
  CHECK(random_stops({0, 0, 1}, {1, 1, 1}, 129, random).error() == Error::CapacityExceeded);
  const double inf = std::numeric_limits<double>::infinity();
  CHECK(random_stops({0, 0, 1}, {inf, 1, 1}, 1, random).error() == Error::NotFinite);
}

TEST_CASE("A path of any kind is the path that it holds") {
  const Circle circle{.centre = {1, 2, 3}, .radius = 2};
  CHECK(state_at(Path{circle}, 1.3).position == state_at(circle, 1.3).position);
  CHECK(duration(Path{circle}) == duration(circle));
  const Route route = route_over({{0, 0, 0}, {4, 0, 0}}, 1, 1);
  CHECK(state_at(Path{route}, 1.3).position == state_at(route, 1.3).position);
  CHECK(duration(Path{route}) == 4);
  Stops stops;
  REQUIRE(add(stops, {1, 2, 3}));
  CHECK(state_at(Path{stops}, 0).position == Vec<double, 3>(1, 2, 3));
  CHECK(duration(Path{stops}) == 1);
}

TEST_CASE("A tag on a lever arm moves as the rigid body does") {
  const Circle circle{.centre = {5, 5, 1}, .radius = 3, .speed = 1.2, .laps = 1};
  const Vec<double, 3> lever{0.3, -0.2, 0.5};
  const BodyState start = state_at(circle, 0);
  // At (8, 5), looking along +y: forward is +y, left is −x.
  CHECK((tag_motion(start, lever).position - Vec<double, 3>(8.2, 5.3, 1.5)).norm() < 1e-12);
  for (int i = 1; i < 100; ++i) {
    const double time = duration(circle) * i / 100;
    const Vec<double, 3> before = tag_motion(state_at(circle, time - 1e-5), lever).position;
    const Vec<double, 3> after = tag_motion(state_at(circle, time + 1e-5), lever).position;
    const Motion now = tag_motion(state_at(circle, time), lever);
    CHECK(((after - before) / 2e-5 - now.velocity).norm() < 1e-8);
  }
}

}  // namespace

}  // namespace tests::sim_path
