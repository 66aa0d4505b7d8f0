// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Range bias by received power. A leading edge is found earlier on a strong signal and later on a
/// weak one; Decawave's application note APS011 explains it. Two DWM1001 outdoors read 0.1 m short
/// at 2 m and 0.2 … 0.3 m long at 50 m. The user supplies the table for their antenna, channel and
/// pulse rate:
///   (1) corrected = range − bias(power), bias = estimate minus truth, linear between points.

#include <cmath>
#include <cstddef>
#include <span>

#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"

namespace uwbpos {

/// One point of the table: `power_dbm` received (total, or of the first path: the same one that is
/// asked for later), `bias` [m] = estimate minus truth.
template <class S>
struct RangeBiasPoint {
  S power_dbm;  ///< [dBm]
  S bias;       ///< [m], estimate minus truth.
};

/// A view of the caller's points, checked once by `make`. 16 bytes; owns nothing, so the points
/// must outlive it (flash is a good place).
template <class S>
class RangeBias {
 public:
  /// Errors: NotFinite (a point is NaN or infinite, or the step to the next one overflows),
  /// InvalidTable (no points, or powers that do not strictly increase). O(n).
  [[nodiscard]] static constexpr Result<RangeBias> make(std::span<const RangeBiasPoint<S>> points) {
    if (points.empty()) return std::unexpected(Error::InvalidTable);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!std::isfinite(points[i].power_dbm) || !std::isfinite(points[i].bias)) {
        return std::unexpected(Error::NotFinite);
      }
      if (i == 0) continue;
      if (!(points[i - 1].power_dbm < points[i].power_dbm)) {
        return std::unexpected(Error::InvalidTable);
      }
      if (!std::isfinite(points[i].power_dbm - points[i - 1].power_dbm) ||
          !std::isfinite(points[i].bias - points[i - 1].bias)) {
        return std::unexpected(Error::NotFinite);
      }
    }
    return RangeBias{points};
  }

  /// Bias [m] at `power_dbm`: linear between points, the end value beyond them (receivers saturate
  /// at both ends, and a table measured down to −95 dBm should not refuse −96). Error: NotFinite.
  /// O(log n).
  [[nodiscard]] constexpr Result<S> at(S power_dbm) const {
    if (!std::isfinite(power_dbm)) return std::unexpected(Error::NotFinite);
    if (power_dbm <= points_.front().power_dbm) return points_.front().bias;
    if (power_dbm >= points_.back().power_dbm) return points_.back().bias;
    std::size_t low = 0;
    std::size_t high = points_.size() - 1;
    while (high - low > 1) {
      const std::size_t middle = low + (high - low) / 2;
      (points_[middle].power_dbm <= power_dbm ? low : high) = middle;
    }
    const auto& left = points_[low];
    const auto& right = points_[high];
    const S fraction = (power_dbm - left.power_dbm) / (right.power_dbm - left.power_dbm);
    return left.bias + fraction * (right.bias - left.bias);
  }

 private:
  constexpr explicit RangeBias(std::span<const RangeBiasPoint<S>> points) : points_{points} {}

  std::span<const RangeBiasPoint<S>> points_;
};

/// Equation (1); the variance stays. Error: NotFinite (range, variance, power or the difference).
template <class S>
[[nodiscard]] constexpr Result<Measured<S>> correct_range_bias(const Measured<S>& range,
                                                               S power_dbm,
                                                               const RangeBias<S>& table) {
  if (!std::isfinite(range.value) || !std::isfinite(range.variance)) {
    return std::unexpected(Error::NotFinite);
  }
  const auto bias = table.at(power_dbm);
  if (!bias) return std::unexpected(bias.error());
  const S corrected = range.value - *bias;
  if (!std::isfinite(corrected)) return std::unexpected(Error::NotFinite);
  return Measured<S>{corrected, range.variance};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
