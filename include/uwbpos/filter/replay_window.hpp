// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The last events of a tracker in order of time, with a snapshot of the track before every
/// `Stride`-th of them, so that one that comes late is put where it belongs and the rest done over:
/// at most `Stride` more events than came after it.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace uwbpos {

/// Up to `Capacity` events (with a member `time`) and the tracks before some. Fixed size, about
/// Capacity·sizeof(Event) + (Capacity/Stride)·sizeof(Track) bytes.
template <class Event, class Track, int Capacity, int Stride>
class ReplayWindow {
  static_assert(Stride > 0 && Capacity >= 2 * Stride && Capacity % Stride == 0,
                "a window holds two strides or more, whole ones");

 public:
  /// How many events there are.
  [[nodiscard]] int size() const { return size_; }
  /// All of them, oldest first.
  [[nodiscard]] std::span<const Event> events() const { return first(size_); }
  /// The oldest `count`.
  [[nodiscard]] std::span<const Event> first(int count) const {
    return {events_.data(), static_cast<std::size_t>(count)};
  }
  /// One of them.
  [[nodiscard]] Event& operator[](int i) { return events_[static_cast<std::size_t>(i)]; }

  /// Puts an event after all those that are not later; the oldest stride makes room when there is
  /// none. Returns its place. O(Capacity) at worst, O(1) on average for the newest.
  int insert(const Event& event) {
    make_room();
    const auto later = [](std::int64_t time, const Event& e) { return time < e.time; };
    Event* const end = events_.data() + size_;
    Event* const place = std::upper_bound(events_.data(), end, event.time, later);
    std::move_backward(place, end, end + 1);
    *place = event;
    ++size_;
    return static_cast<int>(place - events_.data());
  }

  /// Whether `is_repeat(event, ·)` holds of one of its events, or of one of the last time before
  /// the last `restart`. O(log Capacity), and one question for each event of that time.
  template <class Same>
  [[nodiscard]] bool holds(const Event& event, const Same& is_repeat) const {
    const auto earlier = [](const Event& e, std::int64_t time) { return e.time < time; };
    const Event* const end = events_.data() + size_;
    const Event* at = std::lower_bound(events_.data(), end, event.time, earlier);
    for (; at != end && at->time == event.time; ++at) {
      if (is_repeat(event, *at)) return true;
    }
    return std::any_of(events_.end() - std::min(done_, Capacity - size_), events_.end(),
                       [&](const Event& e) { return is_repeat(event, e); });
  }
  /// Whether events were dropped since the last `restart`, or some of those that `holds` knew from
  /// before it.
  [[nodiscard]] bool forgot() const { return forgot_ || done_ > Capacity - size_; }

  /// Drops the oldest stride if there is no room for another event.
  void make_room() {
    if (size_ < Capacity) return;
    std::move(events_.begin() + Stride, events_.end(), events_.begin());
    std::move(snapshots_.begin() + 1, snapshots_.end(), snapshots_.begin());
    size_ -= Stride;
    forgot_ = true;
    done_ = 0;
  }

  /// Whether a snapshot is to be taken before event `i`.
  [[nodiscard]] static bool snaps(int i) { return i % Stride == 0; }
  /// The last place not after `i` that has one.
  [[nodiscard]] static int snap_before(int i) { return i - i % Stride; }
  /// The track before event `i`, a multiple of `Stride`.
  [[nodiscard]] Track& snapshot(int i) { return snapshots_[static_cast<std::size_t>(i / Stride)]; }

  /// Begins anew: what comes next is the first event.
  void restart() {
    int last = 0;  // how many share the last time; they move behind all others
    while (last < size_ && (*this)[size_ - 1 - last].time == (*this)[size_ - 1].time) ++last;
    std::move_backward(events_.begin() + (size_ - last), events_.begin() + size_, events_.end());
    done_ = last;
    size_ = 0;
    forgot_ = false;
  }

 private:
  std::array<Event, static_cast<std::size_t>(Capacity)> events_{};
  std::array<Track, static_cast<std::size_t>(Capacity / Stride)> snapshots_{};
  int size_ = 0;
  int done_ = 0;  // at the end of `events_`, until they are written over
  bool forgot_ = false;
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
