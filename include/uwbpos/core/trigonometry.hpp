// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Sine, cosine and arctangent that have the same bits on every processor and library in float,
/// made of + − × ÷ alone: Cody and Waite's reduction by π/4 in three parts, then the minimax
/// polynomials of Cephes (Moshier 1989). In double they are those of the standard library.

#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <type_traits>

namespace uwbpos {

namespace detail {

/// `angle` = octant · π/4 + `rest`, an even octant, |rest| ≤ π/4.
struct ReducedAngle {
  std::int32_t octant;
  float rest;
};

/// For |angle| ≤ 8192.
inline ReducedAngle reduce_angle(float angle) {
  const float size = std::abs(angle);
  auto octant = static_cast<std::int32_t>(size * (4 * std::numbers::inv_pi_v<float>));
  octant += octant & 1;
  const auto turns = static_cast<float>(octant);
  const float rest = ((size - turns * 0.78515625f) - turns * 2.4187564849853515625e-4f) -
                     turns * 3.77489497744594108e-8f;
  return {octant, rest};
}

/// sin of |x| ≤ π/4.
inline float small_sine(float x) {
  const float z = x * x;
  return ((-1.9515295891e-4f * z + 8.3321608736e-3f) * z - 1.6666654611e-1f) * z * x + x;
}

/// cos of |x| ≤ π/4.
inline float small_cosine(float x) {
  const float z = x * x;
  return ((2.443315711809948e-5f * z - 1.388731625493765e-3f) * z + 4.166664568298827e-2f) * z * z -
         0.5f * z + 1.0f;
}

/// Brings an angle to where `reduce_angle` takes it; NaN stays, infinity becomes NaN.
inline float bounded_angle(float angle) {
  constexpr float kMost = 8192;
  return std::abs(angle) <= kMost ? angle : std::remainder(angle, 2 * std::numbers::pi_v<float>);
}

/// sin of an angle that is not negative, in float: of `octant` · π/4 + `rest`.
inline float sine_from(std::int32_t octant, float rest) {
  const float value = (octant & 2) != 0 ? small_cosine(rest) : small_sine(rest);
  return (octant & 4) != 0 ? -value : value;
}

}  // namespace detail

/// sin of `angle` [rad]. Float: within 1e-7 for |angle| ≤ 8192; beyond, of its remainder by float's
/// 2π. NaN and infinity give NaN. O(1), no allocation.
template <class S>
[[nodiscard]] S sine(S angle) {
  if constexpr (std::is_same_v<S, float>) {
    const float bounded = detail::bounded_angle(angle);
    if (bounded != bounded) return std::numeric_limits<float>::quiet_NaN();
    const detail::ReducedAngle a = detail::reduce_angle(bounded);
    const float value = detail::sine_from(a.octant, a.rest);
    return std::signbit(bounded) ? -value : value;
  } else {
    return std::sin(angle);
  }
}

/// cos of `angle` [rad]; precision and cost as for `sine`.
template <class S>
[[nodiscard]] S cosine(S angle) {
  if constexpr (std::is_same_v<S, float>) {
    const float bounded = detail::bounded_angle(angle);
    if (bounded != bounded) return std::numeric_limits<float>::quiet_NaN();
    const detail::ReducedAngle a = detail::reduce_angle(bounded);
    return detail::sine_from(a.octant + 2, a.rest);
  } else {
    return std::cos(angle);
  }
}

/// The angle of (`x`, `y`) from +x counter-clockwise, in [−π, π] [rad]; of (0, 0) as `std::atan2`
/// has it. Float: within 3e-7 for finite arguments. One division or two; no allocation.
template <class S>
[[nodiscard]] S arctangent(S y, S x) {
  if constexpr (std::is_same_v<S, float>) {
    constexpr float kPi = std::numbers::pi_v<float>;
    const float across = std::abs(x);
    const float up = std::abs(y);
    const bool steep = up > across;
    const float longer = steep ? up : across;
    // (0, 0) has the direction of its signs; NaN stays.
    const float ratio = longer == 0 ? 0 : (steep ? across : up) / longer;
    // tan(π/8) halves what the polynomial has to cover.
    const bool beyond = ratio > 0.41421356f;
    const float t = beyond ? (ratio - 1) / (ratio + 1) : ratio;
    const float z = t * t;
    const float small = (((8.05374449538e-2f * z - 1.38776856032e-1f) * z + 1.99777106478e-1f) * z -
                         3.33329491539e-1f) *
                            z * t +
                        t;
    float angle = beyond ? kPi / 4 + small : small;
    if (steep) angle = kPi / 2 - angle;
    if (std::signbit(x)) angle = kPi - angle;
    return std::copysign(angle, y);
  } else {
    return std::atan2(y, x);
  }
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
