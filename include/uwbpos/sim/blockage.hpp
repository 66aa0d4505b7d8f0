// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Non-line-of-sight: the excess path of links through walls and past people.
///
/// A link between two radios is clear or blocked. Blockages begin and end at random (a two-state
/// Markov process): blocked a share \f$ p \f$ of the time, for a mean duration \f$ m \f$. A time
/// \f$ \Delta \f$ after a state \f$ b \in \{0, 1\} \f$ was seen,
/// \f[ P(\text{blocked}) = p + (b - p)\, e^{-\Delta / (m (1 - p))} \tag{1} \f]
/// A blockage lengthens the path by an amount that is drawn when it begins and then stays; the
/// one that was seen lasts with probability \f$ e^{-\Delta/m} \f$, which is part of (1).

#include <cmath>
#include <span>

#include "uwbpos/core/types.hpp"
#include "uwbpos/sim/instant.hpp"
#include "uwbpos/sim/noise.hpp"

namespace uwbpos::sim {

/// How links are blocked. The defaults block none.
struct Blockage {
  double probability = 0;     ///< share of the time that a link is blocked, 0 … 1
  double mean_duration = 0;   ///< of a blockage [s]; zero draws anew for every exchange
  double minimum_excess = 0;  ///< least excess path while blocked [m]
  double mean_excess = 0.5;   ///< mean of the exponential on top of it [m]
};

/// The state of one link.
struct Link {
  bool known = false;    ///< whether it has been looked at
  bool blocked = false;  ///< whether it was blocked then
  double excess = 0;     ///< its excess path [m], zero when clear
  Instant at{};          ///< when that was
};

/// The link at a later instant by (1); `link.excess` is its excess path [m], zero when clear.
/// Draws two numbers whatever happens.
[[nodiscard]] inline Link update(Link link, const Blockage& blockage, Instant instant,
                                 Random& random) {
  const double draw = random.uniform();
  const double fresh = blockage.minimum_excess + random.exponential(blockage.mean_excess);
  const double p = blockage.probability;
  const double m = blockage.mean_duration;
  const double interval = link.known && m > 0 ? instant - link.at : 0;
  const bool remembered = link.known && m > 0;
  const double memory = remembered && p < 1 ? std::exp(-interval / (m * (1 - p))) : 0.0;
  const double lasting = remembered && link.blocked ? std::exp(-interval / m) : 0.0;
  const bool blocked = draw < p + ((link.blocked ? 1.0 : 0.0) - p) * memory;
  const double excess = !blocked ? 0.0 : draw < lasting ? link.excess : fresh;
  return {true, blocked, excess, instant};
}

/// A vertical wall from floor to ceiling over a segment of the plan.
struct Wall {
  Vec<double, 2> from = Vec<double, 2>::Zero();  ///< one end [m]
  Vec<double, 2> to = Vec<double, 2>::Zero();    ///< the other [m]
  double excess = 0.3;  ///< how much longer a path through it is to the radio [m]
};

/// Whether the straight line between two points passes through a wall. Of two walls that share
/// an end, a line through that end crosses one.
[[nodiscard]] inline bool crosses(const Wall& wall, const Vec<double, 3>& p,
                                  const Vec<double, 3>& q) {
  const auto left_of = [](const auto& a, const auto& b, const auto& c) {
    return (b(0) - a(0)) * (c(1) - a(1)) - (b(1) - a(1)) * (c(0) - a(0)) > 0;
  };
  return left_of(p, q, wall.from) != left_of(p, q, wall.to) &&
         left_of(wall.from, wall.to, p) != left_of(wall.from, wall.to, q);
}

/// Excess path [m] of the straight line between two points through all walls; O(walls).
[[nodiscard]] inline double wall_excess(std::span<const Wall> walls, const Vec<double, 3>& p,
                                        const Vec<double, 3>& q) {
  double excess = 0;
  for (const Wall& wall : walls) {
    if (crosses(wall, p, q)) excess += wall.excess;
  }
  return excess;
}

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
