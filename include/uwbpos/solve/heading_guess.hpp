// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A heading from squared ranges by one linear system. The square of the range from the tag on arm
/// l to anchor a is
/// \f[ \rho^2 = |p + R l|^2 - 2 a^T (p + R l) + |a|^2, \qquad
///     R l = (c l_x - s l_y,\; s l_x + c l_y,\; l_z), \f]
/// whose first term is the same for all anchors of one tag: less the tag's weighted mean, with d =
/// a − ā, it is linear in p, c = cos ψ and s = sin ψ:
/// \f[ d^T p + (d_x l_x + d_y l_y)\, c + (d_y l_x - d_x l_y)\, s =
///     \tfrac12 \left( |a|^2 - \rho^2 - \overline{|a|^2 - \rho^2} \right) - d_z l_z. \qquad (1) \f]
/// The variance of its right-hand side is \f$ \rho^2 \sigma^2 + \sigma^4 / 2 \f$. That c² + s² = 1
/// is left to the descent. As |p + R l|² is free, the system's own χ² of a heading, least over p,
/// \f[ q(\psi) = q_0 + (u - \hat u)^T \Lambda\, (u - \hat u), \qquad u = (c, s), \qquad (2) \f]
/// with Λ the information that (1) holds on u, û its solution and q₀ its χ² there, is to first
/// order a lower bound of the χ² of every pose with that heading: it rules headings out without a
/// descent.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "uwbpos/core/trigonometry.hpp"
#include "uwbpos/solve/pose_normal.hpp"

namespace uwbpos {

/// What (1) says of the heading.
template <class S>
struct HeadingGuess {
  S heading;    ///< [rad]
  S variance;   ///< of c or s, whichever is greater, next to the radius squared, to first order
  Vec<S, 2> u;  ///< û
  S least;      ///< q₀, less what rounding may add
  S xx = S(0);  ///< Λ: of c; 0 where rounding leaves nothing
  S xy = S(0);  ///< Λ: between c and s
  S yy = S(0);  ///< Λ: of s

  /// (2). O(1).
  [[nodiscard]] S least_chi_squared(const Turn<S>& turn) const {
    const S c = turn.cosine - u[0];
    const S s = turn.sine - u[1];
    return least + xx * c * c + S(2) * xy * c * s + yy * s * s;
  }
};

/// (1) of checked ranges, or nothing where it does not determine a heading: too few ranges of one
/// tag, or anchors in one line. O(n·D² + n·tags); 6 kB of stack in
/// double, 3 kB in float, no allocation.
template <class S, int D>
[[nodiscard]] std::optional<HeadingGuess<S>> guess_heading(const PoseProblem<S, D>& problem) {
  constexpr int N = D + 2;  // x, y, c, s, and z last
  struct Group {
    Vec<S, D> arm;
    Vec<S, D> mean;
    S half;
    S weight;
  };
  std::array<Group, kMaxMeasurements> groups;
  std::array<std::uint8_t, kMaxMeasurements> group_of;
  std::size_t count = 0;
  const S rounding = std::numeric_limits<S>::epsilon() * problem.largest;
  const auto weight_of = [rounding](const TagRange<S, D>& r) {
    const S variance = r.sigma * r.sigma;
    return S(1) / (variance * (r.range * r.range + variance / 2 + rounding * rounding));
  };
  const auto half_of = [](const TagRange<S, D>& r, const Vec<S, D>& anchor) {
    return (squared_norm(anchor) - r.range * r.range) / 2;
  };

  for (std::size_t i = 0; i < problem.ranges.size(); ++i) {
    const TagRange<S, D>& r = problem.ranges[i];
    std::size_t g = 0;
    while (g < count && groups[g].arm != r.lever_arm) ++g;
    if (g == count) groups[count++] = {r.lever_arm, Vec<S, D>::Zero(), S(0), S(0)};
    group_of[i] = static_cast<std::uint8_t>(g);
    const S weight = weight_of(r);
    const Vec<S, D> anchor = r.anchor - problem.center;
    groups[g].mean += weight * anchor;
    groups[g].half += weight * half_of(r, anchor);
    groups[g].weight += weight;
  }
  for (std::size_t g = 0; g < count; ++g) {
    groups[g].mean /= groups[g].weight;
    groups[g].half /= groups[g].weight;
  }

  Mat<S, N> normal = Mat<S, N>::Zero();
  Vec<S, N> rhs = Vec<S, N>::Zero();
  S square = S(0);
  for (std::size_t i = 0; i < problem.ranges.size(); ++i) {
    const TagRange<S, D>& r = problem.ranges[i];
    const Group& group = groups[group_of[i]];
    const Vec<S, D> anchor = r.anchor - problem.center;
    const Vec<S, D> d = anchor - group.mean;
    const Vec<S, D>& l = r.lever_arm;
    Vec<S, N> row;
    row[0] = d[0];
    row[1] = d[1];
    row[2] = d[0] * l[0] + d[1] * l[1];
    row[3] = d[1] * l[0] - d[0] * l[1];
    S right = half_of(r, anchor) - group.half;
    if constexpr (D == 3) {
      row[4] = problem.height.pinned ? S(0) : d[2];
      right -= d[2] * (l[2] + (problem.height.pinned ? problem.height.value : S(0)));
    }
    const S weight = weight_of(r);
    add_outer(normal, row, weight);
    rhs += (weight * right) * row;
    square += weight * right * right;
  }

  const auto finish = [square](const auto& factor,
                               const auto& b) -> std::optional<HeadingGuess<S>> {
    const auto solution = factor.solve(b);
    const auto covariance = factor.inverse();
    const S c = solution[2];
    const S s = solution[3];
    const S variance = std::max(covariance(2, 2), covariance(3, 3));
    const S xx = covariance(2, 2);
    const S xy = covariance(3, 2);
    const S yy = covariance(3, 3);
    constexpr S kLost = S(64) * std::numeric_limits<S>::epsilon();
    const S lost = kLost * square;
    const S of_c = xx - xy * (xy / yy);
    const S of_s = yy - xy * (xy / xx);
    if (!std::isfinite(c) || !std::isfinite(s) || !std::isfinite(variance)) return std::nullopt;
    HeadingGuess<S> guess{arctangent(s, c),
                          variance / std::max(c * c + s * s, S(1e-6)),
                          {c, s},
                          std::max(square - dot(b, solution) - lost, S(0))};
    if (of_c > S(0) && of_s > S(0)) {
      guess.xx = S(1) / of_c;
      guess.xy = -(xy / yy) / of_c;
      guess.yy = S(1) / of_s;
    }
    return guess;
  };
  if constexpr (D == 3) {
    const Ldlt<S, N> whole{normal};
    if (whole.positive_definite()) return finish(whole, rhs);
  }
  // In the plane; a height that is known; anchors of one height, which say nothing of z here.
  const Mat<S, 4> level = normal.template topLeftCorner<4, 4>();
  const Ldlt<S, 4> factor{level};
  if (!factor.positive_definite()) return std::nullopt;
  return finish(factor, Vec<S, 4>{rhs.template head<4>()});
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
