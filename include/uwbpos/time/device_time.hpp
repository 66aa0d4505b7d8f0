// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A radio's timestamp counter, which wraps. DW1000/DW3000: 40 bits of 15.65 ps, 17.2 s a wrap;
/// many firmwares log its low 32 bits, 67.2 ms a wrap.

#include <bit>
#include <cstdint>
#include <limits>

namespace uwbpos {

/// A reading of a counter of `Bits` bits. Readings have no order, only differences:
/// `later - earlier` is the signed residue modulo 2^Bits in [−2^(Bits−1), 2^(Bits−1)) ticks,
/// the true difference as long as that lies below half the counter's range.
template <unsigned Bits = 40>
class DeviceTime {
  static_assert(Bits >= 8 && Bits <= 62, "a counter has 8 to 62 bits");

 public:
  /// Width of the counter.
  static constexpr unsigned kBits = Bits;
  /// Ticks to a wrap, 2^Bits.
  static constexpr std::int64_t kWrap = std::int64_t{1} << Bits;
  /// Half of that: intervals from here on have no sign.
  static constexpr std::int64_t kHalfWrap = kWrap / 2;

  /// Reading zero.
  constexpr DeviceTime() = default;

  /// Bits above the counter's are dropped, as the hardware would.
  constexpr explicit DeviceTime(std::uint64_t ticks) : ticks_{ticks & (kWrap - 1)} {}

  /// The reading, in [0, 2^Bits).
  [[nodiscard]] constexpr std::uint64_t ticks() const { return ticks_; }

  /// The same reading; whole wraps apart are the same.
  friend constexpr bool operator==(DeviceTime, DeviceTime) = default;

  /// Signed ticks from `earlier` to `later`, as said above.
  friend constexpr std::int64_t operator-(DeviceTime later, DeviceTime earlier) {
    const std::uint64_t residue = (later.ticks_ - earlier.ticks_) & (kWrap - 1);
    const auto difference = static_cast<std::int64_t>(residue);
    return difference < kHalfWrap ? difference : difference - kWrap;
  }

  /// The reading `ticks` later, wrapped.
  friend constexpr DeviceTime operator+(DeviceTime time, std::int64_t ticks) {
    return DeviceTime{time.ticks_ + static_cast<std::uint64_t>(ticks)};
  }

  /// The reading `ticks` earlier, wrapped.
  friend constexpr DeviceTime operator-(DeviceTime time, std::int64_t ticks) {
    return DeviceTime{time.ticks_ - static_cast<std::uint64_t>(ticks)};
  }

 private:
  std::uint64_t ticks_ = 0;
};

/// A number of ticks as an integer, |ticks| < 2^62; a fraction is dropped. A processor without
/// double has no instruction for it, and its library goes by way of double; from its bits it takes
/// ten.
template <class S>
[[nodiscard]] constexpr std::int64_t integer_ticks(S ticks) {
  if constexpr (std::numeric_limits<S>::digits <= 24) {
    if (ticks < S(1 << 30) && ticks > -S(1 << 30)) return static_cast<std::int32_t>(ticks);
    const auto bits = std::bit_cast<std::uint32_t>(ticks);
    const auto exponent = static_cast<int>(bits >> 23 & 0xFFu) - 150;
    const std::int64_t size = std::int64_t{(bits & 0x7FFFFFu) | 0x800000u} << exponent;
    return bits >> 31 != 0 ? -size : size;
  } else {
    return static_cast<std::int64_t>(ticks);
  }
}

/// A number of ticks as a scalar, |ticks| < 2^62: exact where the scalar can hold it, else rounded,
/// float to within 2^-23 of it. A processor without double has no instruction for this, and its
/// library may go by way of double; in halves, each with its own sign, it takes six.
template <class S>
[[nodiscard]] constexpr S scalar_ticks(std::int64_t ticks) {
  if constexpr (std::numeric_limits<S>::digits <= 24) {
    const auto low = static_cast<std::int32_t>(ticks);
    const auto carry = static_cast<std::int32_t>(static_cast<std::uint32_t>(low) >> 31);
    const auto high = static_cast<std::int32_t>(ticks >> 32) + carry;
    return static_cast<S>(high) * S(4294967296.0) + static_cast<S>(low);
  } else {
    return static_cast<S>(ticks);
  }
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
