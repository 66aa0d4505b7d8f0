// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Shots of ultrasound with lags: the simulation of Jiang, Yan, Zang, Zhao (003, section 4). An
/// emitter on a circle before a bar of three receivers; every length is long by whole waves and by
/// up to a thirtieth of one, uniformly. (003) prints the later lags for its third receiver, which
/// is the nearest; its text has the farthest lag most, and so have these shots.

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "uwbpos/core/types.hpp"
#include "uwbpos/sim/noise.hpp"

namespace uwbpos::sim {

/// One wave of (003), 40 kHz at 340 m/s [m].
inline constexpr double kPaperWave = 0.0085;

/// The greatest noise of a length in (003) [m].
inline constexpr double kPaperNoise = 0.00028;

/// The shots of one turn, one every 8°.
inline constexpr int kPaperShots = 45;

/// Lengths [m] as the receivers measured them, and the whole waves by which each was late.
template <std::size_t N>
struct UltrasonicShot {
  std::array<double, N> lengths;  ///< distance, lag and noise [m]
  std::array<int, N> waves;       ///< in the lag
};

/// The receivers of (003): a bar of 0.8 m along x.
[[nodiscard]] inline std::array<Vec<double, 2>, 3> paper_receivers() {
  return {Vec<double, 2>{-0.4, 0}, Vec<double, 2>{0, 0}, Vec<double, 2>{0.4, 0}};
}

/// Where the emitter is at shot `index` of its turn around (0.8, 0.8) m, `step` degrees each.
[[nodiscard]] inline Vec<double, 2> paper_emitter(int index, double step = 8) {
  const double angle = step * index * std::numbers::pi / 180;
  return {0.8 + 0.4 * std::sin(angle), 0.8 + 0.4 * std::cos(angle)};
}

/// A shot whose lengths are late by these waves, and by up to `noise` [m].
template <int D, std::size_t N>
[[nodiscard]] UltrasonicShot<N> late_shot(Random& random,
                                          const std::array<Vec<double, D>, N>& receivers,
                                          const Vec<double, D>& emitter,
                                          const std::array<int, N>& waves,
                                          double noise = kPaperNoise) {
  UltrasonicShot<N> shot{{}, waves};
  for (std::size_t i = 0; i < N; ++i) {
    shot.lengths[i] =
        (emitter - receivers[i]).norm() + kPaperWave * waves[i] + noise * random.uniform();
  }
  return shot;
}

/// A shot of (003): one or two waves late, the farthest receiver two or three.
template <int D, std::size_t N>
[[nodiscard]] UltrasonicShot<N> paper_shot(Random& random,
                                           const std::array<Vec<double, D>, N>& receivers,
                                           const Vec<double, D>& emitter,
                                           double noise = kPaperNoise) {
  std::size_t farthest = 0;
  for (std::size_t i = 1; i < N; ++i) {
    const double here = (emitter - receivers[i]).norm();
    if (here > (emitter - receivers[farthest]).norm()) farthest = i;
  }
  std::array<int, N> waves;
  for (std::size_t i = 0; i < N; ++i) waves[i] = (i == farthest ? 2 : 1) + random.integer(0, 1);
  return late_shot<D, N>(random, receivers, emitter, waves, noise);
}

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
