// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The surveyed anchors of a site: ids and positions, in memory of fixed size.

#include <algorithm>
#include <array>
#include <cstdint>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"

namespace uwbpos {

/// A surveyed anchor.
template <class S, int D>
struct Anchor {
  std::uint32_t id;    ///< what logs call it
  Vec<S, D> position;  ///< [m] in the site's frame
};

/// Up to `Capacity` anchors in D dimensions, kept in ascending order of id, so that whatever is
/// computed in their order does not depend on the order in which they were added.
/// About `Capacity · sizeof(Anchor<S, D>)` bytes; never allocates.
template <class S, int D, int Capacity = kMaxMeasurements>
class Anchors {
  static_assert(Capacity > 0, "room for one anchor at least");

 public:
  /// The most anchors that fit.
  static constexpr int kCapacity = Capacity;

  /// Adds an anchor; O(n). On an error nothing changes.
  /// Errors: NotFinite (position), DuplicateAnchor (id), CapacityExceeded.
  [[nodiscard]] Result<void> add(std::uint32_t id, const Vec<S, D>& position) {
    if (!position.allFinite()) return std::unexpected(Error::NotFinite);
    Anchor<S, D>* const last = entries_.data() + size_;
    Anchor<S, D>* const place = entries_.data() + (lower_bound(id) - entries_.data());
    if (place != last && place->id == id) return std::unexpected(Error::DuplicateAnchor);
    if (size_ == Capacity) return std::unexpected(Error::CapacityExceeded);
    std::move_backward(place, last, last + 1);
    *place = {id, position};
    ++size_;
    return {};
  }

  /// The position [m] of the anchor with this id; O(log n).
  /// Errors: UnknownAnchor.
  [[nodiscard]] Result<Vec<S, D>> find(std::uint32_t id) const {
    const Anchor<S, D>* const place = lower_bound(id);
    if (place == end() || place->id != id) return std::unexpected(Error::UnknownAnchor);
    return place->position;
  }

  /// Whether an anchor has this id; O(log n).
  [[nodiscard]] bool contains(std::uint32_t id) const { return find(id).has_value(); }

  /// How many anchors there are.
  [[nodiscard]] int size() const { return size_; }
  /// Whether there are none.
  [[nodiscard]] bool empty() const { return size_ == 0; }

  /// The anchors in ascending order of id, one contiguous range. Valid until the next `add`.
  [[nodiscard]] const Anchor<S, D>* begin() const { return entries_.data(); }
  /// One past the last of them.
  [[nodiscard]] const Anchor<S, D>* end() const { return entries_.data() + size_; }

  /// The anchor at a place in that order, 0 ≤ index < size().
  [[nodiscard]] const Anchor<S, D>& operator[](int index) const { return begin()[index]; }

 private:
  [[nodiscard]] const Anchor<S, D>* lower_bound(std::uint32_t id) const {
    return std::lower_bound(begin(), end(), id,
                            [](const Anchor<S, D>& a, std::uint32_t key) { return a.id < key; });
  }

  std::array<Anchor<S, D>, static_cast<std::size_t>(Capacity)> entries_;
  int size_ = 0;
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
