// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Sums over measurements, kept in registers. Sums of doubles have two lanes, of the even and of
/// the odd measurements, added to each other at the end: where a register holds two doubles both
/// lanes advance together, elsewhere one follows the other, with the same operations in the same
/// order and so the same bits. Sums of floats, which microcontrollers take one by one, have one
/// lane.

#include <cmath>
#include <cstddef>
#include <type_traits>

#include "uwbpos/core/unroll.hpp"

namespace uwbpos {

/// N numbers, or pairs of numbers, that plain integers index.
template <class P, int N>
struct Numbers {
  P values[N];  ///< the numbers
  /// Number i.
  [[nodiscard, gnu::always_inline]] constexpr P& operator[](int i) { return values[i]; }
  /// Number i.
  [[nodiscard, gnu::always_inline]] constexpr const P& operator[](int i) const { return values[i]; }
};

/// Where entry (i, j), i ≥ j, of a D × D lower triangle is, column by column.
template <int D>
inline constexpr int lower_index(int i, int j) {
  return j * D - j * (j - 1) / 2 + i - j;
}

/// The same for (i, j) above the diagonal too, where a symmetric matrix has the entry (j, i).
template <int D>
inline constexpr int lower_of(int i, int j) {
  return i > j ? lower_index<D>(i, j) : lower_index<D>(j, i);
}

/// Adds `weight` · g gᵀ to the lower triangle that begins at `sum[Begin]`.
template <int D, int Begin, class P, int K>
[[gnu::always_inline]] inline void add_lower(Numbers<P, K>& sum, const Numbers<P, D>& g,
                                             const P& weight) {
  unroll<D>([&](auto j) __attribute__((always_inline)) {
    const P scaled = weight * g[j];
    unroll<D - j>([&](auto i) __attribute__((always_inline)) {
      sum[Begin + lower_index<D>(j + i, j)] += scaled * g[j + i];
    });
  });
}

/// Two scalars in a register where the target has such, else void.
template <class S>
struct PairOf {
  using Type = void;  ///< none
};
#if defined(__SSE2__)
/// Two doubles.
template <>
struct PairOf<double> {
  using Type [[gnu::vector_size(16)]] = double;  ///< arithmetic lane by lane
};
#endif

/// The roots of registers, lane by lane.
template <class P>
  requires(!std::is_arithmetic_v<P>)
[[nodiscard, gnu::always_inline]] inline P square_root(const P& x) {
#if __has_builtin(__builtin_elementwise_sqrt)
  return __builtin_elementwise_sqrt(x);
#else
  using S = std::remove_cvref_t<decltype(x[0])>;
  [[maybe_unused]] constexpr bool kDouble = std::is_same_v<S, double>;
#if defined(__AVX__)
  if constexpr (kDouble && sizeof(P) == 32) return __builtin_ia32_sqrtpd256(x);
  if constexpr (!kDouble && sizeof(P) == 32) return __builtin_ia32_sqrtps256(x);
#endif
#if defined(__SSE2__)
  if constexpr (kDouble && sizeof(P) == 16) return __builtin_ia32_sqrtpd(x);
  if constexpr (!kDouble && sizeof(P) == 16) return __builtin_ia32_sqrtps(x);
#endif
  P roots = x;
  for (std::size_t i = 0; i < sizeof(P) / sizeof(S); ++i) roots[i] = std::sqrt(x[i]);
  return roots;
#endif
}

/// The root of one, for code that is written for both.
template <class S>
  requires std::is_floating_point_v<S>
[[nodiscard, gnu::always_inline]] inline S square_root(S x) {
  return std::sqrt(x);
}

/// The lesser of two, or of each two; `b` where `a` is not a number.
template <class P>
[[nodiscard, gnu::always_inline]] inline P lesser(const P& a, const P& b) {
  return a < b ? a : b;
}

/// Whether x, or each of it, is a number.
template <class P>
[[nodiscard, gnu::always_inline]] inline auto is_number(const P& x) {
  return x == x;  // NOLINT(misc-redundant-expression)
}

/// Whether x, or each of it, is a finite number: an int, or a mask, for use with &.
template <class P>
[[nodiscard, gnu::always_inline]] inline auto is_finite(const P& x) {
  return (x - x == P{}) & is_number(x);  // NOLINT(misc-redundant-expression)
}

/// Whether a comparison of two numbers holds, or one of lanes in every lane.
[[nodiscard]] constexpr bool is_certain(bool holds) { return holds; }
/// The same of a mask of lanes.
template <class Mask>
  requires(!std::is_arithmetic_v<Mask>)
[[nodiscard]] bool is_certain(const Mask& mask) {
  for (std::size_t i = 0; i < sizeof(Mask) / sizeof(mask[0]); ++i) {
    if (!mask[i]) return false;
  }
  return true;
}

/// K sums over the elements of `all`, in lanes. `step(sum, take, one)` adds to the numbers `sum`
/// what take(f) = f(element) has, for one element or for two: scalars and pairs alike. Terms must
/// be proportional to `one`, which is zero for an element that is not there. O(n·K), no allocation.
template <class S, int K, class V, class Step>
[[gnu::always_inline]] inline Numbers<S, K> sum_in_lanes(const V& all, const Step& step) {
  using Pair = typename PairOf<S>::Type;
  const std::size_t n = all.size();
  if constexpr (std::is_void_v<Pair>) {
    constexpr std::size_t kLanes = sizeof(S) == sizeof(double) ? 2 : 1;
    const auto lane = [&](std::size_t i) __attribute__((always_inline)) {
      Numbers<S, K> sum = {};
      for (; i < n; i += kLanes) {
        step(
            sum, [&](const auto& f) __attribute__((always_inline)) -> S { return f(all[i]); },
            S(1));
      }
      return sum;
    };
    Numbers<S, K> total = lane(0);
    if constexpr (kLanes == 2) {
      const Numbers<S, K> odd = lane(1);
      unroll<K>([&](auto k) __attribute__((always_inline)) { total[k] += odd[k]; });
    }
    return total;
  } else {
    Numbers<Pair, K> sum = {};
    for (std::size_t i = 0; i < n; i += 2) {
      const bool whole = i + 1 < n;
      const auto& even = all[i];
      const auto& odd = all[whole ? i + 1 : i];
      step(
          sum,
          [&](const auto& f)
              __attribute__((always_inline)) -> Pair { return Pair{f(even), f(odd)}; },
          Pair{S(1), whole ? S(1) : S(0)});
    }
    Numbers<S, K> total;
    unroll<K>([&](auto k) __attribute__((always_inline)) { total[k] = sum[k][0] + sum[k][1]; });
    return total;
  }
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
