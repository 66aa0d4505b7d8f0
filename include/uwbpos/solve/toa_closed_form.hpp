// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Position from ranges without iteration: D anchors, flat arrays of any number, or more. Exact on
/// exact ranges. (000-15) and its 3-D form are the case n = D + 1; toa_three_anchors.hpp has it
/// bare.

#include "uwbpos/solve/direct_ranges.hpp"
#include "uwbpos/solve/mirror_choice.hpp"
#include "uwbpos/solve/toa_roots.hpp"

namespace uwbpos {

namespace detail {

/// The images that the line of the linear system meets; checks what is given.
template <class S, int D>
Result<Mirror<S, D>> images_on_line(RangeSpan<S, D> span) {
  if (const auto error = check_ranges<S, D>(span, D)) return std::unexpected(*error);
  const Result<ToaRoots<S, D>> roots = toa_roots<S, D>(span);
  if (!roots) return std::unexpected(roots.error());

  const S slack = roots->rounding() + S(5) * std::sqrt(roots->square_variance);
  if (roots->flat() && roots->square < -slack) return std::unexpected(Error::InconsistentRanges);
  const Vec<S, D> foot = roots->center + roots->foot;
  const auto at = [&](S tau) -> Vec<S, D> { return foot + tau * roots->direction; };
  if (roots->flat()) {
    const S root = roots->square > roots->rounding() ? std::sqrt(roots->square) : S(0);
    Mirror<S, D> images{at(root), at(-root)};
    if (!all_finite(images.first) || !all_finite(images.second)) {
      return std::unexpected(Error::NumericOverflow);
    }
    return images;
  }
  const RootChoice<S> choice = weigh_roots(*roots);
  Mirror<S, D> images{at(choice.likely), at(choice.two_minima ? choice.other : choice.likely)};
  if (!all_finite(images.first) || !all_finite(images.second)) {
    return std::unexpected(Error::NumericOverflow);
  }
  S better = chi_squared<S, D>(span, images.first);
  S worse = chi_squared<S, D>(span, images.second);
  if (worse < better) {
    std::swap(images.first, images.second);
    std::swap(better, worse);
  }
  const int freedom = static_cast<int>(span.size()) - D;
  if (rules_out(better, worse, freedom, S(9), chi_squared_rounding(span, roots->largest))) {
    images.second = images.first;
  }
  if (!all_finite(images.first) || !all_finite(images.second)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return images;
}

/// `position`, a precise minimum of the squares, if no image whose χ² is at least about `other` is
/// to be feared; else the images on the line.
template <class S, int D>
Result<Mirror<S, D>> minimum_or_images(RangeSpan<S, D> span, const Vec<S, D>& position, S other) {
  const int freedom = static_cast<int>(span.size()) - D;
  if (is_without_doubt(S(0), other, freedom) &&
      is_without_doubt(chi_squared<S, D>(span, position), other, freedom)) {
    return Mirror<S, D>{position, position};
  }
  return images_on_line<S, D>(span);
}

/// `toa_closed_form` for one scalar and dimension.
template <class S, int D>
Result<Mirror<S, D>> toa_closed_form(RangeSpan<S, D> span) {
  if (!is_range_count(span.size(), D)) return images_on_line<S, D>(span);
  const auto squares = range_squares<S, D, S>(span, first_anchor<S, D>(span));
  if (!squares.precise) return images_on_line<S, D>(span);
  const Vec<S, D> position = moved<S, D>(span.front().anchor, squares.place);
  if (squares.sole) return Mirror<S, D>{position, position};
  return minimum_or_images<S, D>(span, position, squares.other);
}

}  // namespace detail

/// The two positions [m] that n ≥ D ranges allow, equal when there is one answer: the redundancy
/// rules one out, or the tag lies in the anchors' plane (a root below zero by no more than five
/// sigma is the plane itself). Where no image is to be feared it is the minimum of all squares
/// together, else two points of a line: with redundancy and noise the two ways, and the line's with
/// the axes, differ by a part of the noise. `first` fits no worse than `second`. O(n·D²), no
/// allocation. Errors: those of `check_ranges`; Error::DegenerateGeometry, anchors that span fewer
/// than D − 1 dimensions; Error::InconsistentRanges, the circles or spheres miss one another beyond
/// noise; Error::NumericOverflow.
template <RangeSet R>
[[nodiscard]] auto toa_closed_form(const R& ranges)
    -> Result<Mirror<RangeSetScalar<R>, kRangeSetDimension<R>>> {
  return detail::toa_closed_form<RangeSetScalar<R>, kRangeSetDimension<R>>(as_range_span(ranges));
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
