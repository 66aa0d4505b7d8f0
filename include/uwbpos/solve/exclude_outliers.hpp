// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Fault detection and exclusion: a fix from the measurements that agree with each other. While the
/// χ² of a fix exceeds what noise allows (core/chi_squared.hpp), the measurement without which
/// χ² falls most is left out, as receivers of satellite navigation have done since Parkinson and
/// Axelrad (Navigation 35(2), 1988). What remains keeps a degree of freedom, or nothing would have
/// been tested.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "uwbpos/core/chi_squared.hpp"
#include "uwbpos/solve/locate.hpp"

namespace uwbpos {

/// `max_excluded`: most measurements to leave out. `normal_quantile`: z above; 3.09 lets 1 in 1000
/// good sets be suspected.
template <class S>
struct ExclusionOptions {
  int max_excluded = 2;         ///< most measurements to leave out
  S normal_quantile = S(3.09);  ///< z
};

/// A fix and what it was made without: bit i of `excluded` stands for measurement i.
/// `consistent`: the χ² test was passed, or there was no redundancy to test with.
template <class S, int D>
struct ExclusionFix {
  Fix<S, D> fix;           ///< of the measurements kept
  std::uint64_t excluded;  ///< bit i: measurement i was left out
  int excluded_count;      ///< how many bits are set
  bool consistent;         ///< χ² passed, or had nothing to test
};

/// The scalar of whatever `locate` takes as a set.
template <class R>
using MeasurementScalar = typename decltype(locate(std::declval<const R&>())->position)::Scalar;

/// The dimension of whatever `locate` takes as a set.
template <class R>
inline constexpr int kMeasurementDimension =
    decltype(locate(std::declval<const R&>())->position)::RowsAtCompileTime;

/// What is wrong with one range by itself, or nothing.
template <class S, int D>
[[nodiscard]] std::optional<Error> fault_of(const RangeTo<S, D>& r) {
  return check_ranges<S, D>(RangeSpan<S, D>{&r, 1}, 1);
}

/// What is wrong with one difference by itself, or nothing.
template <class S, int D>
[[nodiscard]] std::optional<Error> fault_of(const PairDifference<S, D>& d) {
  return check_pairs<S, D>(PairSpan<S, D>{&d, 1}, 1);
}

/// Measured minus predicted [m].
template <class S, int D>
[[nodiscard]] S residual_of(const RangeTo<S, D>& r, const Vec<S, D>& position) {
  return r.range - predict_range<S, D>(position, r.anchor).range;
}

/// Measured minus predicted [m].
template <class S, int D>
[[nodiscard]] S residual_of(const PairDifference<S, D>& d, const Vec<S, D>& position) {
  return d.difference - predict_range_difference<S, D>(position, d.anchor_a, d.anchor_b).difference;
}

/// Excludes with any solver. `locate_set(span)` gives the fix of some of the measurements,
/// `residual(measurement, position)` says what is left of one [m]. Three steps: those that are
/// faulty by themselves go; then one after the other, each time that without which χ² falls most;
/// then, as outliers may hide one another, those that a descent with Cauchy's weights, from `prior`
/// if there is one, leaves far off go at once, where that explains as much with as few left out
/// (with a prior, with one more).
/// No allocation but what `locate_set` does.
template <class Measurement, class S, int D, class LocateSet, class ResidualOf>
[[nodiscard]] Result<ExclusionFix<S, D>> exclude_outliers(std::span<const Measurement> all,
                                                          const ExclusionOptions<S>& exclusion,
                                                          const std::optional<Vec<S, D>>& prior,
                                                          const LocateSet& locate_set,
                                                          const ResidualOf& residual) {
  if (exclusion.max_excluded < 0 || !std::isfinite(exclusion.normal_quantile)) {
    return std::unexpected(Error::InvalidOption);
  }
  if (all.size() > static_cast<std::size_t>(kMaxMeasurements)) {
    return std::unexpected(Error::TooManyMeasurements);
  }
  const auto passes = [&](const Fix<S, D>& fix) {
    return fix.degrees_of_freedom < 1 ||
           fix.chi_squared <= chi_squared_gate(fix.degrees_of_freedom, exclusion.normal_quantile);
  };
  const auto bit = [](std::size_t i) { return std::uint64_t{1} << i; };
  std::array<Measurement, kMaxMeasurements> kept;
  const auto locate_without = [&](std::uint64_t excluded) {
    std::size_t size = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if ((excluded & bit(i)) == 0) kept[size++] = all[i];
    }
    return locate_set(std::span<const Measurement>{kept.data(), size});
  };

