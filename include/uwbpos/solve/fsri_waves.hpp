// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Whole waves added to lengths, receiver by receiver, and what they cost; see fsri_search.hpp.

#include <algorithm>
#include <array>
#include <limits>
#include <span>

#include "uwbpos/model/pseudorange.hpp"
#include "uwbpos/solve/fsri_options.hpp"

namespace uwbpos {

/// One whole number for each receiver.
using FsriWaves = std::array<int, kMaxFsriReceivers>;

/// Waves of the receivers that have joined so far, up to a number common to all.
template <class S, int D>
class WaveAssignment {
 public:
  /// More than any repair may move.
  static constexpr int kTooMany = std::numeric_limits<int>::max();

  /// Nothing assigned. Receivers join far from those before, that few determine a position well.
  /// O(n²), no allocation.
  WaveAssignment(std::span<const Vec<S, D>> receivers, std::span<const S> lengths,
                 const Vec<S, D>& center, int max_repair)
      : lengths_{lengths}, max_repair_{max_repair} {
    const std::size_t n = lengths.size();
    // Longest first, of equal ones the earlier; std::sort would call itself and be larger.
    for (std::size_t i = 0; i < n; ++i) {
      std::size_t k = i;
      for (; k > 0 && lengths[static_cast<std::size_t>(by_length_[k - 1])] < lengths[i]; --k) {
        by_length_[k] = by_length_[k - 1];
      }
      by_length_[k] = static_cast<int>(i);
    }
    std::array<S, kMaxFsriReceivers> apart;
    for (std::size_t i = 0; i < n; ++i) apart[i] = squared_norm<S, D>(receivers[i] - center);
    for (std::size_t k = 0; k < n; ++k) {
      std::size_t farthest = 0;
      for (std::size_t i = 1; i < n; ++i) farthest = apart[i] > apart[farthest] ? i : farthest;
      order_[k] = static_cast<int>(farthest);
      for (std::size_t i = 0; i < n; ++i) {
        const S distance = squared_norm<S, D>(receivers[i] - receivers[farthest]);
        apart[i] = k == 0 && i != farthest ? distance : std::min(apart[i], distance);
      }
      for (std::size_t i = 0; i <= k; ++i) apart[place(i)] = S(-1);
    }
  }

  /// Which receiver joins as number `joined`.
  [[nodiscard]] std::size_t place(std::size_t joined) const {
    return static_cast<std::size_t>(order_[joined]);
  }

  /// Waves of the receiver that joins as number `joined`; not to be read before it is written.
  [[nodiscard]] int& operator[](std::size_t joined) { return waves_[place(joined)]; }
  /// The same.
  [[nodiscard]] int operator[](std::size_t joined) const { return waves_[place(joined)]; }

  /// The waves of all receivers, by place, `shift` more for each.
  [[nodiscard]] FsriWaves shifted(int shift) const {
    FsriWaves waves{};
    for (std::size_t i = 0; i < lengths_.size(); ++i) waves[i] = waves_[i] + shift;
    return waves;
  }

  /// Σ|m + shift| of the first `joined`; `kTooMany` where one of them exceeds the allowed repair.
  /// O(n).
  [[nodiscard]] int moved(std::size_t joined, int shift) const {
    int sum = 0;
    for (std::size_t i = 0; i < joined; ++i) {
      const int waves = (*this)[i] + shift;
      if (std::max(waves, -waves) > max_repair_) return kTooMany;
      sum += std::max(waves, -waves);
    }
    return sum;
  }

  /// Whether the first `joined` have the same number. O(n).
  [[nodiscard]] bool alike(std::size_t joined) const {
    for (std::size_t i = 1; i < joined; ++i) {
      if ((*this)[i] != (*this)[0]) return false;
    }
    return true;
  }

  /// The least of `moved` over all shifts. O(n · max_repair).
  [[nodiscard]] int fewest_moved(std::size_t joined) const {
    int fewest = kTooMany;
    for (int shift = -max_repair_; shift <= max_repair_; ++shift) {
      fewest = std::min(fewest, moved(joined, shift));
    }
    return fewest;
  }

  /// By how many waves the first `joined` depart from the order of their lengths: from each to the
  /// next shorter one, the waves that it has more; equal lengths have equal lags. O(n).
  [[nodiscard]] int out_of_order(std::size_t joined) const {
    std::array<bool, kMaxFsriReceivers> has_joined{};
    for (std::size_t i = 0; i < joined; ++i) has_joined[place(i)] = true;
    int sum = 0;
    std::size_t longer = kMaxFsriReceivers;
    for (std::size_t k = 0; k < lengths_.size(); ++k) {
      const auto here = static_cast<std::size_t>(by_length_[k]);
      if (!has_joined[here]) continue;
      if (longer < kMaxFsriReceivers) {
        const int down = waves_[longer] - waves_[here];
        sum += lengths_[longer] == lengths_[here] ? std::max(down, -down) : std::max(down, 0);
      }
      longer = here;
    }
    return sum;
  }

 private:
  std::span<const S> lengths_;
  int max_repair_;
  FsriWaves by_length_{};  // places by descending length
  FsriWaves order_{};      // places as they join
  FsriWaves waves_{};      // by place
};

/// The first `count` receivers to join, their lengths repaired, as pseudoranges.
template <class S, int D>
struct RepairedLengths {
  std::span<const Vec<S, D>> receivers;  ///< [m]
  std::span<const S> lengths;            ///< [m]
  const WaveAssignment<S, D>& waves;     ///< of each
  std::size_t count;                     ///< how many
  S wavelength;                          ///< [m]
  S sigma;                               ///< of each length [m]

  /// How many there are.
  [[nodiscard]] std::size_t size() const { return count; }
  /// Entry `i` of the pseudoranges.
  [[nodiscard]] RangeTo<S, D> operator[](std::size_t i) const {
    const std::size_t place = waves.place(i);
    return {receivers[place], lengths[place] + wavelength * static_cast<S>(waves[i]), sigma};
  }
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
