// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Ranges with one common bias in closed form, by any number of anchors, flat or not; Bancroft's
/// solution (IEEE Trans. AES 21(1), 1985) is the minimum of it. With c and \f$ \bar\rho \f$ the
/// weighted means of anchors and pseudoranges, \f$ u_i = a_i - c, \; \varrho_i = \rho_i - \bar\rho,
/// \; s = p - c, \; \beta = b - \bar\rho \f$, the squares \f$ (\varrho_i - \beta)^2 =
/// |s - u_i|^2 \f$ fall into their mean and the differences from it:
/// \f[ |s|^2 - \beta^2 = \overline{\varrho^2 - |u|^2} =: \Lambda, \qquad
///     u_i^T s - \varrho_i \beta = \tfrac12 (|u_i|^2 - \varrho_i^2 + \Lambda). \qquad (1), (2) \f]
/// It is the system of squared_ranges.hpp in one dimension more, where (1) has the sign of
/// space-time. (2) leaves a line in (s, β), (1) two points of it; both may be positions. Equal
/// pseudoranges, the centre of a square, only turn the line along β.

#include <algorithm>
#include <cmath>
#include <limits>

#include "uwbpos/core/lanes.hpp"
#include "uwbpos/model/pseudorange.hpp"
#include "uwbpos/solve/square_sums.hpp"
#include "uwbpos/solve/weak_line.hpp"

namespace uwbpos {

/// A position [m] and the bias [m] that all pseudoranges share.
template <class S, int D>
struct BiasedPosition {
  Vec<S, D> position;  ///< [m]
  S bias;              ///< [m]
};

/// Where pseudoranges may come from: states (position, bias), relative to `center` and
/// `mean_pseudorange`; the first `count` of two.
template <class S, int D>
struct PseudorangeRoots {
  Vec<S, D> center;             ///< weighted mean of the anchors [m]
  S mean_pseudorange;           ///< weighted mean of the pseudoranges [m]
  Vec<S, D + 1> candidates[2];  ///< (s, β) [m]
  int count;                    ///< 0, 1 or 2
  Vec<S, D> across;             ///< unit normal of flat anchors, zero of others
  S largest;                    ///< the greatest length met [m]

