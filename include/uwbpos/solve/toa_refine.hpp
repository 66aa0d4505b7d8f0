// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Maximum-likelihood position from ranges and a position to start from, in little flash and
/// stack: for a tag that knows about where it is, by its last fix or its track. Steps of Newton
/// while they are long, H s = ∇ of newton.hpp, and where they are short, or H is not positive, of
/// Gauss and Newton, J s = ∇, the last of which leaves J for the covariance; half of a step that
/// does not help. Nothing is said of other minima: `toa_least_squares` starts from nothing,
/// `locate` compares mirror images.

#include <utility>

#include "uwbpos/core/cofactors.hpp"
#include "uwbpos/solve/range_normal.hpp"

namespace uwbpos {

namespace detail {

/// Most evaluations of a refinement; three or four as a rule.
inline constexpr int kMostRefinements = 20;

/// `toa_refine` for one scalar and dimension.
template <class S, int D>
Result<Fix<S, D>> toa_refine(RangeSpan<S, D> ranges, const Vec<S, D>& initial) {
  constexpr S kNothing = S(2e-5);  // a gain, in χ²
  constexpr S kNear = S(1);        // a gain after which the next is nothing, as a rule
  constexpr S kRounding =
      S(16) * std::numeric_limits<S>::epsilon() * std::numeric_limits<S>::epsilon();
  if (const auto error = check_ranges<S, D>(ranges, D)) return std::unexpected(*error);
  if (ranges.empty()) std::unreachable();  // sums need not begin with nothing
  if (!all_finite(initial)) return std::unexpected(Error::NotFinite);
  S square = S(0);  // of the lengths that rounding is relative to
  for (const RangeTo<S, D>& r : ranges) square += r.range * r.range;
  const Vec<S, D> origin = ranges.front().anchor;
  Vec<S, D> place = initial - origin;
  Vec<S, D> step;
  S allowed = std::numeric_limits<S>::infinity();
  bool newton = true;
  for (int left = kMostRefinements; left > 0; --left) {
    const NormalEquations<S, D> normal = range_normal<S, D>(
        ranges, origin, place, {}, newton ? Curvature::Full : Curvature::Information);
    const S noise = normal.trace * (kRounding * square);
    if (normal.chi_squared > allowed) {
      step *= S(0.5);
      place -= step;
      continue;
    }
    allowed = S(1.02) * normal.chi_squared + S(64) * noise;  // more than rounding
    Lower<S, D> matrix;
    unroll<D>([&](auto j) __attribute__((always_inline)) {
      unroll<D - j>([&](auto i) __attribute__((always_inline)) {
        matrix[lower_index<D>(j + i, j)] = normal.matrix(int(j + i), int(j));
      });
    });
    const Cofactors<S, D> of_matrix = cofactors<S, D>(matrix);
    if (!is_well_conditioned<S, S, D>(matrix, of_matrix)) {
      if (!newton) return std::unexpected(Error::DegenerateGeometry);
      step.setZero();
      newton = false;
      continue;
    }
    const S inverse = S(1) / of_matrix.determinant;
    Lower<S, D> covariance;
    unroll<D*(D + 1) / 2>([&](auto k) __attribute__((always_inline)) {
      covariance[k] = inverse * of_matrix.adjugate[k];
    });
    unroll<D>([&](auto j) __attribute__((always_inline)) {
      S sum = S(0);
      unroll<D>([&](auto i) __attribute__((always_inline)) {
        sum += covariance[lower_of<D>(i, j)] * normal.gradient[int(i)];
      });
      step[int(j)] = sum;
    });
    place += step;
    const S gain = dot(step, normal.gradient);
    // Zero; not a number where χ² is not finite, or a variance is not or has drowned in rounding.
    S finite = normal.chi_squared;
    unroll<D>([&](auto k) __attribute__((always_inline)) {
      finite += std::sqrt(covariance[lower_index<D>(k, k)]);
    });
    const S zero = S(0) * finite;
    if (!newton && gain + zero <= kNothing * (normal.chi_squared + S(1)) + noise) {
      Fix<S, D> fix;
      fix.position = origin + place;
      unroll<D>([&](auto j) __attribute__((always_inline)) {
        unroll<D>([&](auto i) __attribute__((always_inline)) {
          fix.covariance(int(i), int(j)) = covariance[lower_of<D>(i, j)];
        });
      });
      fix.chi_squared = normal.chi_squared;
      fix.degrees_of_freedom = static_cast<int>(ranges.size()) - D;
      return fix;
    }
    newton = !newton || gain > kNear + noise;
  }
  return std::unexpected(Error::NotConverged);
}

}  // namespace detail

/// Position [m] from n ≥ D ranges, in the anchors' frame, at the minimum of χ² whose basin holds
/// `initial` [m], with cov = J⁻¹. O(n·D²) a step, no allocation.
/// Errors: those of `check_ranges`; Error::NotFinite for `initial`; Error::DegenerateGeometry where
/// the ranges do not determine a position, as from much too far off; Error::NotConverged after
/// twenty, from a start too far off.
/// What it leaves of a step is a thousandth of a standard deviation as a rule, and a few hundredths
/// at worst.
template <RangeSet R>
[[nodiscard]] auto toa_refine(
    const R& ranges,
    const std::type_identity_t<Vec<RangeSetScalar<R>, kRangeSetDimension<R>>>& initial)
    -> Result<Fix<RangeSetScalar<R>, kRangeSetDimension<R>>> {
  return detail::toa_refine<RangeSetScalar<R>, kRangeSetDimension<R>>(as_range_span(ranges),
                                                                      initial);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
