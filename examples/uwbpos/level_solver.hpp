// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Position in the plane from range differences, at a known height above or below the anchors.
/// Differences cannot be brought to the plane one by one as ranges can: the descent is over (x, y)
/// with the model in space,
///   (1) \f$ h(x, y) = |p - b| - |p - a|,\quad p = (x, y, \text{height}) \f$.

#include <optional>
#include <span>

#include "uwbpos/solve/exclude_outliers.hpp"

namespace uwbpos::host {

using Pairs = std::span<const PairDifference<double, 3>>;

/// The minimum of (1) from `prior` and from a grid of places over and around the anchors. Two
/// places that explain the differences equally well are settled by the prior.
/// Errors: those of `check_pairs`; DegenerateGeometry; AmbiguousSolution.
[[nodiscard]] Result<Fix<double, 2>> locate_level(Pairs pairs, double height,
                                                  const LocateOptions<double, 2>& options = {});

/// `locate_level` without outliers, as `locate_excluding` does it.
[[nodiscard]] Result<ExclusionFix<double, 2>> locate_level_excluding(
    Pairs pairs, double height, const LocateOptions<double, 2>& options,
    const ExclusionOptions<double>& exclusion);

}  // namespace uwbpos::host
