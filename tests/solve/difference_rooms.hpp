// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Rooms with anchors and a tag as range differences have them.

#include <cmath>
#include <vector>

#include "uwbpos/model/difference_set.hpp"

#include "solve/rooms.hpp"

namespace uwbpos::test {

/// A tag, anchors, and exact differences of all the others against the first, rounded to S once.
template <class S, int D>
struct DifferenceRoom {
  Vec<S, D> tag;
  Vec<S, D> reference;
  std::vector<DifferenceTo<S, D>> differences;
};

/// |tag − b| − |tag − a| as a double has it, rounded to S.
template <class S, int D>
S true_difference(const Vec<S, D>& tag, const Vec<S, D>& a, const Vec<S, D>& b) {
  const Vec<double, D> p = tag.template cast<double>();
  return static_cast<S>((p - b.template cast<double>()).norm() -
                        (p - a.template cast<double>()).norm());
}

/// The differences at `tag` against the anchor at place `reference`.
template <class S, int D>
DifferenceRoom<S, D> differences_between(const Vec<S, D>& tag,
                                         const std::vector<Vec<S, D>>& anchors,
                                         std::size_t reference = 0) {
  DifferenceRoom<S, D> room{tag, anchors[reference], {}};
  for (std::size_t i = 0; i < anchors.size(); ++i) {
    if (i == reference) continue;
    room.differences.push_back(
        {anchors[i], true_difference<S, D>(tag, anchors[reference], anchors[i])});
  }
  return room;
}

/// PDOP of differences at the tag, or a huge number where there is none.
template <class S, int D>
double difference_dilution(const Vec<S, D>& tag, const std::vector<Vec<S, D>>& anchors) {
  std::vector<Vec<double, D>> exact;
  for (const auto& a : anchors) exact.push_back(a.template cast<double>());
  const auto dop = pseudorange_dop(exact, tag.template cast<double>());
  return dop ? dop->pdop : 1e300;
}

/// Anchors of a random room of 20 m × 15 m (× 6 m) and a tag within 1.5 × their hull, PDOP <
/// `worst`; every tenth time the exact centre of a square or cube, where all differences are zero.
template <class S, int D>
std::pair<Vec<S, D>, std::vector<Vec<S, D>>> random_difference_room(sim::Random& random, int fewest,
                                                                    int most, double worst = 20) {
  if (random.chance(0.1)) {
    std::vector<Vec<S, D>> corners;
    for (int i = 0; i < (1 << D); ++i) {
      Vec<S, D> corner;
      for (int k = 0; k < D; ++k) corner[k] = ((i >> k) & 1) != 0 ? S(8) : S(0);
      corners.push_back(corner);
    }
    return {Vec<S, D>::Constant(S(4)), corners};
  }
  const double size[3] = {20, 15, 6};
  for (;;) {
    std::vector<Vec<S, D>> anchors(static_cast<std::size_t>(random.integer(fewest, most)));
    Vec<double, D> middle = Vec<double, D>::Zero();
    Vec<double, D> inside = Vec<double, D>::Zero();
    double weights = 0;
    for (auto& anchor : anchors) {
      for (int k = 0; k < D; ++k) anchor[k] = S(random.uniform(0, size[k]));
      const double weight = random.exponential(1);
      middle += anchor.template cast<double>() / static_cast<double>(anchors.size());
      inside += weight * anchor.template cast<double>();
      weights += weight;
    }
    const Vec<double, D> tag = middle + random.uniform(0, 1.5) * (inside / weights - middle);
    const Vec<S, D> rounded = tag.template cast<S>();
    if (difference_dilution<S, D>(rounded, anchors) < worst) return {rounded, anchors};
  }
}

/// Differences of arrivals with independent noise of standard deviation `sigma`.
template <class S, int D>
std::vector<DifferenceTo<S, D>> noisy(sim::Random& random, const DifferenceRoom<S, D>& room,
                                      double sigma) {
  const double shared = random.normal(0, sigma);
  auto differences = room.differences;
  for (auto& d : differences) d.difference += S(random.normal(0, sigma) - shared);
  return differences;
}

}  // namespace uwbpos::test
