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

/// The lowest minimum met, and the lowest of the others: those four standard deviations away or
/// more. Nearer ones, as beside an anchor, the covariance covers.
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
      if (squared_norm(apart) <= near * near) return true;
      const Vec<S, D + 1> scaled = symmetric_from_lower(kept->information) * apart;
      return dot(apart, scaled) < S(16);
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
  if (!roots) {
    if (!minima.best) minima.best = std::unexpected(roots.error());
    return;
  }
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

inline constexpr int kPoseHeadings = 12;

/// The headings to start from where none is sure: k/12 of a circle.
template <class S>
inline constexpr std::array<Turn<S>, kPoseHeadings> kPoseTurns = [] {
  constexpr S h = S(0.5);
  constexpr S r = S(0.86602540378443864676);
  constexpr S i = S(1);
  constexpr S o = S(0);
  return std::array<Turn<S>, kPoseHeadings>{{{i, o},
                                             {r, h},
                                             {h, r},
                                             {o, i},
                                             {-h, r},
                                             {-r, h},
                                             {-i, o},
                                             {-r, -h},
                                             {-h, -r},
                                             {o, -i},
                                             {h, -r},
                                             {r, -h}}};
}();

template <class S>
S pose_heading(int k) {
  return S(2) * std::numbers::pi_v<S> * static_cast<S>(k) / S(kPoseHeadings);
}

/// What a heading costs a pose at least, to first order: (2) of heading_guess.hpp and what is known
/// of it beforehand.
template <class S, int D>
S least_chi_squared(const PoseProblem<S, D>& problem, const std::optional<HeadingGuess<S>>& linear,
                    int k) {
  S least = linear ? linear->least_chi_squared(kPoseTurns<S>[static_cast<std::size_t>(k)]) : S(0);
  if (problem.heading.information > S(0)) {
    const S known = problem.heading.value / problem.arm;
    const S off = angle_difference(pose_heading<S>(k), known) * problem.arm;
    least += problem.heading.information * off * off;
  }
  return least;
}

}  // namespace uwbpos::detail

#include "uwbpos/core/macros_back.hpp"
