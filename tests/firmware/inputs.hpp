// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Inputs as the host makes them: rooms of 20 m × 15 m × 6 m, noise of 5 to 10 cm, and in some
/// rounds what is to be refused.

#include <cmath>
#include <numbers>

#include "uwbpos/core/types.hpp"
#include "uwbpos/ranging/ds_twr.hpp"
#include "uwbpos/ranging/ss_twr.hpp"
#include "uwbpos/sim/noise.hpp"

#include "recorded.hpp"

namespace firmware {

using uwbpos::Vec;
using uwbpos::sim::Random;

inline float to_float(double x) { return static_cast<float>(x); }

inline Vec<double, 3> point_in_room(Random& random) {
  return {random.uniform(0, 20), random.uniform(0, 15), random.uniform(0, 6)};
}

/// The corners of a room in turn, top and bottom, each moved by up to a metre.
inline Vec<double, 3> corner_of_room(Random& random, std::size_t i) {
  const double x[4] = {0, 20, 20, 0};
  const double y[4] = {0, 0, 15, 15};
  const double z = (i / 4 + i) % 2 == 0 ? 6 : 1;
  return {x[i % 4] + random.uniform(-1, 1), y[i % 4] + random.uniform(-1, 1),
          z + random.uniform(-1, 1)};
}

template <std::size_t N, int D>
void make(std::array<uwbpos::RangeTo<float, D>, N>& ranges, Random& random) {
  const Vec<double, 3> tag = point_in_room(random);
  for (std::size_t i = 0; i < N; ++i) {
    const Vec<double, D> anchor = corner_of_room(random, i).template head<D>();
    const double distance = (tag.template head<D>() - anchor).norm();
    ranges[i] = {anchor.template cast<float>(), to_float(distance + random.normal(0, 0.1)), 0.1f};
  }
}

template <std::size_t N, int D>
void make(std::array<uwbpos::TagRange<float, D>, N>& ranges, Random& random) {
  const Vec<double, 3> body = point_in_room(random);
  const double heading = random.uniform(-std::numbers::pi, std::numbers::pi);
  for (std::size_t i = 0; i < N; ++i) {
    const double side = i < N / 2 ? 0.3 : -0.3;
    Vec<double, D> lever = Vec<double, D>::Zero();
    lever[1] = side;
    Vec<double, D> place = body.template head<D>();
    place[0] -= std::sin(heading) * side;
    place[1] += std::cos(heading) * side;
    const Vec<double, D> anchor = corner_of_room(random, i % (N / 2)).template head<D>();
    ranges[i] = {lever.template cast<float>(), anchor.template cast<float>(),
                 to_float((place - anchor).norm() + random.normal(0, 0.05)), 0.05f};
  }
}

/// Six stamps of two clocks up to 20 ppm off, replies of a third to one millisecond, counters that
/// may wrap between.
inline void make(uwbpos::DsTwrStamps& s, Random& random) {
  constexpr double kTick = 1.0 / (128 * 499.2e6);
  const double rate_a = random.uniform(-20e-6, 20e-6);
  const double rate_b = random.uniform(-20e-6, 20e-6);
  const double flight = random.uniform(0, 100) / 299'702'547.0;
  const std::uint64_t start_a = random.bits() >> 24;
  const std::uint64_t start_b = random.bits() >> 24;
  double at[6] = {};
  at[1] = flight;
  at[2] = at[1] + random.uniform(0.3e-3, 1e-3);
  at[3] = at[2] + flight;
  at[4] = at[3] + random.uniform(0.3e-3, 1e-3);
  at[5] = at[4] + flight;
  const auto stamp = [&](double t, std::uint64_t start, double rate, bool received) {
    const double noise = received ? random.normal(0, 0.15e-9) : 0;
    const double ticks = (t * (1 + rate) + noise) / kTick;
    return uwbpos::DeviceTime<>{start + static_cast<std::uint64_t>(std::llround(ticks) + 1000)};
  };
  s = {stamp(at[0], start_a, rate_a, false), stamp(at[1], start_b, rate_b, true),
       stamp(at[2], start_b, rate_b, false), stamp(at[3], start_a, rate_a, true),
       stamp(at[4], start_a, rate_a, false), stamp(at[5], start_b, rate_b, true)};
}

inline void make(uwbpos::SsTwrStamps& s, Random& random) {
  uwbpos::DsTwrStamps all;
  make(all, random);
  s = {all.poll_tx, all.poll_rx, all.resp_tx, all.resp_rx};
}

}  // namespace firmware
