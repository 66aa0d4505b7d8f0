// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The arithmetic of `ClockSync`: a Kalman filter of one clock's phase and rate against another's.
/// The control anchor's clock, counted in the anchor's time a, is
///   (1) \f$ c(a) = c_0 + (a - a_0) + x + \delta\,(a - a_0),\quad \delta \approx e_C - e_A \f$
/// with integers c0, a0, a phase x below a tick, and a rate δ that walks at random,
///   (2) \f$ d\delta = q\,dW:\quad P' = F P F^T + q^2
///       \begin{pmatrix} s^3/3 & s^2/2 \\ s^2/2 & s \end{pmatrix},\quad
///       F = \begin{pmatrix} 1 & s \\ 0 & 1 \end{pmatrix} \f$.
/// An event seen at c by one and, with white noise of variance r, at a by the other measures
///   (3) \f$ \nu = c - c(a),\quad K = P'_{\cdot 0}/(P'_{00} + r),\quad
///       P = P' - K\,P'_{0 \cdot} \f$.
/// P is kept as \f$ P_{00},\ g = P_{01}/P_{00},\ w = P_{11} - g P_{01} \f$, in which (2) and (3)
/// are
///   (4) \f$ P'_{00} = P_{00}(1 + s g)^2 + s^2 w + q^2 s^3/3,\quad
///       P'_{01} = g P_{00} (1 + s g) + s w + q^2 s^2/2,\quad
///       P'_{00} w' = P_{00} w + q^2 s\,(P_{00} + s P_{01} + s^2 P_{11}/3 + q^2 s^3/12) \f$;
///       a measurement scales P00 by \f$ r/(P'_{00} + r) \f$ and leaves g and w as they are:
/// sums of positive terms, so that no variance is negative, in float either.
/// δ is an integer of 2^-36 and a rest, so that \f$ \delta (a - a_0) \f$ is exact in 64 bits while
/// |δ| < 2^-12 (244 ppm): only what is left below a few ticks is a float.

#include <cmath>
#include <cstdint>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/time/device_time.hpp"

namespace uwbpos {

/// One event on two clocks: `control` + `fraction` ticks on one, `anchor` on the other.
template <class S>
struct ClockPair {
  DeviceTime<> control;  ///< whole ticks
  S fraction{};          ///< to be added [ticks]
  DeviceTime<> anchor;   ///< whole ticks
};

/// Ticks on the control clock from `earlier` to `later`, exact in the whole ones.
template <class S>
[[nodiscard]] constexpr S control_ticks(const ClockPair<S>& earlier, const ClockPair<S>& later) {
  return scalar_ticks<S>(later.control - earlier.control) + (later.fraction - earlier.fraction);
}

/// Phase and rate of (1) with their covariance. Time is counted in spans of 2^36 ticks (1.08 s),
/// rates in ticks a span, wherever nothing else is said; events of one call lie less than half a
/// wrap (8.6 s) apart. Nothing fails, nothing allocates; 48 bytes in float.
template <class S>
class ClockFilter {
 public:
  /// A rate of one tick a span, as a fraction: 2^-36.
  static constexpr S kUnit = S(1.0 / static_cast<double>(std::int64_t{1} << 36));

  /// Both states from two events, of which `later` was seen later: exact, with the covariance
  /// of two measurements of variance `noise` [ticks²] and the wander between them.
  ClockFilter(const ClockPair<S>& earlier, const ClockPair<S>& later, S noise, S wander)
      : base_{later}, phase_{noise} {
    const std::int64_t run = later.anchor - earlier.anchor;
    const std::int64_t scaled = difference(earlier, later) * kSpan;
    const S s = spans(run);
    rate_ = scaled / run;
    rest_ = scalar_ticks<S>(scaled - rate_ * run) / scalar_ticks<S>(run) +
            (later.fraction - earlier.fraction) / s;
    slope_ = 1 / s;
    given_phase_ = noise / (s * s) + wander * s / 3;
    settle();
  }

  /// Nothing known; to be replaced.
  ClockFilter() = default;

  /// q² of (2) from q [1/√s].
  [[nodiscard]] static constexpr S wander_of(S q) {
    return (q / kUnit) * (q / kUnit) * (kTickSeconds<S> / kUnit);
  }

