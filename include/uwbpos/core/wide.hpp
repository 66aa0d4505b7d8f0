// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A register full of scalars, for many problems at once: arithmetic and comparisons go lane by
/// lane, a comparison makes a mask, `mask ? a : b` chooses by it. How many there are follows from
/// what the compiler is told of the target (-mavx2, -march=x86-64-v3 …).

#include <cstddef>
#include <cstring>

#include "uwbpos/core/lanes.hpp"

namespace uwbpos {

#if defined(__AVX__)
/// Bytes of the registers that arithmetic on floats and doubles has.
inline constexpr std::size_t kRegisterBytes = 32;
#else
/// Bytes of the registers that arithmetic on floats and doubles has.
inline constexpr std::size_t kRegisterBytes = 16;
#endif

/// As many S as a register holds.
template <class S>
struct WideOf;
/// Floats.
template <>
struct WideOf<float> {
  using Type [[gnu::vector_size(kRegisterBytes)]] = float;  ///< arithmetic lane by lane
};
/// Doubles.
template <>
struct WideOf<double> {
  using Type [[gnu::vector_size(kRegisterBytes)]] = double;  ///< arithmetic lane by lane
};

/// A register of S.
template <class S>
using Wide = typename WideOf<S>::Type;

/// How many S there are in it.
template <class S>
inline constexpr std::size_t kLanes = kRegisterBytes / sizeof(S);

/// The next `kLanes` numbers of an array, aligned or not.
template <class S>
[[nodiscard, gnu::always_inline]] inline Wide<S> load_lanes(const S* numbers) {
  Wide<S> lanes;
  std::memcpy(&lanes, numbers, sizeof lanes);
  return lanes;
}

/// `sum_in_lanes` over elements that are registers themselves, one for each of `kLanes` problems:
/// `all[i]` is such an element, `all.one(i)` one where it is there and zero where it is not.
template <class P, int K, class V, class Step>
  requires requires(const V& all) { all.one(std::size_t{}); }
[[gnu::always_inline]] inline Numbers<P, K> sum_in_lanes(const V& all, const Step& step) {
  Numbers<P, K> sum = {};
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto element = all[i];
    const auto take = [&](const auto& f) __attribute__((always_inline)) -> P {
      if constexpr (std::is_arithmetic_v<std::remove_cvref_t<decltype(f(element))>>) {
        return P{} + f(element);  // the same in all lanes
      } else {
        return f(element);
      }
    };
    step(sum, take, P{all.one(i)});
  }
  return sum;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
