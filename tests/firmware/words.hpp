// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Inputs and outputs as 32-bit words, the same on host and target. `transfer(words, x)` names the
/// numbers of x in one order; `words` is a `Writer`, a `Reader` or a `Checker`.

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <utility>

#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/time/device_time.hpp"

#include "entry.hpp"

namespace firmware {

/// Reads words from a table in flash.
class Reader {
 public:
  explicit Reader(const Word* from) : at_{from} {}
  void word(Word& w) { w = *at_++; }

 private:
  const Word* at_;
};

template <class Words>
void transfer(Words& words, float& x) {
  Word w = std::bit_cast<Word>(x);
  words.word(w);
  x = std::bit_cast<float>(w);
}

template <class Words, class I>
  requires(std::is_integral_v<I> || std::is_enum_v<I>)
void transfer(Words& words, I& x) {
  if constexpr (sizeof(I) == 8) {
    auto low = static_cast<Word>(static_cast<std::uint64_t>(x));
    auto high = static_cast<Word>(static_cast<std::uint64_t>(x) >> 32);
    words.word(low);
    words.word(high);
    x = static_cast<I>((static_cast<std::uint64_t>(high) << 32) | low);
  } else {
    auto w = static_cast<Word>(x);
    words.word(w);
    x = static_cast<I>(w);
  }
}

template <class Words, int Rows, int Cols>
void transfer(Words& words, Eigen::Matrix<float, Rows, Cols>& m) {
  for (int j = 0; j < Cols; ++j) {
    for (int i = 0; i < Rows; ++i) transfer(words, m(i, j));
  }
}

template <class Words, class T, std::size_t N>
void transfer(Words& words, std::array<T, N>& items) {
  for (T& item : items) transfer(words, item);
}

template <class Words, unsigned Bits>
void transfer(Words& words, uwbpos::DeviceTime<Bits>& t) {
  std::uint64_t ticks = t.ticks();
  transfer(words, ticks);
  t = uwbpos::DeviceTime<Bits>{ticks};
}

template <class Words, class A, class B>
void transfer(Words& words, std::pair<A, B>& both) {
  transfer(words, both.first);
  transfer(words, both.second);
}

/// A value, or the number of its error beyond 2³¹.
template <class Words, class T>
void transfer(Words& words, uwbpos::Result<T>& result) {
  Word verdict = result ? 0u : 0x80000000u + static_cast<Word>(result.error());
  words.word(verdict);
  if (result) transfer(words, *result);
}

/// Anything, as far as a count of members is concerned.
struct Anything {
  template <class T>
  operator T() const;
};

template <class T, std::size_t... I>
constexpr bool has_members(std::index_sequence<I...>) {
  return requires { T{(static_cast<void>(I), Anything{})...}; };
}

/// How many members a struct has, up to eleven.
template <class T, std::size_t N = 11>
constexpr std::size_t count_members() {
  if constexpr (has_members<T>(std::make_index_sequence<N>{})) {
    return N;
  } else {
    return count_members<T, N - 1>();
  }
}

template <class Words, class... T>
void transfer_all(Words& words, T&... items) {
  (transfer(words, items), ...);
}

/// Any struct of the library or of a case: its members in their order.
template <class Words, class T>
  requires std::is_aggregate_v<T>
void transfer(Words& words, T& x) {
  constexpr std::size_t kMembers = count_members<T>();
  if constexpr (kMembers == 1) {
    auto& [a] = x;
    transfer_all(words, a);
  } else if constexpr (kMembers == 2) {
    auto& [a, b] = x;
    transfer_all(words, a, b);
  } else if constexpr (kMembers == 3) {
    auto& [a, b, c] = x;
    transfer_all(words, a, b, c);
  } else if constexpr (kMembers == 4) {
    auto& [a, b, c, d] = x;
    transfer_all(words, a, b, c, d);
  } else if constexpr (kMembers == 5) {
    auto& [a, b, c, d, e] = x;
    transfer_all(words, a, b, c, d, e);
  } else if constexpr (kMembers == 6) {
    auto& [a, b, c, d, e, f] = x;
    transfer_all(words, a, b, c, d, e, f);
  } else if constexpr (kMembers == 7) {
    auto& [a, b, c, d, e, f, g] = x;
    transfer_all(words, a, b, c, d, e, f, g);
  } else if constexpr (kMembers == 8) {
    auto& [a, b, c, d, e, f, g, h] = x;
    transfer_all(words, a, b, c, d, e, f, g, h);
  } else if constexpr (kMembers == 9) {
    auto& [a, b, c, d, e, f, g, h, i] = x;
    transfer_all(words, a, b, c, d, e, f, g, h, i);
  } else {
    static_assert(kMembers == 10, "a struct of more members");
    auto& [a, b, c, d, e, f, g, h, i, j] = x;
    transfer_all(words, a, b, c, d, e, f, g, h, i, j);
  }
}

}  // namespace firmware