  /// How much more the control clock ran between two events than the other, in whole ticks:
  /// the signed residue, right as long as it is below half a wrap.
  [[nodiscard]] static constexpr std::int64_t difference(const ClockPair<S>& earlier,
                                                         const ClockPair<S>& later) {
    const DeviceTime<> offset_then{later.control.ticks() - later.anchor.ticks()};
    const DeviceTime<> offset_before{earlier.control.ticks() - earlier.anchor.ticks()};
    return offset_then - offset_before;
  }

  /// Ticks as spans.
  [[nodiscard]] static constexpr S spans(std::int64_t ticks) {
    return scalar_ticks<S>(ticks) * kUnit;
  }

  /// The event that a run at the tracked rate leads to from another: (1) from any event on.
  [[nodiscard]] ClockPair<S> carried(const ClockPair<S>& from, DeviceTime<> anchor) const {
    const std::int64_t run = anchor - from.anchor;
    const std::int64_t product = rate_ * run;
    const std::int64_t whole = product >> 36;
    const S part = scalar_ticks<S>(product - whole * kSpan) * kUnit + rest_ * spans(run);
    return {from.control + (run + whole), from.fraction + part, anchor};
  }

  /// Equation (1): what the control clock shows when the other shows `anchor`.
  [[nodiscard]] ClockPair<S> at(DeviceTime<> anchor) const { return carried(base_, anchor); }

  /// Variance of its phase [ticks²], P'00 of (4); before the last event an approximation.
  [[nodiscard]] S variance_at(DeviceTime<> anchor, S wander) const {
    const S s = spans(anchor - base_.anchor);
    const S grown = 1 + s * slope_;
    return phase_ * grown * grown + s * s * (given_phase_ + wander * std::abs(s) / 3);
  }

  /// Variance of the rate at a later event.
  [[nodiscard]] S rate_variance_at(DeviceTime<> anchor, S wander) const {
    return rate_variance() + wander * std::abs(spans(anchor - base_.anchor));
  }

  /// Equations (3) and (4): `departure` ν [ticks] of an event from `at` that same time, which lies
  /// after the last.
  void correct(DeviceTime<> anchor, S departure, S noise, S wander) {
    const S s = spans(anchor - base_.anchor);
    const S phase = variance_at(anchor, wander);
    const S both = slope_ * phase_ * (1 + s * slope_) + s * (given_phase_ + wander * s / 2);
    const S sum = phase_ * (1 + s * slope_) + s * s * (rate_variance() + wander * s / 4) / 3;
    given_phase_ = given_phase_ * (phase_ / phase) + wander * s * (sum / phase);
    slope_ = both / phase;
    const S total = phase + noise;
    base_ = at(anchor);
    base_.fraction += phase / total * departure;
    rest_ += both / total * departure;
    phase_ = phase * noise / total;
    settle();
  }

  /// A new phase from an event, the rate as it was.
  void relock(const ClockPair<S>& event, S noise, S wander) {
    given_phase_ = rate_variance_at(event.anchor, wander);
    phase_ = noise;
    slope_ = 0;
    base_ = event;
    settle();
  }

  /// δ, a fraction, and its variance as of the last event.
  [[nodiscard]] Measured<S> rate() const {
    return {(scalar_ticks<S>(rate_) + rest_) * kUnit, rate_variance() * kUnit * kUnit};
  }

  /// The last event that was used, as filtered.
  [[nodiscard]] const ClockPair<S>& base() const { return base_; }

 private:
  static constexpr std::int64_t kSpan = std::int64_t{1} << 36;

  [[nodiscard]] S rate_variance() const { return given_phase_ + slope_ * slope_ * phase_; }

  // Whole ticks and whole units of the rate become integers.
  void settle() {
    const S ticks = std::floor(base_.fraction + S(0.5));
    base_.control = base_.control + integer_ticks(ticks);
    base_.fraction -= ticks;
    const S units = std::floor(rest_ + S(0.5));
    rate_ += integer_ticks(units);
    rest_ -= units;
  }

  ClockPair<S> base_{};
  std::int64_t rate_ = 0;
  S rest_{};
  S phase_{};        // P00
  S slope_{};        // g
  S given_phase_{};  // w
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
