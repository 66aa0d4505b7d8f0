// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What the fuzzers share: numbers out of bytes, and a check that ends the program.

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <span>

namespace uwbpos::fuzz {

/// Ends the program unless `holds`; the fuzzer keeps the input.
inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "fuzz: not so: %s\n", what);
  std::abort();
}

/// Takes values off the front of a byte string; past its end every byte is zero.
class Bytes {
 public:
  explicit Bytes(std::span<const std::uint8_t> bytes) : bytes_{bytes} {}

  [[nodiscard]] bool empty() const { return bytes_.empty(); }

  template <class T>
  T take() {
    T value{};
    const std::size_t size = bytes_.size() < sizeof value ? bytes_.size() : sizeof value;
    if (size > 0) std::memcpy(&value, bytes_.data(), size);
    bytes_ = bytes_.subspan(size);
    return value;
  }

  /// Mostly a multiple of `step` within ±32768 steps, so that geometry can fit together;
  /// sometimes a special value, sometimes any bit pattern at all.
  template <class S>
  S number(S step) {
    using Limits = std::numeric_limits<S>;
    static constexpr S kSpecial[] = {Limits::quiet_NaN(),
                                     Limits::infinity(),
                                     -Limits::infinity(),
                                     S(0),
                                     -S(0),
                                     Limits::denorm_min(),
                                     Limits::min(),
                                     Limits::max(),
                                     -Limits::max(),
                                     Limits::epsilon(),
                                     S(1e18),
                                     S(-1e18)};
    const auto kind = take<std::uint8_t>();
    if (kind < 240) return S(take<std::int16_t>()) * step;
    if (kind < 252) return kSpecial[kind - 240];
    return take<S>();
  }

 private:
  std::span<const std::uint8_t> bytes_;
};

/// Calls `run.operator()<S, D>(rest)` for the scalar and dimension that the first byte says.
template <class Run>
void with_scalar_and_dimension(Bytes bytes, const Run& run) {
  switch (bytes.take<std::uint8_t>() & 3) {
    case 0:
      return run.template operator()<double, 2>(bytes);
    case 1:
      return run.template operator()<double, 3>(bytes);
    case 2:
      return run.template operator()<float, 2>(bytes);
    default:
      return run.template operator()<float, 3>(bytes);
  }
}

}  // namespace uwbpos::fuzz

/// The entry that libFuzzer calls.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
