// SPDX-License-Identifier: MIT
#include "trajectory.hpp"

#include <algorithm>
#include <cmath>

namespace uwbpos::host {
namespace {

Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y() * b.z() - a.z() * b.y(), a.z() * b.x() - a.x() * b.z(),
          a.x() * b.y() - a.y() * b.x()};
}

}  // namespace

Vec3 rotate(const Rotation& q, const Vec3& v) {
  const Vec3 u{q.x, q.y, q.z};
  const Vec3 twice = 2 * cross(u, v);
  return v + q.w * twice + cross(u, twice);
}

Rotation slerp(const Rotation& from, const Rotation& to, double fraction) {
  double cosine = from.x * to.x + from.y * to.y + from.z * to.z + from.w * to.w;
  const double sign = cosine < 0 ? -1 : 1;
  cosine = std::min(std::abs(cosine), 1.0);
  double a = 1 - fraction;
  double b = fraction;
  constexpr double nearly_equal = 1 - 1e-9;
  if (cosine < nearly_equal) {
    const double angle = std::acos(cosine);
    a = std::sin(a * angle) / std::sin(angle);
    b = std::sin(b * angle) / std::sin(angle);
  }
  b *= sign;
  Rotation q{a * from.x + b * to.x, a * from.y + b * to.y, a * from.z + b * to.z,
             a * from.w + b * to.w};
  const double norm = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  return {q.x / norm, q.y / norm, q.z / norm, q.w / norm};
}

Trajectory::Trajectory(std::vector<StampedPose> poses) : poses_{std::move(poses)} {
  std::ranges::stable_sort(poses_,
                           [](const StampedPose& a, const StampedPose& b) { return a.t < b.t; });
  const auto same = std::ranges::unique(
      poses_, [](const StampedPose& a, const StampedPose& b) { return a.t == b.t; });
  poses_.erase(same.begin(), same.end());
}

std::optional<StampedPose> Trajectory::at(double t) const {
  if (poses_.empty() || !(t >= poses_.front().t) || !(t <= poses_.back().t)) return std::nullopt;
  const auto after = std::ranges::lower_bound(poses_, t, {}, &StampedPose::t);
  if (after->t == t) return *after;
  const StampedPose& before = *(after - 1);
  const double span = after->t - before.t;
  const double fraction = std::isfinite(span)
                              ? (t - before.t) / span
                              : (t / 2 - before.t / 2) / (after->t / 2 - before.t / 2);
  Vec3 position;
  for (int k = 0; k < 3; ++k) {
    position[k] = std::lerp(before.position[k], after->position[k], fraction);
  }
  return StampedPose{t, position, slerp(before.rotation, after->rotation, fraction)};
}

std::optional<Vec3> Trajectory::point_at(double t, const Vec3& lever_arm) const {
  const auto pose = at(t);
  if (!pose) return std::nullopt;
  return pose->position + rotate(pose->rotation, lever_arm);
}

double Trajectory::spacing_at(double t) const {
  if (!at(t)) return 0;
  const auto after = std::ranges::lower_bound(poses_, t, {}, &StampedPose::t);
  return after->t == t ? 0 : after->t - (after - 1)->t;
}

}  // namespace uwbpos::host