  std::uint64_t faulty = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (fault_of(all[i])) faulty |= bit(i);
  }
  const int sound = static_cast<int>(all.size()) - std::popcount(faulty);
  Result<Fix<S, D>> fix = sound < D ? locate_set(all) : locate_without(faulty);
  std::uint64_t excluded = faulty;
  const int most = std::min(exclusion.max_excluded, sound - D - 1);
  for (int count = 0; (!fix || !passes(*fix)) && count < most; ++count) {
    Result<Fix<S, D>> best = fix;
    S lowest = fix ? fix->chi_squared : std::numeric_limits<S>::infinity();
    std::uint64_t dropped = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if ((excluded & bit(i)) != 0) continue;
      const Result<Fix<S, D>> without = locate_without(excluded | bit(i));
      if (without && without->chi_squared < lowest) {
        lowest = without->chi_squared;
        best = without;
        dropped = bit(i);
      }
    }
    if (dropped == 0) break;
    fix = best;
    excluded |= dropped;
  }

  const bool suspected = !fix || !passes(*fix) || excluded != faulty;
  if (suspected && most > 1 && (fix || prior)) {
    constexpr int kIterations = 12;
    constexpr S kCauchy = S(2);   // sigmas where the weight is one half
    constexpr S kOutlier = S(4);  // sigmas
    Vec<S, D> at = prior ? *prior : fix->position;
    bool found = true;
    for (int iteration = 0; found && iteration < kIterations; ++iteration) {
      std::size_t size = 0;
      for (std::size_t i = 0; i < all.size(); ++i) {
        if ((faulty & bit(i)) != 0) continue;
        const S sigmas = residual(all[i], at) / (kCauchy * all[i].sigma);
        kept[size] = all[i];
        kept[size++].sigma *= std::sqrt(S(1) + sigmas * sigmas);
      }
      const Result<Fix<S, D>> weighted =
          locate_set(std::span<const Measurement>{kept.data(), size});
      found = weighted.has_value();
      if (found) at = weighted->position;
    }
    std::uint64_t far = faulty;
    for (std::size_t i = 0; found && i < all.size(); ++i) {
      if ((faulty & bit(i)) == 0 && std::abs(residual(all[i], at)) > kOutlier * all[i].sigma) {
        far |= bit(i);
      }
    }
    // A prior position is worth one measurement more.
    const int own = fix && passes(*fix) ? std::popcount(excluded) : kMaxMeasurements;
    const int others = std::popcount(far);
    if (found && others - std::popcount(faulty) <= most && others <= own + (prior ? 1 : 0)) {
      const Result<Fix<S, D>> without = locate_without(far);
      if (without && passes(*without) &&
          (prior || others < own || without->chi_squared < fix->chi_squared)) {
        fix = without;
        excluded = far;
      }
    }
  }
  if (!fix) return std::unexpected(fix.error());
  return ExclusionFix<S, D>{*fix, excluded, std::popcount(excluded), passes(*fix)};
}

namespace detail {

/// `locate_excluding` for one kind of measurement.
template <class Measurement, class S, int D>
Result<ExclusionFix<S, D>> locate_excluding(std::span<const Measurement> all,
                                            const LocateOptions<S, D>& options,
                                            const ExclusionOptions<S>& exclusion) {
  return exclude_outliers<Measurement, S, D>(
      all, exclusion, options.prior,
      [&](std::span<const Measurement> some) { return locate(some, options); },
      [](const Measurement& m, const Vec<S, D>& at) { return residual_of<S, D>(m, at); });
}

}  // namespace detail

/// Position [m] from ranges or differences of pairs, outliers left out. `locate` over up to
/// 1 + `max_excluded` · n subsets; no allocation, a copy of the measurements on the stack.
/// Errors: those of `locate` for the whole set where no subset does better; Error::InvalidOption,
/// a negative `max_excluded` or a quantile that is not finite.
template <class R>
  requires RangeSet<R> || PairDifferenceSet<R>
[[nodiscard]] auto locate_excluding(
    const R& measurements,
    const std::type_identity_t<LocateOptions<MeasurementScalar<R>, kMeasurementDimension<R>>>&
        options = {},
    const std::type_identity_t<ExclusionOptions<MeasurementScalar<R>>>& exclusion = {})
    -> Result<ExclusionFix<MeasurementScalar<R>, kMeasurementDimension<R>>> {
  using Measurement = std::remove_cv_t<std::ranges::range_value_t<R>>;
  const std::span<const Measurement> all{std::ranges::data(measurements),
                                         std::ranges::size(measurements)};
  return detail::locate_excluding<Measurement, MeasurementScalar<R>, kMeasurementDimension<R>>(
      all, options, exclusion);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
