// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Thousands of epochs at once, for servers: as many as a register has lanes are solved together by
/// the code of the clear case (direct_ranges.hpp, direct_pseudoranges.hpp), and those that are not
/// clear, one in some hundred as a rule, one by one. Measurements come as arrays by anchor, so that
/// neighbours in memory are neighbours in a register. Answers are those of the single solvers,
/// errors included, but for rounding: where a compiler contracts products and sums (-mfma with its
/// default of -ffp-contract), and in double, where single solves sum in two lanes; and where that
/// makes an epoch settle that would take one step more, by a thousandth of a standard deviation.
///
/// Calls on parts of the epochs are independent: give each thread its own part.

#include <array>
#include <span>

#include "uwbpos/solve/batch_views.hpp"
#include "uwbpos/solve/locate.hpp"

namespace uwbpos {

namespace detail {

/// Solves `epochs`, a register full at a time by `wide(begin)`, which tells what lanes it has
/// solved, and by `single(e, lane)` what is left; the last epochs were in no lane, `kLanes`.
template <class S, class Wider, class Single>
std::size_t solve_batch(std::size_t epochs, const Wider& wide, const Single& single) {
  std::size_t together = 0;
  std::size_t begin = 0;
  for (; begin + kLanes<S> <= epochs; begin += kLanes<S>) {
    const std::array<bool, kLanes<S>> solved = wide(begin);
    for (std::size_t l = 0; l < kLanes<S>; ++l) {
      if (solved[l]) {
        ++together;
      } else {
        single(begin + l, l);
      }
    }
  }
  for (; begin < epochs; ++begin) single(begin, kLanes<S>);
  return together;
}

/// Lane l of numbers.
template <class S, int N>
[[nodiscard, gnu::always_inline]] inline Numbers<S, N> lane(const Numbers<Wide<S>, N>& numbers,
                                                            std::size_t l) {
  Numbers<S, N> result;
  unroll<N>([&](auto k) __attribute__((always_inline)) { result[k] = numbers[k][l]; });
  return result;
}

/// Whether a batch of `anchors` with `measurements` has what `results` epochs need.
[[nodiscard]] inline bool is_batch(std::size_t anchors, std::size_t measurements,
                                   std::size_t results) {
  return anchors <= static_cast<std::size_t>(kMaxMeasurements) && measurements == anchors * results;
}

/// Whether the spans of `batch` fit one another and so many epochs.
template <class S, int D>
[[nodiscard]] bool fits(const RangeBatch<S, D>& batch, std::size_t epochs) {
  return is_batch(batch.anchors.size(), batch.ranges.size(), epochs) &&
         batch.sigmas.size() == batch.anchors.size();
}

/// The ranges of one epoch, gathered.
template <class S, int D, class Solve>
[[nodiscard]] auto gather_ranges(const RangeBatch<S, D>& batch, std::size_t epochs, std::size_t e,
                                 const Solve& solve) {
  std::array<RangeTo<S, D>, kMaxMeasurements> ranges;
  std::size_t count = 0;
  for (std::size_t i = 0; i < batch.anchors.size(); ++i) {
    const S range = batch.ranges[i * epochs + e];
    if (is_number(range)) ranges[count++] = {batch.anchors[i], range, batch.sigmas[i]};
  }
  return solve(RangeSpan<S, D>{ranges.data(), count});
}

/// Solves ranges; `doubtless`: only where no mirror image is to be feared.
template <class S, int D, bool doubtless, class Solve>
Result<std::size_t> solve_range_batch(const RangeBatch<S, D>& batch,
                                      std::span<Result<Fix<S, D>>> fixes, const Solve& solve) {
  const std::size_t epochs = fixes.size();
  if (!fits(batch, epochs)) return std::unexpected(Error::InvalidOption);
  const auto wide = [&](std::size_t begin) {
    std::array<bool, kLanes<S>> solved = {};
    if (batch.anchors.size() < static_cast<std::size_t>(D)) return solved;
    const WideRanges<S, D> ranges{batch, epochs, begin};
    const Wide<S> count = how_many(ranges);
    const auto direct = direct_ranges<S, D, Wide<S>>(ranges);
    const Numbers<Wide<S>, D> first = ranges.first();
    for (std::size_t l = 0; l < kLanes<S>; ++l) {
      const int freedom = static_cast<int>(count[l]) - D;
      solved[l] =
          direct.clear[l] && freedom >= 0 &&
          (!doubtless || is_without_doubt(S(direct.chi_squared[l]), S(direct.other[l]), freedom));
      if (!solved[l]) continue;
      fixes[begin + l] =
          direct_fix<S, D>(lane<S>(first, l), lane<S>(direct.from_first, l),
                           lane<S>(direct.covariance, l), S(direct.chi_squared[l]), freedom);
    }
    return solved;
  };
  return solve_batch<S>(epochs, wide, [&](std::size_t e, std::size_t) {
    fixes[e] = gather_ranges<S, D>(batch, epochs, e, solve);
  });
}

}  // namespace detail

/// `toa_least_squares` of each epoch into `fixes`, one for each. Returns how many were solved
/// several at a time. About a third of the single solver's time in float with AVX. No
/// allocation; 2 to 5 KiB of stack. Errors of an epoch stand in its place; of the call:
/// Error::InvalidOption, spans that do not fit one another, or more than `kMaxMeasurements`
/// anchors.
template <class S, int D>
Result<std::size_t> toa_least_squares(const RangeBatch<S, D>& batch,
                                      std::span<Result<Fix<S, D>>> fixes) {
  return detail::solve_range_batch<S, D, false>(
      batch, fixes, [](RangeSpan<S, D> ranges) { return toa_least_squares(ranges); });
}

/// `locate` of each epoch, mirror images settled by `options`. As `toa_least_squares` of a batch.
/// Errors: its own; those of an epoch stand in its place.
template <class S, int D>
Result<std::size_t> locate(const RangeBatch<S, D>& batch, std::span<Result<Fix<S, D>>> fixes,
                           const LocateOptions<S, D>& options = {}) {
  if (const auto error = check_options(options)) return std::unexpected(*error);
  return detail::solve_range_batch<S, D, true>(
      batch, fixes, [&](RangeSpan<S, D> ranges) { return locate(ranges, options); });
}

/// `toa_closed_form` of each epoch. As `toa_least_squares` of a batch, whose errors these are.
template <class S, int D>
Result<std::size_t> toa_closed_form(const RangeBatch<S, D>& batch,
                                    std::span<Result<Mirror<S, D>>> positions) {
  const std::size_t epochs = positions.size();
  if (!detail::fits(batch, epochs)) return std::unexpected(Error::InvalidOption);
  // Of each lane, for those that are left.
  std::array<Vec<S, D>, kLanes<S>> minima;
  std::array<S, kLanes<S>> others;
  std::array<bool, kLanes<S>> precise = {};
  const auto wide = [&](std::size_t begin) {
    std::array<bool, kLanes<S>> solved = {};
    if (batch.anchors.size() < static_cast<std::size_t>(D)) return solved;
    const detail::WideRanges<S, D> ranges{batch, epochs, begin};
    const Numbers<Wide<S>, D> first = ranges.first();
    const Wide<S> count = detail::how_many(ranges);
    const auto squares = range_squares<S, D, Wide<S>>(ranges, first);
    for (std::size_t l = 0; l < kLanes<S>; ++l) {
      minima[l] = moved<S, D>(detail::lane<S>(first, l), detail::lane<S>(squares.place, l));
      others[l] = squares.other[l];
      precise[l] = squares.precise[l] && count[l] >= S(D);
      solved[l] = squares.sole[l] && count[l] >= S(D);
      if (solved[l]) positions[begin + l] = Mirror<S, D>{minima[l], minima[l]};
    }
    return solved;
  };
  return detail::solve_batch<S>(epochs, wide, [&](std::size_t e, std::size_t l) {
    positions[e] = detail::gather_ranges<S, D>(batch, epochs, e, [&](RangeSpan<S, D> ranges) {
      return l < kLanes<S> && precise[l]
                 ? detail::minimum_or_images<S, D>(ranges, minima[l], others[l])
                 : toa_closed_form(ranges);
    });
  });
}

/// `locate` of each epoch of differences. As `toa_least_squares` of a batch, whose errors these
/// are, and Error::NotFinite in an option.
template <class S, int D>
Result<std::size_t> locate(const DifferenceBatch<S, D>& batch, std::span<Result<Fix<S, D>>> fixes,
                           const LocateOptions<S, D>& options = {}) {
  const std::size_t epochs = fixes.size();
  if (!detail::is_batch(batch.anchors.size(), batch.differences.size(), epochs)) {
    return std::unexpected(Error::InvalidOption);
  }
  if (const auto error = check_options(options)) return std::unexpected(*error);
  const auto wide = [&](std::size_t begin) {
    std::array<bool, kLanes<S>> solved = {};
    if (batch.anchors.size() < static_cast<std::size_t>(D)) return solved;
    const detail::WideDifferences<S, D> differences{batch, epochs, begin};
    const Wide<S> count = detail::how_many(differences);
    const auto direct = direct_pseudoranges<S, D, Wide<S>>(differences);
    for (std::size_t l = 0; l < kLanes<S>; ++l) {
      const int freedom = static_cast<int>(count[l]) - (D + 1);
      solved[l] = direct.clear[l] && freedom >= 0 &&
                  is_without_doubt(S(direct.chi_squared[l]), S(direct.other[l]), freedom);
      if (!solved[l]) continue;
      fixes[begin + l] = direct_fix<S, D>(batch.reference, detail::lane<S>(direct.from_first, l),
                                          detail::lane<S>(direct.covariance, l),
                                          S(direct.chi_squared[l]), freedom);
    }
    return solved;
  };
  return detail::solve_batch<S>(epochs, wide, [&](std::size_t e, std::size_t) {
    std::array<DifferenceTo<S, D>, kMaxMeasurements> differences;
    std::size_t n = 0;
    for (std::size_t i = 0; i < batch.anchors.size(); ++i) {
      const S d = batch.differences[i * epochs + e];
      if (is_number(d)) differences[n++] = {batch.anchors[i], d};
    }
    fixes[e] = tdoa_least_squares(batch.reference, DifferenceSpan<S, D>{differences.data(), n},
                                  batch.sigma, options);
  });
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
