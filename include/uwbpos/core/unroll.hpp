// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Loops whose counter is a type: compilers keep an array in registers only where no index is left
/// when they look, long before they unroll loops.

#include <type_traits>
#include <utility>

namespace uwbpos {

/// Calls f(0), …, f(N − 1), each number a `std::integral_constant<int, …>`.
template <int N, class F>
[[gnu::always_inline]] inline void unroll(const F& f) {
  [&]<int... I>(std::integer_sequence<int, I...>) __attribute__((always_inline)) {
    (f(std::integral_constant<int, I>{}), ...);
  }(std::make_integer_sequence<int, N>{});
}

/// The same, with plain numbers in a loop where N is more than four.
template <int N, class F>
[[gnu::always_inline]] inline void each(const F& f) {
  if constexpr (N <= 4) {
    unroll<N>(f);
  } else {
    for (int i = 0; i < N; ++i) f(i);
  }
}

/// N − 1 − i, a type if i is one.
template <int N, class I>
[[nodiscard, gnu::always_inline]] constexpr auto from_end(I i) {
  if constexpr (std::is_same_v<I, int>) {
    return N - 1 - i;
  } else {
    return std::integral_constant<int, N - 1 - I::value>{};
  }
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
