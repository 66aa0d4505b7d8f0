// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a tracker keeps of each anchor that it has heard, in memory of fixed size.

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace uwbpos {

/// Places 0 … Capacity − 1 for ids, given in the order in which they are asked for.
template <int Capacity, class Id = std::uint32_t>
class PlacesById {
 public:
  /// The place of an id, −1 without one. O(Capacity).
  [[nodiscard]] int find(Id id) const {
    for (int k = 0; k < size_; ++k) {
      if (ids_[static_cast<std::size_t>(k)] == id) return k;
    }
    return -1;
  }

  /// The same; a new id gets the next place while there is one.
  [[nodiscard]] int place(Id id) {
    const int found = find(id);
    if (found >= 0 || size_ == Capacity) return found;
    ids_[static_cast<std::size_t>(size_)] = id;
    return size_++;
  }

 private:
  std::array<Id, static_cast<std::size_t>(Capacity + 1)> ids_{};
  int size_ = 0;
};

/// Places of biases by anchor, or with `ByLink` by tag and anchor: those expected first, then those
/// heard first.
template <int Capacity, bool ByLink>
class BiasPlaces {
 public:
  /// The place of a bias, −1 without one. O(Capacity).
  [[nodiscard]] int find(std::uint32_t anchor, std::uint32_t tag) const {
    return places_.find(key(anchor, tag));
  }
  /// The same; a new one gets the next place while there is one.
  [[nodiscard]] int place(std::uint32_t anchor, std::uint32_t tag) {
    return places_.place(key(anchor, tag));
  }
  /// Gives it a place as one that is expected; false if there is none left.
  [[nodiscard]] bool expect(std::uint32_t anchor, std::uint32_t tag) {
    const int given = place(anchor, tag);
    if (given >= expected_) expected_ = given + 1;
    return given >= 0;
  }
  /// Whether that at a place was expected.
  [[nodiscard]] bool is_expected(int place) const { return place >= 0 && place < expected_; }

 private:
  using Key = std::conditional_t<ByLink, std::uint64_t, std::uint32_t>;
  [[nodiscard]] static constexpr Key key(std::uint32_t anchor, std::uint32_t tag) {
    return static_cast<Key>(ByLink ? std::uint64_t{tag} << 32 | anchor : anchor);
  }

  PlacesById<Capacity, Key> places_;
  int expected_ = 0;
};

/// What an anchor's measurements have been like. A difference counts for both of its anchors.
struct AnchorCounters {
  std::uint32_t used = 0;     ///< by the track
  std::uint32_t refused = 0;  ///< by the gate, or for their time
};

/// The share that was refused, 0 … 1; zero of nothing. An anchor that lies stands out by it.
[[nodiscard]] constexpr float refused_share(const AnchorCounters& counters) {
  const std::uint32_t all = counters.used + counters.refused;
  return all == 0 ? 0.0f : static_cast<float>(counters.refused) / static_cast<float>(all);
}

/// Counters of up to `Capacity` anchors.
template <int Capacity>
class HeardAnchors {
 public:
  /// Another measurement of an anchor, used or refused. O(Capacity).
  void count(std::uint32_t anchor, bool used) {
    const int place = places_.place(anchor);
    if (place < 0) return;
    AnchorCounters& counters = counters_[static_cast<std::size_t>(place)];
    ++(used ? counters.used : counters.refused);
  }

  /// Those of an anchor; zeros for one never heard. O(Capacity).
  [[nodiscard]] AnchorCounters counters(std::uint32_t anchor) const {
    const int place = places_.find(anchor);
    return place < 0 ? AnchorCounters{} : counters_[static_cast<std::size_t>(place)];
  }

 private:
  PlacesById<Capacity> places_;
  std::array<AnchorCounters, static_cast<std::size_t>(Capacity)> counters_{};
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
