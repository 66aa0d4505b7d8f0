// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The line on which squared ranges put the tag, and the two points of it that they leave.
/// (2) of squared_ranges.hpp determines all of s but along the direction v that the anchors span
/// worst (exactly the normal of a ceiling, of a wall, of a row; weak_line.hpp):
/// \f[ s = f + \tau v, \quad f \perp v, \qquad |s|^2 = \rho^2 \;\Rightarrow\;
///     \tau = \pm \sqrt{q}, \quad q = \rho^2 - |f|^2. \qquad (1) \f]
/// (1) holds for every geometry, flat or not; what the linear system itself says about τ, nothing
/// when the anchors are flat, tells the two roots apart.

#include "uwbpos/solve/squared_ranges.hpp"
#include "uwbpos/solve/weak_line.hpp"

namespace uwbpos {

/// The two roots `foot` ± √square · `direction`, relative to `center`.
template <class S, int D>
struct ToaRoots {
  Vec<S, D> center;      ///< weighted mean of the anchors [m]
  Vec<S, D> foot;        ///< f [m]
  Vec<S, D> direction;   ///< v, unit length
  S square;              ///< q [m²]; negative when noise puts the tag beyond the anchors' plane
  S square_variance;     ///< its variance [m⁴], to first order
  S linear;              ///< τ as the linear system has it [m]; 0 when it says nothing
  S linear_information;  ///< 1/variance of `linear` [1/m²]; 0 for flat anchors
  S largest;             ///< the greatest length met [m]

  /// What `square` may be off by from rounding alone [m²].
  [[nodiscard]] S rounding() const {
    return S(8) * std::numeric_limits<S>::epsilon() * largest * largest;
  }
  /// True when the anchors lie in one plane (3-D) or line (2-D) to working precision.
  [[nodiscard]] bool flat() const { return !(linear_information > S(0)); }
};

/// Solves (1) from checked ranges. O(n·D²), no allocation.
/// Error::DegenerateGeometry when the anchors span fewer than D − 1 dimensions;
/// Error::NumericOverflow.
template <class S, int D>
[[nodiscard]] Result<ToaRoots<S, D>> toa_roots(RangeSpan<S, D> ranges) {
  const SquaredRanges<S, D> system = squared_ranges<S, D>(ranges);
  const Result<WeakLine<S, D>> line = weak_line<S, D>(system.normal, system.rhs);
  if (!line) return std::unexpected(line.error());
  ToaRoots<S, D> roots;
  roots.center = system.center;
  roots.foot = line->foot;
  roots.direction = line->direction;
  roots.square = system.rho_squared - squared_norm(line->foot);
  // var(q) = var(ρ²) + 4 fᵀ cov(f) f, with cov = normal⁻¹/4 of the strong block.
  roots.square_variance = S(1) / system.total_weight + line->foot_spread;
  roots.linear = line->linear;
  roots.linear_information = S(4) * line->information;
  roots.largest = system.largest;
  if (!all_finite(roots.foot) || !all_finite(roots.direction) || !std::isfinite(roots.square) ||
      !std::isfinite(roots.square_variance) || !std::isfinite(roots.linear)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return roots;
}

/// What the linear system and the roots together say about τ, by their weights: the quartic
/// \f[ \chi^2(\tau) = i (\tau - \tau_0)^2 + (\tau^2 - q)^2 / v. \qquad (2) \f]
template <class S>
struct RootChoice {
  S likely;         ///< τ near the lowest minimum of (2) [m]
  S other;          ///< τ near the other minimum [m]; meaningless without `two_minima`
  bool two_minima;  ///< false when (2) has one
};

/// The minima of (2), each by two Newton steps. O(1), no allocation. Flat anchors have both roots.
template <class S, int D>
[[nodiscard]] RootChoice<S> weigh_roots(const ToaRoots<S, D>& roots) {
  // Half the derivative: v⁻¹ (2τ³ + 2(a − q)τ − 2aτ₀) with a = i v / 2.
  const S root = roots.square > S(0) ? std::sqrt(roots.square) : S(0);
  const S a = roots.linear_information * roots.square_variance / 2;
  const auto polish = [&](S tau) {
    for (int i = 0; i < 2; ++i) {
      const S curvature = S(3) * tau * tau + a - roots.square;
      if (!(curvature > S(0))) break;
      tau -= ((tau * tau + a - roots.square) * tau - a * roots.linear) / curvature;
    }
    return tau;
  };
  const S towards = roots.linear < S(0) ? -root : root;
  const S weight = S(2) * roots.square;  // of the root, as a is of the linear solution
  const S start = a + weight > S(0) && roots.square > S(0)
                      ? (a * roots.linear + weight * towards) / (a + weight)
                      : (a > S(0) ? roots.linear : S(0));
  const S gap = roots.square - a;
  const bool two =
      gap > S(0) && S(27) * a * a * roots.linear * roots.linear < S(4) * gap * gap * gap;
  return {polish(start), polish(-towards), two};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
