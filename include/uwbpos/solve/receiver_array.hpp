// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Receivers that hang on a bar or a plate cannot tell an emitter from its mirror image. This finds
/// the mirror, and says which side of it is meant.

#include <cmath>
#include <span>

#include "uwbpos/solve/mirror_choice.hpp"
#include "uwbpos/solve/weak_line.hpp"

namespace uwbpos {

/// Whether receivers are flat (in line in the plane, in a plane in space) to a twentieth of their
/// extent, and the direction across: a unit vector towards the emitter.
template <class S, int D>
struct ReceiverArray {
  Vec<S, D> center;  ///< mean of the receivers [m]
  Vec<S, D> normal;  ///< across the receivers, towards the emitter
  bool flat;         ///< one image lies behind a mirror

  /// Looks at checked receivers. Where both sides are open, `options.side` tells, else the prior,
  /// else the emitter is taken to be where the last coordinate that can tell is greater: y > 0 for
  /// a bar along x, z > 0 for a level plate. O(n·D² + n²), no allocation.
  /// Error::DegenerateGeometry: two receivers coincide, or all are in line in space.
  [[nodiscard]] static Result<ReceiverArray> make(std::span<const Vec<S, D>> receivers,
                                                  const LocateOptions<S, D>& options) {
    ReceiverArray array;
    array.center = Vec<S, D>::Zero();
    for (const Vec<S, D>& a : receivers) array.center += a - receivers.front();
    array.center /= static_cast<S>(receivers.size());
    Mat<S, D> scatter = Mat<S, D>::Zero();
    for (const Vec<S, D>& a : receivers) {
      add_outer<S, D>(scatter, (a - receivers.front()) - array.center, S(1));
    }
    array.center += receivers.front();
    const S extent = scatter.trace();
    for (std::size_t i = 0; i < receivers.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const S apart = squared_norm<S, D>(receivers[i] - receivers[j]);
        if (!(apart > S(1e-8) * extent)) return std::unexpected(Error::DegenerateGeometry);
      }
    }
    const Result<WeakLine<S, D>> line = weak_line<S, D>(scatter, Vec<S, D>::Zero());
    if (!line) return std::unexpected(line.error());
    array.normal = line->direction;
    array.flat = line->information <= S(0.05 * 0.05) * extent;
    S sign = S(1);
    for (int k = 0; k < D; ++k) {
      if (std::abs(array.normal[k]) > S(1e-3)) sign = std::copysign(S(1), array.normal[k]);
    }
    array.normal *= sign;
    const Vec<S, D> ahead = array.center + array.normal;
    const Vec<S, D> behind = array.center - array.normal;
    if (choose_by_knowledge<S, D>(ahead, behind, options) == MirrorChoice::Second) {
      array.normal = -array.normal;
    }
    return array;
  }
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
