// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Where to take weighted sums about, before the weighted mean is known.

#include <limits>

namespace uwbpos {

/// Where sums of weighted points about o lose no digits when they are moved to the weighted mean:
/// at the plain mean, or at a point that outweighs the others.
template <class S, int N>
class SumOrigin {
 public:
  /// Notes `point`, whose weight is near 1/`price`. O(N).
  void add(const S (&point)[N], S price) {
    if (!(price >= least_)) {
      least_ = price;
#pragma GCC unroll 5
      for (int k = 0; k < N; ++k) heaviest_[k] = point[k];
    }
#pragma GCC unroll 5
    for (int k = 0; k < N; ++k) sum_[k] += point[k];
    prices_ += price;
  }
  /// o, of `count` points.
  void place(S (&origin)[N], S count) const {
    const bool outweighs = S(4) * count * least_ < prices_;
#pragma GCC unroll 5
    for (int k = 0; k < N; ++k) origin[k] = outweighs ? heaviest_[k] : sum_[k] / count;
  }

 private:
  S least_ = std::numeric_limits<S>::infinity();
  S heaviest_[N] = {};
  S sum_[N] = {};
  S prices_ = S(0);
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
