// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Inputs and outputs as 32-bit words, the same on host and target. `transfer(words, x)` names the
/// numbers of x in one order; `words` is a `Writer`, a `Reader` or a `Checker`.

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/ranging/ds_twr.hpp"
#include "uwbpos/ranging/ss_twr.hpp"

namespace firmware {

using Word = std::uint32_t;

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

template <class Words, class... T>
void transfer_all(Words& words, T&... items) {
  (transfer(words, items), ...);
}

template <class Words>
void transfer(Words& words, uwbpos::Measured<float>& m) {
  transfer_all(words, m.value, m.variance);
}
template <class Words, int D>
void transfer(Words& words, uwbpos::RangeTo<float, D>& r) {
  transfer_all(words, r.anchor, r.range, r.sigma);
}
template <class Words, int D>
void transfer(Words& words, uwbpos::TagRange<float, D>& r) {
  transfer_all(words, r.lever_arm, r.anchor, r.range, r.sigma);
}
template <class Words, int D>
void transfer(Words& words, uwbpos::DifferenceTo<float, D>& d) {
  transfer_all(words, d.anchor, d.difference);
}
template <class Words, int D>
void transfer(Words& words, uwbpos::PairDifference<float, D>& d) {
  transfer_all(words, d.anchor_a, d.anchor_b, d.difference, d.sigma);
}
template <class Words, int D>
void transfer(Words& words, uwbpos::Fix<float, D>& f) {
  transfer_all(words, f.position, f.covariance, f.chi_squared, f.degrees_of_freedom);
}
template <class Words, int D>
void transfer(Words& words, uwbpos::Mirror<float, D>& m) {
  transfer_all(words, m.first, m.second);
}
template <class Words>
void transfer(Words& words, uwbpos::Pose2<float>& p) {
  transfer_all(words, p.position, p.heading, p.covariance);
}
template <class Words>
void transfer(Words& words, uwbpos::LevelPose<float>& p) {
  transfer_all(words, p.position, p.heading, p.covariance);
}
template <class Words>
void transfer(Words& words, uwbpos::DeviceTime<>& t) {
  std::uint64_t ticks = t.ticks();
  transfer(words, ticks);
  t = uwbpos::DeviceTime<>{ticks};
}
template <class Words>
void transfer(Words& words, uwbpos::SsTwrStamps& s) {
  transfer_all(words, s.poll_tx, s.poll_rx, s.resp_tx, s.resp_rx);
}
template <class Words>
void transfer(Words& words, uwbpos::DsTwrStamps& s) {
  transfer_all(words, s.poll_tx, s.poll_rx, s.resp_tx, s.resp_rx, s.final_tx, s.final_rx);
}

/// A value, or the number of its error beyond 2³¹.
template <class Words, class T>
void transfer(Words& words, uwbpos::Result<T>& result) {
  Word verdict = result ? 0u : 0x80000000u + static_cast<Word>(result.error());
  words.word(verdict);
  if (result) transfer(words, *result);
}

}  // namespace firmware
