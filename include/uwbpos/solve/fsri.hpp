// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Ultrasonic positions free of the receivers' lag (FSRI, and SFMRUI, its form for any receivers:
/// Jiang, Yan, Zang, Zhao, J. Jilin Univ. (Eng. & Tech.) 39(1), 2009; 003). A threshold is crossed
/// some waves after a wave train arrives, later the weaker it is; what all receivers share of that
/// is the lag q, what they do not is whole waves λ:
/// \f[ |p - a_i| = L_i + m_i \lambda - q, \qquad 0 \le q \le q_{max}. \qquad (1) \f]
/// These are pseudoranges (model/pseudorange.hpp) once the m are known; which m are likeliest,
/// fsri_search.hpp finds.
///
/// Three receivers in a plane, or four in space, leave nothing after p and q but the bounds of q to
/// judge a repair by. Moving every length by a wave more than the next turns the answer about the
/// bar and hardly changes q, so a wrong repair may pass unseen. One more receiver or a prior
/// position ends that.

#include "uwbpos/solve/fsri_search.hpp"
#include "uwbpos/solve/ultrasonic_shot.hpp"

namespace uwbpos {

namespace detail {

/// Where the lag is at a bound the position given that lag, not its linear estimate.
template <class S, int D>
void settle_bounded_lag(std::span<const Vec<S, D>> receivers, std::span<const S> lengths,
                        const FsriOptions<S, D>& options, FsriExplanation<S, D>& best) {
  BiasedFix<S, D>& fix = best.fix;
  if (fix.bias > S(0) && fix.bias < *options.max_lag) return;
  std::array<RangeTo<S, D>, kMaxFsriReceivers> ranges;
  S largest = S(0);
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    const S repaired = lengths[i] + static_cast<S>(best.repair[i]) * options.wavelength;
    ranges[i] = {receivers[i], repaired - fix.bias, *options.sigma};
    largest = std::max(largest, repaired);
  }
  const RangeSpan<S, D> span{ranges.data(), lengths.size()};
  const Vec<S, D>& center = receivers.front();
  constexpr int kIterations = 30;
  const Result<Minimum<S, D>> minimum =
      descend<S, D>(span, center, fix.position - center, largest, kIterations);
  if (minimum && all_finite(minimum->state)) fix.position = center + minimum->state;
}

/// Everything that the number of receivers need not be known for.
template <class S, int D>
Result<FsriShot<S, kMaxFsriReceivers, D>> solve_shot(std::span<const Vec<S, D>> receivers,
                                                     std::span<const S> lengths,
                                                     const FsriOptions<S, D>& given) {
  const Result<FsriOptions<S, D>> options = resolve_fsri_options(given);
  if (!options) return std::unexpected(options.error());
  if (const auto error = check_shot<S, D>(receivers, lengths, D + 1)) {
    return std::unexpected(*error);
  }
  const auto array = ReceiverArray<S, D>::make(receivers, {options->side, options->prior});
  if (!array) return std::unexpected(array.error());
  FsriSearch<S, D> search{receivers, lengths, *array, *options};
  if (const auto found = search.run(); !found) return std::unexpected(found.error());
  FsriExplanation<S, D> best = search.best();
  settle_bounded_lag<S, D>(receivers, lengths, *options, best);

  FsriShot<S, kMaxFsriReceivers, D> shot;
  shot.position = best.fix.position;
  shot.lag = best.fix.bias;
  shot.repair = best.repair;
  shot.ambiguous = search.ambiguous();
  S squares = S(0);
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    const S length = lengths[i] + static_cast<S>(shot.repair[i]) * options->wavelength;
    const S e =
        length - predict_pseudorange<S, D>(shot.position, shot.lag, receivers[i]).pseudorange;
    squares += e * e;
  }
  shot.residual = std::sqrt(squares / static_cast<S>(lengths.size()));
  shot.covariance = best.fix.covariance;
  shot.chi_squared = squares / (*options->sigma * *options->sigma);
  shot.degrees_of_freedom = best.fix.degrees_of_freedom;
  shot.alternative = Vec<S, D>::Constant(std::numeric_limits<S>::quiet_NaN());
  if (search.other().cost < std::numeric_limits<S>::infinity()) {
    shot.alternative = search.other().fix.position;
  }
  return shot;
}

}  // namespace detail

/// Position [m] and lag [m] of one shot from its n ≥ D + 1 `lengths` [m], distances to `receivers`
/// [m] plus lag, and the whole waves by which each length was off. Contiguous ranges of `Vec<S, D>`
/// and S, equally many, D = 2 or 3. From arrays the repair has their size; where the number is
/// known at run time only, that of `kMaxFsriReceivers`, zero beyond the last. Receivers in line, in
/// a plane or in general position; those that are flat leave a mirror image, told by
/// `options.side`, `options.prior`, or taken to be at greater y (z in space).
///
/// Repairs obey the order of the lengths where n = D + 1 and no prior is given; otherwise that is
/// only preferred. `ambiguous`: another repair, which moves at most one wave more or fits about as
/// well, stands at `alternative`; without redundancy a shot that is not ambiguous may still be
/// wrong.
///
/// Cost: at most (2 · max_repair + 1)^(n−1) repairs, each a solution of O(n·D²). The order leaves
/// 15 of them for three receivers in the plane and 35 for four in space, some microseconds on a
/// desktop. With more receivers the bounds of fsri_search.hpp leave tens to hundreds where lags
/// grow with distance; where each receiver is late by waves of its own, thousands. A search ends
/// after `kMostSolutions`, tens of milliseconds, with an answer called ambiguous or with
/// Error::NotConverged. About 2 kB of stack, no allocation.
/// Errors: those of `resolve_fsri_options`, `check_shot` and `ReceiverArray::make`;
/// Error::NoRepairFits, none of at most max_repair waves brings the lag within [0, max_lag] and the
/// lengths into agreement; Error::InconsistentRanges, Error::DegenerateGeometry,
/// Error::NotConverged, Error::NumericOverflow where no repair had a position at all.
template <ReceiverSet R, std::ranges::contiguous_range L>
[[nodiscard]] auto fsri(const R& receivers, const L& lengths,
                        const std::type_identity_t<FsriOptionsOf<R>>& options = {})
    -> Result<FsriShot<ReceiverScalar<R>, kReceiverCount<R>, kReceiverDimension<R>>> {
  using S = ReceiverScalar<R>;
  constexpr int D = kReceiverDimension<R>;
  constexpr std::size_t kCount = kReceiverCount<R>;
  static_assert(kCount <= kMaxFsriReceivers, "more receivers than fsri takes");
  const auto found =
      detail::solve_shot<S, D>(as_receiver_span(receivers), as_length_span<S>(lengths), options);
  if (!found) return std::unexpected(found.error());
  FsriShot<S, kCount, D> shot{found->position,
                              found->lag,
                              {},
                              found->ambiguous,
                              found->residual,
                              found->covariance,
                              found->chi_squared,
                              found->degrees_of_freedom,
                              found->alternative};
  for (std::size_t i = 0; i < kCount; ++i) shot.repair[i] = found->repair[i];
  return shot;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
