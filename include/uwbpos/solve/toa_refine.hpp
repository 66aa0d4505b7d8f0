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
#include "uwbpos/solve/direct_step.hpp"
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
  // Of precision, squared, times about the number of ranges; much beyond it variances are rounding.
  constexpr S kMostDilution = S(2048);
  constexpr S kRounding =
      S(16) * std::numeric_limits<S>::epsilon() * std::numeric_limits<S>::epsilon();
  if (const auto error = check_ranges<S, D>(ranges, D)) return std::unexpected(*error);
  if (ranges.empty()) std::unreachable();  // sums need not begin with nothing
  if (!all_finite(initial)) return std::unexpected(Error::NotFinite);
  S square = S(0);  // of the lengths that rounding is relative to
  for (const RangeTo<S, D>& r : ranges) square += r.range * r.range;
  const Vec<S, D> origin = ranges.front().anchor;
  Vec<S, D> place = initial - origin;
  Vec<S, D> step = Vec<S, D>::Zero();
  S allowed = std::numeric_limits<S>::max();
  constexpr int kGauss = 0;  // J, as H was not positive here: no answer, which a saddle is not
  constexpr int kLast = 1;   // J, after a short step of H
  constexpr int kNewton = 2;
  int kind = kNewton;
  for (int left = kMostRefinements; left > 0; --left) {
    const NormalEquations<S, D> normal = range_normal<S, D>(
        ranges, origin, place, {}, kind == kNewton ? Curvature::Full : Curvature::Information);
    const S nothing = kNothing * (normal.chi_squared + S(1)) + kRounding * square * normal.trace;
    if (!(normal.chi_squared <= allowed)) {
      step *= S(0.5);
      place -= step;
      continue;
    }
    allowed = normal.chi_squared + S(64) * nothing;  // more than rounding
    Lower<S, D> matrix;
    unroll<D>([&](auto j) __attribute__((always_inline)) {
      unroll<D - j>([&](auto i) __attribute__((always_inline)) {
        matrix[lower_index<D>(j + i, j)] = normal.matrix(int(j + i), int(j));
      });
    });
    const Cofactors<S, D> of_matrix = cofactors<S, D>(matrix);
    if (!is_well_conditioned<S, S, D>(matrix, of_matrix)) {
      if (kind != kNewton) return std::unexpected(Error::DegenerateGeometry);
      step.setZero();
      kind = kGauss;
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
    S sigmas = std::sqrt(covariance[0]);  // not a number where a variance drowned in rounding
    unroll<D - 1>([&](auto k) __attribute__((always_inline)) {
      sigmas += std::sqrt(covariance[lower_index<D>(k + 1, k + 1)]);
    });
    if (kind == kLast && sigmas * sigmas * normal.trace < kMostDilution && gain <= nothing) {
      Numbers<S, D> from_first;
      unroll<D>([&](auto k) __attribute__((always_inline)) { from_first[k] = place[int(k)]; });
      return direct_fix<S, D>(origin, from_first, covariance, normal.chi_squared,
                              static_cast<int>(ranges.size()) - D);
    }
    kind = kind != kNewton || gain > kNear + nothing ? kNewton : kLast;
  }
  return std::unexpected(Error::NotConverged);
}

}  // namespace detail

/// Position [m] from n ≥ D ranges, in the anchors' frame, at the minimum of χ² whose basin holds
/// `initial` [m], with cov = J⁻¹. O(n·D²) a step, no allocation.
/// Errors: those of `check_ranges`; Error::NotFinite for `initial`; Error::DegenerateGeometry where
/// the ranges, seen from where the steps lead, do not determine a position (in the very plane of
/// anchors on one ceiling they do not), in float also for sigmas below a micrometre;
/// Error::NotConverged after twenty, from a start too far off or near no minimum, or where position
/// is diluted beyond sixteen times by eight ranges of one sigma (√(2048/n); unequal sigmas count as
/// dilution). What it leaves of a step is a thousandth of a standard deviation as a rule, and a few
/// hundredths at worst.
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
