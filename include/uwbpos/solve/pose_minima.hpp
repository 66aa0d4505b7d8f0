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

/// The lowest minima met, each four standard deviations away from the others or more: nearer ones,
/// as beside an anchor, the covariance covers. Anchors in a line leave a pose four, mirrored and
/// turned.
template <class S, int D>
class PoseMinima {
 public:
  /// Takes a minimum among the lowest, where it belongs.
  void take(const PoseProblem<S, D>& problem, const Minimum<S, D + 1>& found) {
    const S circle = S(2) * std::numbers::pi_v<S> * problem.arm;
    const auto same = [&](const Minimum<S, D + 1>& kept) {
      Vec<S, D + 1> apart = found.state - kept.state;
      apart[D] = std::remainder(apart[D], circle);
      const S near = S(1e-3) * problem.largest;
      if (squared_norm(apart) <= near * near) return true;
      const Vec<S, D + 1> scaled = symmetric_from_lower(kept.information) * apart;
      return dot(apart, scaled) < S(16);
    };
    // Those that stay: the lower ones, then `found`, then those higher that it is not.
    int at = 0;
    while (at < count_ && !(found.chi_squared < kept_[at].chi_squared)) {
      if (same(kept_[at])) return;
      ++at;
    }
    Minimum<S, D + 1> next = found;
    int end = at;
    for (int i = at; i < count_; ++i) {
      if (same(kept_[i])) continue;
      std::swap(next, kept_[i]);
      if (end != i) kept_[end] = kept_[i];
      ++end;
    }
    if (end < kMost) kept_[end++] = next;
    count_ = end;
  }
  /// Notes why a descent found none.
  void note(Error error) { error_ = error; }

  /// How many there are.
  [[nodiscard]] int count() const { return count_; }
  /// Number i, the lowest first.
  [[nodiscard]] const Minimum<S, D + 1>& operator[](int i) const { return kept_[i]; }
  /// Why there is none.
  [[nodiscard]] Error error() const { return error_; }

 private:
  static constexpr int kMost = 4;
  Minimum<S, D + 1> kept_[kMost];
  int count_ = 0;
  Error error_ = Error::DegenerateGeometry;
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
    minima.note(roots.error());
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
    } else {
      minima.note(found.error());
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
