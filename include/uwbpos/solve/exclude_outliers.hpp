// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Fault detection and exclusion: a fix from the measurements that agree with each other. While the
/// χ² of a fix exceeds what noise allows (core/chi_squared.hpp), the measurement without which
/// χ² falls most is left out, as receivers of satellite navigation have done since Parkinson and
/// Axelrad (Navigation 35(2), 1988). What remains keeps a degree of freedom, or nothing would have
/// been tested.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

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

namespace detail {

/// `locate_excluding` for one kind of measurement.
template <class Measurement, class S, int D>
Result<ExclusionFix<S, D>> locate_excluding(std::span<const Measurement> all,
                                            const LocateOptions<S, D>& options,
                                            const ExclusionOptions<S>& exclusion) {
  if (exclusion.max_excluded < 0 || !std::isfinite(exclusion.normal_quantile)) {
    return std::unexpected(Error::InvalidOption);
  }
  const auto passes = [&](const Fix<S, D>& fix) {
    return fix.degrees_of_freedom < 1 ||
           fix.chi_squared <= chi_squared_gate(fix.degrees_of_freedom, exclusion.normal_quantile);
  };

  Result<Fix<S, D>> fix = locate(all, options);
  std::uint64_t excluded = 0;
  int count = 0;
  const int most = std::min(exclusion.max_excluded, static_cast<int>(all.size()) - D - 1);
  while (all.size() <= static_cast<std::size_t>(kMaxMeasurements) && (!fix || !passes(*fix)) &&
         count < most) {
    Result<Fix<S, D>> best = fix;
    S lowest = fix ? fix->chi_squared : std::numeric_limits<S>::infinity();
    std::uint64_t dropped = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const std::uint64_t bit = std::uint64_t{1} << i;
      if ((excluded & bit) != 0) continue;
      std::array<Measurement, kMaxMeasurements> kept;
      std::size_t size = 0;
      for (std::size_t j = 0; j < all.size(); ++j) {
        if (((excluded | bit) >> j & 1) == 0) kept[size++] = all[j];
      }
      const Result<Fix<S, D>> without =
          locate(std::span<const Measurement>{kept.data(), size}, options);
      if (without && without->chi_squared < lowest) {
        lowest = without->chi_squared;
        best = without;
        dropped = bit;
      }
    }
    if (dropped == 0) break;
    fix = best;
    excluded |= dropped;
    ++count;
  }
  if (!fix) return std::unexpected(fix.error());
  return ExclusionFix<S, D>{*fix, excluded, count, passes(*fix)};
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
