// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Random numbers that are the same for the same seed on every standard library and processor:
/// xoshiro256++ (Blackman, Vigna 2019) seeded by SplitMix64, and Marsaglia's polar method with a
/// logarithm made of + − × ÷ alone. Build with `-ffp-contract=off` for equal bits.

#include <cmath>
#include <cstdint>
#include <numbers>
#include <string_view>

namespace uwbpos::sim {

/// A stream of random numbers. 48 bytes, no allocation, no global state.
class Random {
 public:
  /// Seeded from a number.
  constexpr explicit Random(std::uint64_t seed) {
    for (auto& word : state_) word = split_mix(seed);
  }

  /// Seeded from a name (FNV-1a), so that each test or stream has its own numbers.
  constexpr explicit Random(std::string_view name) : Random{hash(name)} {}

  /// The stream `name` of a seed: streams of one seed are independent, so that what one concern
  /// draws does not move another's numbers.
  constexpr Random(std::uint64_t seed, std::string_view name) : Random{seed + hash(name)} {}

  /// 64 independent random bits.
  constexpr std::uint64_t bits() {
    const std::uint64_t result = rotate(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t shifted = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= shifted;
    state_[3] = rotate(state_[3], 45);
    return result;
  }

  /// Uniform in [0, 1), 53 bits.
  constexpr double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }

  /// Uniform in [low, high).
  constexpr double uniform(double low, double high) { return low + (high - low) * uniform(); }

  /// Uniform among the integers low … high, both included; low ≤ high.
  constexpr int integer(int low, int high) {
    const auto span = static_cast<std::uint64_t>(static_cast<std::int64_t>(high) - low + 1);
    return static_cast<int>(low + static_cast<std::int64_t>((bits() >> 32) * span >> 32));
  }

  /// True with the given probability.
  constexpr bool chance(double probability) { return uniform() < probability; }

  /// Standard normal.
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    double u = 0;
    double v = 0;
    double square = 0;
    do {
      u = uniform(-1, 1);
      v = uniform(-1, 1);
      square = u * u + v * v;
    } while (square >= 1 || square == 0);
    const double scale = std::sqrt(-2 * log(square) / square);
    spare_ = v * scale;
    has_spare_ = true;
    return u * scale;
  }

  /// Normal with the given mean and standard deviation.
  double normal(double mean, double sigma) { return mean + sigma * normal(); }

  /// Exponential with the given mean.
  double exponential(double mean) { return -mean * log(1 - uniform()); }

 private:
  static constexpr std::uint64_t rotate(std::uint64_t x, int k) {
    return (x << k) | (x >> (64 - k));
  }

  static constexpr std::uint64_t split_mix(std::uint64_t& state) {
    state += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

  static constexpr std::uint64_t hash(std::string_view name) {
    std::uint64_t h = 0xcbf29ce484222325u;
    for (const char c : name) h = (h ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
    return h;
  }

  // ln x = e ln 2 + 2 artanh((m − 1)/(m + 1)) with x = m 2^e, m in [√½, √2): eleven terms reach
  // 1e-17.
  static double log(double x) {
    int exponent = 0;
    double mantissa = std::frexp(x, &exponent);
    if (mantissa < 0.70710678118654752) {
      mantissa *= 2;
      --exponent;
    }
    const double z = (mantissa - 1) / (mantissa + 1);
    const double z2 = z * z;
    double sum = 0;
    for (int k = 21; k >= 1; k -= 2) sum = sum * z2 + 1.0 / k;
    return exponent * std::numbers::ln2 + 2 * z * sum;
  }

  std::uint64_t state_[4] = {};
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
