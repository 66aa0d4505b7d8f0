// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Minima of the χ² of a pose. At a given heading ψ the ranges are those of one point p to anchors
/// a − R(ψ) l: toa_roots.hpp gives the one or two places to descend from.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

#include "uwbpos/solve/heading_guess.hpp"
#include "uwbpos/solve/toa_roots.hpp"

namespace uwbpos::detail {

inline constexpr int kPoseIterations = 50;

/// The lowest minimum met, and the lowest of the others.
template <class S, int D>
struct PoseMinima {
  Result<Minimum<S, D + 1>> best = std::unexpected(Error::DegenerateGeometry);
  Result<Minimum<S, D + 1>> other = std::unexpected(Error::DegenerateGeometry);

  void take(const PoseProblem<S, D>& problem, const Minimum<S, D + 1>& found) {
    const S circle = S(2) * std::numbers::pi_v<S> * problem.arm;
    const auto same = [&](const Result<Minimum<S, D + 1>>& kept) {
      if (!kept) return false;
      Vec<S, D + 1> apart = found.state - kept->state;
      apart[D] = std::remainder(apart[D], circle);
      const S near = S(1e-3) * problem.largest;
      return squared_norm(apart) <= near * near;
    };
    if (!best || found.chi_squared < best->chi_squared) {
      if (!same(best)) other = best;
      if (same(other)) other = std::unexpected(Error::DegenerateGeometry);
      best = found;
    } else if (!same(best) && (!other || found.chi_squared < other->chi_squared)) {
      other = found;
    }
  }
};

/// Descends from the root or roots that a heading leaves. Errors of roots and descents stay in
/// `minima` where nothing better is found.
template <class S, int D>
void descend_at(const PoseProblem<S, D>& problem, S heading, PoseMinima<S, D>& minima) {
  std::array<RangeTo<S, D>, kMaxMeasurements> storage;
  const Turn<S> turn = turn_of(heading);
  std::size_t n = 0;
  for (const TagRange<S, D>& r : problem.ranges) {
    storage[n++] = {r.anchor - problem.center - turned<S, D>(turn, r.lever_arm), r.range, r.sigma};
  }
  const Result<ToaRoots<S, D>> roots = toa_roots<S, D>(RangeSpan<S, D>{storage.data(), n});
  if (!roots) return;
  const S rounding = S(4) * std::numeric_limits<S>::epsilon() * problem.largest;
  const auto evaluate = [&](const Vec<S, D + 1>& state, Curvature curvature) {
    return pose_normal<S, D>(problem, state, curvature);
  };
  const auto descend_from = [&](S tau) {
    const Vec<S, D> position = roots->center + roots->foot + tau * roots->direction;
    Vec<S, D + 1> state;
    for (int k = 0; k < D; ++k) state[k] = position[k];
    if constexpr (D == 3) {
      if (problem.height.pinned) state[2] = problem.height.value;
    }
    state[D] = heading * problem.arm;
    const Result<Minimum<S, D + 1>> found =
        minimise<S, D + 1>(evaluate, state, rounding, kPoseIterations);
    if (found) {
      minima.take(problem, *found);
    } else if (!minima.best) {
      minima.best = found;
    }
  };
  const S up = roots->direction[D - 1];
  if (D == 3 && problem.height.pinned && std::abs(up) > S(0.5)) {
    // The root is where the line of roots crosses the known height.
    descend_from((problem.height.value - roots->center[D - 1] - roots->foot[D - 1]) / up);
    return;
  }
  const RootChoice<S> choice = weigh_roots(*roots);
  descend_from(choice.likely);
  // As `locate` has it: beyond this Δχ² of the linear system nothing can turn it round.
  constexpr S kBeyondDoubt = S(100);
  const S doubt = S(4) * roots->linear_information * std::abs(choice.likely * roots->linear);
  if (roots->flat() || (choice.two_minima && !(doubt > kBeyondDoubt))) descend_from(choice.other);
}

/// The heading is sure to lie in the basin of the linear system's: 4 standard deviations of c and s
/// stay within the radius of the circle, also when χ² says that sigmas are too small.
template <class S>
bool is_sure(const HeadingGuess<S>& guess, S chi_squared, int degrees_of_freedom) {
  const S freedom = static_cast<S>(std::max(degrees_of_freedom, 1));
  return S(16) * guess.variance * std::max(S(1), chi_squared / freedom) <= S(1);
}

}  // namespace uwbpos::detail

#include "uwbpos/core/macros_back.hpp"
