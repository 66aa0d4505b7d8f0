// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What sums over ranges need of each, for one range or for a pair of them (core/lanes.hpp): the
/// model of model/range.hpp with its weight, by one root and one division.

#include "uwbpos/core/lanes.hpp"
#include "uwbpos/core/types.hpp"

namespace uwbpos {

/// A predicted range, and what weighs it. At an anchor itself `gradient` is zero.
template <class P, int D>
struct RangeTerms {
  Numbers<P, D> gradient;  ///< g, from the anchor to the position, unit length
  P distance;              ///< d [m]
  P weight;                ///< w = 1/σ² [1/m²]
  P turn;                  ///< w / d [1/m³]
};

/// The terms at `position`, relative to `center`, both vectors of scalars or of lanes, of what
/// `take` and `one` of `sum_in_lanes` stand for. O(D), no allocation.
template <class S, int D, class X, class C, class Take, class P>
[[nodiscard, gnu::always_inline]] inline RangeTerms<P, D> range_terms(const X& position,
                                                                      const C& center,
                                                                      const Take& take,
                                                                      const P& one) {
  // [m²], so that a position at an anchor divides by something, by any sigma that is believed.
  constexpr S kNowhere = sizeof(S) == 4 ? S(1e-18) : S(1e-24);
  RangeTerms<P, D> terms;
  P square = P{} + kNowhere;
  unroll<D>([&](auto k) __attribute__((always_inline)) {
    const P anchor = take([&](const auto& r) { return r.anchor[int(k)]; });
    terms.gradient[k] = position[int(k)] - (anchor - center[int(k)]);
    square += terms.gradient[k] * terms.gradient[k];
  });
  terms.distance = square_root(square);
  const P sigma = take([](const auto& r) { return r.sigma; });
  const P variance = sigma * sigma;
  // One division for all, 1/(σ² d²), that need not wait for the root.
  const P both = one / (variance * square);
  terms.weight = both * square;
  terms.turn = both * terms.distance;
  const P inverse = terms.turn * variance;
  unroll<D>([&](auto k) __attribute__((always_inline)) { terms.gradient[k] *= inverse; });
  return terms;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
