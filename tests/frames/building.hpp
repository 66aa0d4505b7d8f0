// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A building of four subnets and a walk through all of them, for the tests of hand-over.

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "uwbpos/frames/fit_transform.hpp"
#include "uwbpos/frames/fuse_fixes.hpp"

#include "frames/scenes.hpp"

namespace uwbpos::test {

/// Four quadrants of 20 m, each a subnet that hears `overlap` beyond its borders. Its frame lies
/// anyhow; its transform is fitted from noisy shared points.
template <int D>
struct Building {
  double overlap = 2;
  std::array<Transform<double, D>, 4> truth;  ///< map_T_subnet, exactly
  std::array<Subnet<double, D>, 4> fitted;

  explicit Building(sim::Random& random, double survey_sigma = 0.05) {
    for (int k = 0; k < 4; ++k) {
      Vec<double, D> corner = Vec<double, D>::Zero();
      corner[0] = k % 2 * 20.0;
      corner[1] = k / 2 * 20.0;
      Transform<double, D> t;
      t.rotation = random_rotation<double, D>(random);
      t.translation = corner;  // the control anchor stands in a corner of its quadrant
      const auto i = static_cast<std::size_t>(k);
      truth[i] = t;
      std::vector<SharedPoint<double, D>> points;
      for (int n = 0; n < 5; ++n) {
        Vec<double, D> extent = Vec<double, D>::Constant(20.0);
        if constexpr (D == 3) extent[2] = 5;
        const Vec<double, D> p =
            corner + random_in_box<double, D>(random, Vec<double, D>::Zero(), extent);
        points.push_back({apply(inverse(t), p), p + random_normal<double, D>(random, survey_sigma),
                          survey_sigma});
      }
      const auto fit = fit_transform(points, {.max_turn_sigma = 0.2});
      fitted[i] = {static_cast<std::uint32_t>(k + 1), 0, fit ? fit->a_T_b : Transform<double, D>{}};
      good = good && fit.has_value();
    }
  }

  /// Whether subnet k hears a tag at p.
  [[nodiscard]] bool hears(int k, const Vec<double, D>& p) const {
    const double x = p[0] - k % 2 * 20.0;
    const double y = p[1] - k / 2 * 20.0;
    return x > -overlap && x < 20 + overlap && y > -overlap && y < 20 + overlap;
  }

  bool good = true;  ///< the points that chance chose determine every transform
};

/// Corners of a walk that crosses each border twice and the centre, where all four meet.
template <int D>
std::vector<Vec<double, D>> walk() {
  const double corners[][2] = {{5, 5},   {35, 6}, {34, 34}, {6, 35}, {5, 5},
                               {34, 33}, {33, 5}, {7, 34},  {6, 6},  {35, 8}};
  std::vector<Vec<double, D>> path;
  for (std::size_t leg = 0; leg + 1 < std::size(corners); ++leg) {
    const double dx = corners[leg + 1][0] - corners[leg][0];
    const double dy = corners[leg + 1][1] - corners[leg][1];
    const int steps = static_cast<int>(std::sqrt(dx * dx + dy * dy) / 0.15);  // 1.5 m/s, 10 Hz
    for (int i = 0; i < steps; ++i) {
      Vec<double, D> p = Vec<double, D>::Constant(1.0);
      p[0] = corners[leg][0] + dx * i / steps;
      p[1] = corners[leg][1] + dy * i / steps;
      path.push_back(p);
    }
  }
  return path;
}

}  // namespace uwbpos::test