  /// Whether all anchors lie in one plane (3-D) or line (2-D) to working precision.
  [[nodiscard]] bool flat() const { return across != Vec<S, D>::Zero(); }
  /// Candidate `i` in the anchors' frame.
  [[nodiscard]] BiasedPosition<S, D> at(int i) const {
    BiasedPosition<S, D> solution;
    for (int k = 0; k < D; ++k) solution.position[k] = center[k] + candidates[i][k];
    solution.bias = mean_pseudorange + candidates[i][D];
    return solution;
  }
};

/// Solves (1), (2) from checked pseudoranges, keeping the roots whose ranges are not negative.
/// `near`: a solution whose bias gives the ranges that weigh the squares by 1/(r σ)²; without it
/// all weigh by 1/σ². Where noise has left no real root, the point of the line nearest to one, and
/// the linear system's own solution. O(n·D²), no allocation. Errors: Error::DegenerateGeometry,
/// fewer than D directions of (s, β) determined; Error::NumericOverflow.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] Result<PseudorangeRoots<S, D>> pseudorange_roots(
    const V& view, const std::type_identity_t<BiasedPosition<S, D>>* near = nullptr) {
  constexpr int N = D + 1;
  // Rows (a, −ρ) relative to the first; sums are taken about a place o near their weighted mean c,
  // and those about c follow, with m = c − o.
  const std::size_t n = view.size();
  const Vec<S, D> origin = view[0].anchor;
  const S first = view[0].range;
  const S bias = near ? near->bias : S(0);
  S farthest = S(0);
  SumOrigin<S, N + 1> heavy;
  for (std::size_t i = 0; i < n; ++i) {
    const auto& r = view[i];
    S apart[N + 1];
    S square = S(0);
#pragma GCC unroll 4
    for (int k = 0; k < D; ++k) {
      apart[k] = r.anchor[k] - origin[k];
      square += apart[k] * apart[k];
    }
    apart[D] = -(r.range - first);
    const S beyond = apart[D] * apart[D];
    apart[N] = square - beyond;
    farthest = std::max(farthest, square + beyond);
    const S scale = near ? r.sigma * std::max(r.range - bias, r.sigma) : r.sigma;
    heavy.add(apart, scale * scale);
  }
  S middle[N + 1];
  heavy.place(middle, static_cast<S>(n));
  // <d, d> there; taken from every square it leaves small numbers, which keep their digits.
  S offset = middle[N];
#pragma GCC unroll 4
  for (int k = 0; k < N; ++k) offset += k < D ? -(middle[k] * middle[k]) : middle[k] * middle[k];

  const auto sums = sum_in_lanes<S, SquareSums<N>::kCount>(
      view, [&](auto& sum, const auto& take, const auto& one) __attribute__((always_inline)) {
        using P = std::remove_cvref_t<decltype(one)>;
        const P range = take([](const auto& r) { return r.range; });
        const P sigma = take([](const auto& r) { return r.sigma; });
        Numbers<P, N> d;
        d[D] = -(range - first) - middle[D];
        P q = -(d[D] * d[D]) - offset;
        unroll<D>([&](auto k) __attribute__((always_inline)) {
          d[k] = (take([&](const auto& r) { return r.anchor[int(k)]; }) - origin[int(k)]) -
                 middle[int(k)];
          q += d[k] * d[k];
        });
        P scale = sigma;
        if (near) {
          // A range of less than a sigma would weigh without bound.
          const P far = range - bias;
          scale *= far > sigma ? far : sigma;
        }
        add_square<N, P>(sum, d, q, one / (scale * scale));
      });
  const SquareSystem<S, N> system = square_system<S, N>(sums, offset, S(-1));
  const Vec<S, N>& m = system.mean;
  const Result<WeakLine<S, D + 1>> line = weak_line<S, D + 1>(system.normal, system.rhs);
  if (!line) return std::unexpected(line.error());

  PseudorangeRoots<S, D> roots;
#pragma GCC unroll 4
  for (int k = 0; k < D; ++k) roots.center[k] = origin[k] + middle[k] + m[k];
  roots.mean_pseudorange = first - middle[D] - m[D];
  roots.count = 0;
  // Flat anchors leave the line across them; equal pseudoranges would leave it along β.
  const bool flat = !(line->information > S(0)) && std::abs(line->direction[D]) < S(1e-3);
  for (int k = 0; k < D; ++k) roots.across[k] = flat ? line->direction[k] : S(0);
  roots.largest = std::max(std::sqrt(farthest), norm(line->foot));

  // a τ² + 2 h τ + c = 0 of (1) on the line.
  const S a = space_time_product<S, D + 1>(line->direction, line->direction);
  const S h = space_time_product<S, D + 1>(line->foot, line->direction);
  const S c = space_time_product<S, D + 1>(line->foot, line->foot) - system.square;
  const auto keep = [&](S tau) {
    if (!std::isfinite(tau)) return;
    const Vec<S, D + 1> state = line->foot + tau * line->direction;
    const S slack = S(1e-3) * (roots.largest + norm(state));
    for (std::size_t i = 0; i < n; ++i) {
      const auto& r = view[i];
      // A negative range.
      if ((r.range - roots.mean_pseudorange) - state[D] < -slack - S(3) * r.sigma) return;
    }
    roots.candidates[roots.count++] = state;
  };
  const S discriminant = h * h - a * c;
  if (discriminant > S(0)) {
    // The root that does not cancel, and the other by their product.
    const S sum = -(h + std::copysign(std::sqrt(discriminant), h));
    if (a != S(0)) keep(sum / a);
    if (sum != S(0)) keep(c / sum);
  } else {
    keep(-h / a);
  }
  if (roots.count == 0 || !(discriminant > S(0))) keep(line->rough);
  for (int i = 0; i < roots.count; ++i) {
    if (!all_finite(roots.candidates[i])) return std::unexpected(Error::NumericOverflow);
  }
  if (!all_finite(roots.center) || !std::isfinite(roots.mean_pseudorange)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return roots;
}

/// Candidate `i` once more with the weights of its own ranges, relative to the same `center` and
/// `mean_pseudorange`; itself where that fails. O(n·D²), no allocation.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] Vec<S, D + 1> refined_candidate(const V& view, const PseudorangeRoots<S, D>& roots,
                                              int i) {
  const Vec<S, D + 1>& plain = roots.candidates[i];
  const BiasedPosition<S, D> near = roots.at(i);
  const auto refined = pseudorange_roots<S, D>(view, &near);
  Vec<S, D + 1> best = plain;
  S nearest = std::numeric_limits<S>::infinity();
  for (int j = 0; refined && j < refined->count; ++j) {
    Vec<S, D + 1> state = refined->candidates[j];
    for (int k = 0; k < D; ++k) state[k] += refined->center[k] - roots.center[k];
    state[D] += refined->mean_pseudorange - roots.mean_pseudorange;
    const S distance = squared_norm<S, D + 1>(state - plain);
    if (distance < nearest) {
      nearest = distance;
      best = state;
    }
  }
  return best;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
