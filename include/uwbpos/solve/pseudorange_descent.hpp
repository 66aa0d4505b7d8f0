// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The descent of newton.hpp to the minimum of χ² of pseudoranges, over positions with the bias at
/// its best (pseudorange_profile.hpp), from the closed form's roots.

#include "uwbpos/solve/mirror_choice.hpp"
#include "uwbpos/solve/pseudorange_profile.hpp"
#include "uwbpos/solve/pseudorange_roots.hpp"

namespace uwbpos {

/// The shortest step [m] that the scalar can tell near these roots.
template <class S, int D>
[[nodiscard]] S pseudorange_rounding(const PseudorangeRoots<S, D>& roots) {
  return S(4) * std::numeric_limits<S>::epsilon() * roots.largest;
}

/// A minimum of χ² and the profile there, with J; relative to the roots' center and mean.
template <class S, int D>
struct PseudorangeMinimum {
  Vec<S, D> position;                ///< [m]
  PseudorangeProfile<S, D> profile;  ///< there
};

/// The minimum of χ² in whose basin `root` lies, relative to `roots` as its candidates are. O(n·D²)
/// an iteration, no allocation. Error::NotConverged.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] Result<PseudorangeMinimum<S, D>> descend_pseudoranges(
    const V& view, const PseudorangeRoots<S, D>& roots, const Vec<S, D + 1>& root) {
  constexpr int kIterations = 100;
  const Vec<S, D> start = root.template head<D>();
  // The bias follows from the lowest profile met, by its gradient.
  Vec<S, D> at = start;
  Vec<S, D> slope = Vec<S, D>::Zero();
  S bias = root[D];
  S lowest = std::numeric_limits<S>::infinity();
  PseudorangeMinimum<S, D> minimum;
  PseudorangeProfile<S, D>& profile = minimum.profile;
  const auto evaluate = [&](const Vec<S, D>& position,
                            Curvature curvature) -> const NormalEquations<S, D>& {
    minimum.position = position;
    const S near = bias - dot<S, D>(slope, position - at);
    profile = pseudorange_profile<S, D>(view, roots.center, roots.mean_pseudorange, position,
                                        curvature, near);
    if (profile.normal.chi_squared < lowest) {
      at = position;
      slope = profile.mean_gradient;
      bias = profile.bias;
      lowest = profile.normal.chi_squared;
    }
    return profile.normal;
  };
  const Result<Minimum<S, D>> found =
      minimise<S, D>(evaluate, start, pseudorange_rounding(roots), kIterations);
  if (!found) return std::unexpected(found.error());
  // χ² may fall towards a far end of the hyperbolas, where rounding ends it.
  const S farthest = S(1e3) * (roots.largest + norm(start));
  if (!(norm(found->state) < farthest)) return std::unexpected(Error::NotConverged);
  // What the last, negligible step changes, to first order.
  profile.bias -= dot<S, D>(profile.mean_gradient, found->state - minimum.position);
  profile.normal.chi_squared = found->chi_squared;
  minimum.position = found->state;
  return minimum;
}

/// The minimum of χ² in whose basin root `i` lies. O(n·D²) an iteration, no allocation.
/// Error::NotConverged.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] Result<PseudorangeMinimum<S, D>> pseudorange_minimum(
    const V& view, const PseudorangeRoots<S, D>& roots, int i) {
  const int freedom = static_cast<int>(view.size()) - (D + 1);
  // The refined root is near its minimum unless noise has sent it astray, which shows in a χ² that
  // is not believable.
  Result<PseudorangeMinimum<S, D>> minimum =
      descend_pseudoranges<S, D>(view, roots, refined_candidate<S, D>(view, roots, i));
  if (!minimum || !is_believable(minimum->profile.normal.chi_squared, freedom)) {
    const auto again = descend_pseudoranges<S, D>(view, roots, roots.candidates[i]);
    if (!minimum ||
        (again && again->profile.normal.chi_squared < minimum->profile.normal.chi_squared)) {
      minimum = again;
    }
  }
  return minimum;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
