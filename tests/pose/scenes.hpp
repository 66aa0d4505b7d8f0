// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Rooms with anchors and a body that carries tags, for the laws of pose solvers.

#include <cmath>
#include <numbers>
#include <vector>

#include "uwbpos/accuracy/pose_bound.hpp"

#include "support/random_geometry.hpp"

namespace uwbpos::test {

/// Where the body is, and exact ranges of its tags, rounded to S once, tag by tag.
template <class S, int D>
struct Scene {
  Vec<S, D> position;
  S heading;
  std::vector<TagRange<S, D>> ranges;
};

/// Exact ranges of a body at a pose, with the given sigma.
template <class S, int D>
std::vector<TagRange<S, D>> tag_ranges(const Vec<S, D>& position, S heading,
                                       const std::vector<Vec<S, D>>& arms,
                                       const std::vector<Vec<S, D>>& anchors, S sigma = S(0.1)) {
  std::vector<TagRange<S, D>> ranges;
  const auto turn = turn_of(static_cast<double>(heading));
  for (const auto& arm : arms) {
    const Vec<double, D> tag =
        position.template cast<double>() + turned<double, D>(turn, arm.template cast<double>());
    for (const auto& anchor : anchors) {
      const Vec<double, D> offset = tag - anchor.template cast<double>();
      ranges.push_back({arm, anchor, static_cast<S>(norm(offset)), sigma});
    }
  }
  return ranges;
}

/// Two to four tags at least 20 cm apart in plan on a body of 0.8 m, `fewest` to `most` anchors in
/// a room of 20 m × 15 m (× 6 m), the body in it or up to 2 m outside, at any heading; `sharp`
/// [rad] bounds the heading's standard deviation at sigma 0.1 m, 0.5 m the position's.
template <class S, int D>
Scene<S, D> random_scene(sim::Random& random, int fewest, int most, double sharp = 0.5) {
  for (;;) {
    std::vector<Vec<S, D>> arms;
    for (int tags = random.integer(2, 4); static_cast<int>(arms.size()) < tags;) {
      const Vec<S, D> arm = random_in_cube<S, D>(random, S(0.4));
      bool apart = true;
      for (const auto& other : arms) {
        apart = apart && (arm - other).template head<2>().norm() > S(0.2);
      }
      if (apart) arms.push_back(arm);
    }
    std::vector<Vec<S, D>> anchors;
    for (int n = random.integer(fewest, most); n > 0; --n) {
      anchors.push_back(
          random_in_box<S, D>(random, room_corner<S, D>(0, 0, 0), room_corner<S, D>(20, 15, 6)));
    }
    Scene<S, D> scene;
    scene.position =
        random_in_box<S, D>(random, room_corner<S, D>(-2, -2, 0), room_corner<S, D>(22, 17, 3));
    scene.heading = S(random.uniform(-std::numbers::pi, std::numbers::pi));
    scene.ranges = tag_ranges(scene.position, scene.heading, arms, anchors);
    const auto bound = pose_bound(scene.ranges, scene.position, scene.heading);
    if (!bound || (*bound)(D, D) > S(sharp * sharp)) continue;
    if (bound->template topLeftCorner<D, D>().trace() < S(0.25)) return scene;
  }
}

/// The same ranges with noise of their own sigma.
template <class S, int D>
std::vector<TagRange<S, D>> noisy(sim::Random& random, std::vector<TagRange<S, D>> ranges) {
  for (auto& r : ranges) r.range += S(random.normal()) * r.sigma;
  return ranges;
}

}  // namespace uwbpos::test
