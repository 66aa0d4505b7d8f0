// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Rooms with anchors and a tag, for the laws that every solver of ranges keeps.

#include <cmath>
#include <vector>

#include "uwbpos/accuracy/dop.hpp"
#include "uwbpos/model/range_set.hpp"

#include "support/random_geometry.hpp"

namespace uwbpos::test {

/// Where the tag is, and exact ranges to the anchors, rounded to S once.
template <class S, int D>
struct Room {
  Vec<S, D> tag;
  std::vector<RangeTo<S, D>> ranges;
};

/// The distance as a double has it, rounded to S.
template <class S, int D>
S true_range(const Vec<S, D>& tag, const Vec<S, D>& anchor) {
  return static_cast<S>((tag.template cast<double>() - anchor.template cast<double>()).norm());
}

/// Dilution seen by the tag, or a huge number where there is none.
template <class S, int D>
double dilution(const Room<S, D>& room) {
  std::vector<Vec<double, D>> anchors;
  for (const auto& r : room.ranges) anchors.push_back(r.anchor.template cast<double>());
  const auto dop = range_dop(anchors, room.tag.template cast<double>());
  return dop ? dop->gdop : 1e300;
}

/// A random room of 20 m × 15 m (× 6 m): anchors in it, on its ceiling if `ceiling`, a tag in it or
/// up to 2 m outside it (below the ceiling by at least 20 cm), GDOP below `worst`.
template <class S, int D>
Room<S, D> random_room(sim::Random& random, int fewest, int most, bool ceiling = false,
                       double worst = 20) {
  for (;;) {
    const int n = random.integer(fewest, most);
    Room<S, D> room;
    room.tag = random_in_box<S, D>(random, room_corner<S, D>(-2, -2, ceiling ? 0 : -2),
                                   room_corner<S, D>(22, 17, ceiling ? 2.8 : 8));
    for (int i = 0; i < n; ++i) {
      Vec<S, D> anchor =
          random_in_box<S, D>(random, room_corner<S, D>(0, 0, 0), room_corner<S, D>(20, 15, 6));
      if (ceiling) anchor[D - 1] = S(3);
      room.ranges.push_back({anchor, true_range(room.tag, anchor)});
    }
    if (dilution(room) < worst) return room;
  }
}

/// The same ranges with noise of their own sigma.
template <class S, int D>
std::vector<RangeTo<S, D>> noisy(sim::Random& random, std::vector<RangeTo<S, D>> ranges) {
  for (auto& r : ranges) r.range += S(random.normal()) * r.sigma;
  return ranges;
}

/// Four anchors in the corners of a hall of 10 m × 8 m.
template <class S>
std::vector<Vec<S, 2>> four_corners() {
  return {{0, 0}, {10, 0}, {10, 8}, {0, 8}};
}

/// Exact ranges from the tag to anchors.
template <class S, int D>
std::vector<RangeTo<S, D>> ranges_between(const Vec<S, D>& tag,
                                          const std::vector<Vec<S, D>>& anchors, S sigma = S(0.1)) {
  std::vector<RangeTo<S, D>> ranges;
  for (const auto& anchor : anchors) {
    ranges.push_back({anchor, true_range<S, D>(tag, anchor), sigma});
  }
  return ranges;
}

/// How far off an answer to noiseless ranges may be in rooms of GDOP < 20 [m].
/// Ranges of 25 m carry ε/2 · 25 m of rounding each (1.5e-6 m in float), the centred coordinates as
/// much again; GDOP 20 makes 6e-5 m of it.
template <class S>
constexpr double exactness() {
  return sizeof(S) == 4 ? 1e-4 : 1e-11;
}

}  // namespace uwbpos::test
