// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Height projection: the horizontal part of a slant range between two known heights. Source:
/// indoor food-delivery robot (000).
///
/// With slant range \f$ D_t \f$, height difference \f$ h = |H_b - H_r| \f$ and elevation
/// \f$ \epsilon \f$,
/// \f[ \cos^2\epsilon = \frac{D_t - h}{D_t}\left(1 + \frac{h}{D_t}\right), \qquad
///     D = D_t \cos\epsilon = \sqrt{D_t^2 - h^2} \tag{000-17} \f]
/// \f[ \operatorname{var} D = \min\left( \frac{\operatorname{var} D_t}{\cos^2\epsilon},\;
///     \sqrt{\tfrac{2}{\pi}}\, \sigma\,(2 D_t + \sqrt 2\,\sigma) \right) \tag{1} \f]
///
/// **Near the foot of the anchor.** The first term of (1) is first-order propagation,
/// \f$ (D_t/D)^2\sigma^2 \f$, and grows without bound as \f$ D \to 0 \f$. The error does not: what
/// is normal is \f$ D^2 \f$, with deviation \f$ s \approx 2 D_t\sigma \f$, and
/// \f$ |\sqrt a - \sqrt b| \le \sqrt{|a - b|} \f$ bounds the mean squared error of \f$ D \f$ by
/// \f$ E|\Delta D^2| = \sqrt{2/\pi}\,s \f$, the second term. For a tag equally likely anywhere on
/// the floor, (1) is exact at \f$ D = 0 \f$ and far away, too large by up to a factor 3.3
/// between, and never too small by more than 12 %. The second term takes over below
/// \f$ D \approx 0.79 \sqrt{D_t\sigma} \f$: 0.37 m for 0.1 m of noise under 2.2 m of height.
/// There the error of \f$ D \f$ is skewed as well; a solver that can use the slant range should.

#include <algorithm>
#include <cmath>
#include <numbers>

#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"

namespace uwbpos {

/// Horizontal range [m] and its variance [m²], by (000-17) and (1).
///
/// `slant`: range [m] and variance [m²]; a variance of zero is an exact range, and stays one.
/// `anchor_height`, `tag_height` [m] in one frame, taken as exact: an error \f$ \delta \f$ of
/// their difference moves the answer by \f$ -\delta h / D \f$.
/// Errors: NotFinite (any input, or heights or a variance too large for S); NegativeRange;
/// NonPositiveSigma (negative variance); HeightExceedsRange (\f$ D_t < h \f$: no horizontal range
/// exists, although noise alone does this to a tag that stands right under its anchor).
/// Two square roots, three divisions; no allocation.
template <class S>
[[nodiscard]] Result<Measured<S>> horizontal_range(Measured<S> slant, S anchor_height,
                                                   S tag_height) {
  const S h = std::abs(anchor_height - tag_height);
  if (!std::isfinite(slant.value) || !std::isfinite(slant.variance) || !std::isfinite(h)) {
    return std::unexpected(Error::NotFinite);
  }
  if (slant.value < 0) return std::unexpected(Error::NegativeRange);
  if (slant.variance < 0) return std::unexpected(Error::NonPositiveSigma);
  if (slant.value < h) return std::unexpected(Error::HeightExceedsRange);

  constexpr S mean_of_absolute_normal = std::numbers::inv_sqrtpi_v<S> * std::numbers::sqrt2_v<S>;
  const S sigma = std::sqrt(slant.variance);
  const S bound =
      mean_of_absolute_normal * sigma * (2 * slant.value + std::numbers::sqrt2_v<S> * sigma);
  const bool at_foot = !(slant.value > h);
  const S cosine_squared = at_foot ? S(0) : (slant.value - h) / slant.value * (1 + h / slant.value);
  const S variance = at_foot ? bound : std::min(slant.variance / cosine_squared, bound);
  if (!std::isfinite(variance)) return std::unexpected(Error::NotFinite);
  return Measured<S>{slant.value * std::sqrt(cosine_squared), variance};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
