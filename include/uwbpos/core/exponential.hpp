// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Exponential and logarithm that have the same bits on every processor and library in float, made
/// of + − × ÷ alone: reduction by powers of two, then the minimax polynomials of Cephes (Moshier
/// 1989). In double they are those of the standard library.

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <type_traits>

namespace uwbpos {

namespace detail {

// ln 2 in two parts, the first of nine bits: times a power of two's exponent it is exact.
inline constexpr float kLn2High = 355.0f / 512.0f;
inline constexpr float kLn2Low = -2.12194440e-4f;

/// 2^`power`, −126 ≤ power ≤ 127.
inline float power_of_two(std::int32_t power) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(power + 127) << 23);
}

/// ln of a positive normal float.
inline float small_logarithm(float x) {
  const auto bits = std::bit_cast<std::uint32_t>(x);
  auto power = static_cast<std::int32_t>(bits >> 23) - 126;
  auto z = std::bit_cast<float>((bits & 0x7FFFFFu) | 0x3F000000u);  // in [½, 1)
  if (z < 0.70710678f) {
    z += z;
    --power;
  }
  z -= 1.0f;
  const float y = z * z;
  const auto turns = static_cast<float>(power);
  float p = ((((((((7.0376836292e-2f * z - 1.1514610310e-1f) * z + 1.1676998740e-1f) * z -
                  1.2420140846e-1f) *
                     z +
                 1.4249322787e-1f) *
                    z -
                1.6668057665e-1f) *
                   z +
               2.0000714765e-1f) *
                  z -
              2.4999993993e-1f) *
                 z +
             3.3333331174e-1f) *
            z * y;
  p += kLn2Low * turns - 0.5f * y;
  return (z + p) + kLn2High * turns;
}

}  // namespace detail

/// e to the power of `x`. Float: within 2e-7 of itself; zero below −103, infinity above 88.7. NaN
/// gives NaN. O(1), no allocation.
template <class S>
[[nodiscard]] S exponential(S x) {
  if constexpr (std::is_same_v<S, float>) {
    if (std::isnan(x)) return std::numeric_limits<float>::quiet_NaN();
    if (x < -104.0f) return 0.0f;
    if (x > 89.0f) return std::numeric_limits<float>::infinity();
    const auto power =
        static_cast<std::int32_t>(x * std::numbers::log2e_v<float> + (x < 0 ? -0.5f : 0.5f));
    const auto turns = static_cast<float>(power);
    const float r = (x - turns * detail::kLn2High) - turns * detail::kLn2Low;
    const float p = (((((1.9875691500e-4f * r + 1.3981999507e-3f) * r + 8.3334519073e-3f) * r +
                       4.1665795894e-2f) *
                          r +
                      1.6666665459e-1f) *
                         r +
                     5.0000001201e-1f) *
                        (r * r) +
                    r + 1.0f;
    // In halves: the whole power may be more than a float holds.
    const std::int32_t half = power / 2;
    return p * detail::power_of_two(half) * detail::power_of_two(power - half);
  } else {
    return std::exp(x);
  }
}

/// ln(1 + `x`) for x ≥ 0, also where x is far below one. Float: within 2e-7 of itself. A negative x
/// or NaN gives NaN. O(1), no allocation.
template <class S>
[[nodiscard]] S logarithm_of_one_plus(S x) {
  if constexpr (std::is_same_v<S, float>) {
    if (!(x >= 0)) return std::numeric_limits<float>::quiet_NaN();
    const float sum = 1.0f + x;
    if (!(sum <= std::numeric_limits<float>::max())) return sum;
    // What the sum has rounded off, put back to first order.
    const float lost = sum < 16777216.0f ? x - (sum - 1.0f) : 0.0f;
    return detail::small_logarithm(sum) + lost / sum;
  } else {
    return x >= 0 ? std::log1p(x) : std::numeric_limits<S>::quiet_NaN();
  }
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
