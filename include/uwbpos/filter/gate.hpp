// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Whether a measurement may be believed. Reachability (004): an innovation ν cannot be motion when
/// \f[ |\nu| > |g|\,(v_{max}\,\Delta t + \tfrac12 a_{max}\,\Delta t^2)
///     + k \sqrt{r + |g|^2\,\mathrm{tr}\,P_0} \tag{1} \f]
/// g the measurement's gradient by position, r its noise, Δt the time since something was last
/// used and P₀ the position's covariance then. Statistics:
/// \f[ \nu^T S^{-1} \nu \le \chi^2_{gate}(\dim \nu) \tag{2} \f]
/// Both are asked so that NaN fails. A gate may lock its own filter out; `LockOutWatch` tells.

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "uwbpos/core/chi_squared.hpp"
#include "uwbpos/core/result.hpp"

namespace uwbpos {

/// Limits of what is believed.
template <class S>
struct GateOptions {
  S max_speed = S(10);         ///< v_max [m/s]
  S max_acceleration = S(20);  ///< a_max [m/s²]
  S sigmas = S(3.3);           ///< of (1) and, as a normal quantile, of (2); 1 in 2000 fails
};

/// Whether all limits are positive and finite.
template <class S>
[[nodiscard]] bool is_valid(const GateOptions<S>& o) {
  return o.max_speed > S(0) && std::isfinite(o.max_speed) && o.max_acceleration > S(0) &&
         std::isfinite(o.max_acceleration) && o.sigmas > S(0) && std::isfinite(o.sigmas);
}

/// What (1) knows of the track.
template <class S>
struct Reach {
  S elapsed;            ///< Δt [s]
  S position_variance;  ///< tr P₀ [m²]
};

/// (1): nothing, or Error::Unreachable; Error::NotFinite for an innovation that is not.
/// `slope`: |g|; `noise`: r. One root.
template <class S>
[[nodiscard]] std::optional<Error> check_reach(const GateOptions<S>& options, const Reach<S>& reach,
                                               S innovation, S slope, S noise) {
  if (!std::isfinite(innovation)) return Error::NotFinite;
  const S t = reach.elapsed;
  const S moved = slope * t * (options.max_speed + options.max_acceleration * t / S(2));
  const S spread = options.sigmas * std::sqrt(noise + slope * slope * reach.position_variance);
  if (!(std::abs(innovation) <= moved + spread)) return Error::Unreachable;
  return std::nullopt;
}

/// (2) for νᵀS⁻¹ν of `dimension` components: nothing, or Error::OutlierRejected; Error::NotFinite.
template <class S>
[[nodiscard]] std::optional<Error> check_statistics(const GateOptions<S>& options,
                                                    S normalised_square, int dimension) {
  if (!std::isfinite(normalised_square)) return Error::NotFinite;
  const S gate = chi_squared_gate(dimension, options.sigmas);
  if (!(normalised_square <= gate)) return Error::OutlierRejected;
  return std::nullopt;
}

/// How many measurements were used, and how many were not, by reason.
class GateCounters {
 public:
  /// Another that was used.
  void count_used() { ++used_; }
  /// Another that was not.
  void count(Error reason) { ++refused_[static_cast<std::size_t>(reason)]; }
  /// Those used.
  [[nodiscard]] std::uint32_t used() const { return used_; }
  /// Those refused for this reason.
  [[nodiscard]] std::uint32_t refused(Error reason) const {
    return refused_[static_cast<std::size_t>(reason)];
  }

 private:
  std::array<std::uint32_t, kErrorCount> refused_{};
  std::uint32_t used_ = 0;
};

/// Remembers the last 16 verdicts, to tell a filter that its own gate has locked out from one that
/// meets an outlier now and then.
class LockOutWatch {
 public:
  /// Another verdict, at `time` [µs].
  void add(bool used, std::int64_t time) {
    verdicts_ = static_cast<std::uint16_t>(verdicts_ << 1 | (used ? 0 : 1));
    if (used) last_used_ = time;
  }

  /// When something was last used [µs].
  [[nodiscard]] std::int64_t last_used() const { return last_used_; }

  /// True when ten of the last sixteen were refused, or four in a row and nothing was used since
  /// `patience` [µs].
  [[nodiscard]] bool suspicious(std::int64_t time, std::int64_t patience) const {
    if (std::popcount(verdicts_) >= 10) return true;
    return (verdicts_ & 0xf) == 0xf && time - last_used_ > patience;
  }

  /// Begins anew, all well.
  void reset(std::int64_t time) {
    verdicts_ = 0;
    last_used_ = time;
  }

 private:
  std::int64_t last_used_ = 0;
  std::uint16_t verdicts_ = 0;
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
