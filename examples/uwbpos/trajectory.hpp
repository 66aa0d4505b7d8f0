// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Poses over time, and the true position of a tag at any time between them.

#include <optional>
#include <vector>

#include "uwbpos/core/types.hpp"

namespace uwbpos::host {

using Vec2 = Vec<double, 2>;
using Vec3 = Vec<double, 3>;

/// A unit quaternion; turns body coordinates into map coordinates.
struct Rotation {
  double x = 0;
  double y = 0;
  double z = 0;
  double w = 1;
};

/// v turned by q.
[[nodiscard]] Vec3 rotate(const Rotation& q, const Vec3& v);

/// The rotation a fraction in [0, 1] of the way along the shorter arc (Shoemake 1985).
[[nodiscard]] Rotation slerp(const Rotation& from, const Rotation& to, double fraction);

struct StampedPose {
  double t;  ///< [s]
  Vec3 position;
  Rotation rotation;
};

/// Poses by ascending time, no two at one time.
class Trajectory {
 public:
  Trajectory() = default;
  /// Sorts; of poses at one time keeps the first.
  explicit Trajectory(std::vector<StampedPose> poses);

  [[nodiscard]] bool empty() const { return poses_.empty(); }
  [[nodiscard]] const std::vector<StampedPose>& poses() const { return poses_; }

  /// The pose at time t: position linear, rotation by slerp between the two poses around t.
  /// Nothing outside the span of the poses.
  [[nodiscard]] std::optional<StampedPose> at(double t) const;

  /// Where a point of the body, given in body coordinates, is at time t.
  [[nodiscard]] std::optional<Vec3> point_at(double t, const Vec3& lever_arm) const;

  /// Time between the two poses around t [s], 0 outside the span.
  [[nodiscard]] double spacing_at(double t) const;

 private:
  std::vector<StampedPose> poses_;
};

}  // namespace uwbpos::host
