// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a host that reads late knows of the rate between two counters, whatever it miscounts.
/// The phase D = Σ(ΔB − ΔA) needs no wraps (each term is its own signed residue), and no queue can
/// make host time H since the first event wrong by more than the longest lag L:
///   \f$ D/(H + L) \le \delta \le D/(H - L) \f$   (for D > 0; mirrored below).
/// One interval of host time may suggest any wrap count; after a few L the wrong ones are outside.

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/time/device_time.hpp"

namespace uwbpos {

/// Rates between which δ lies, and the likeliest.
template <class S>
struct RateBounds {
  S low;     ///< Fraction.
  S middle;  ///< D/H. Fraction.
  S high;    ///< Fraction.

  /// Whether δ may be `rate`.
  [[nodiscard]] bool admit(S rate) const { return low <= rate && rate <= high; }
};

/// The phase that two counters gathered since an event, and the host's time of that.
/// 16 bytes; O(1), never allocates, cannot fail.
template <class S>
class PhaseWindow {
 public:
  /// Longer than this, in lags, a window gains little: bounds of 1 ± 1/8, but time to wander.
  static constexpr std::int64_t kLongest = 8;

  /// Begins at an event that the host saw at `host` [µs].
  void start(std::int64_t host) {
    host_ = host;
    phase_ = 0;
  }

  /// Adds an interval's ΔB − ΔA [ticks].
  void add(std::int64_t difference) { phase_ += difference; }

  /// Host time since the start [µs].
  [[nodiscard]] std::int64_t length(std::int64_t host) const { return host - host_; }

  /// The bounds at `host` > start, with a host at most `lag` [µs] late. `limit` stands in for the
  /// far bound until H > L; both are widened by `margin`, a rate: noise, and what the rate may
  /// have wandered.
  [[nodiscard]] RateBounds<S> bounds(std::int64_t host, std::int64_t lag, S limit, S margin) const {
    const auto over = [&](std::int64_t microseconds) {
      return scalar_ticks<S>(phase_) * kTickSeconds<S> / (scalar_ticks<S>(microseconds) * S(1e-6));
    };
    const std::int64_t run = length(host);
    const S near = over(run + lag);
    const S far = run > lag ? over(run - lag) : std::copysign(limit, scalar_ticks<S>(phase_));
    return {std::min(near, far) - margin, over(run), std::max(near, far) + margin};
  }

 private:
  std::int64_t host_ = 0;
  std::int64_t phase_ = 0;
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
