// SPDX-License-Identifier: MIT
// Headings, poses, velocities, targets.
#include "uwbpos/pose/target.hpp"
#include "uwbpos/pose/twist.hpp"
#include "uwbpos/pose/two_tag.hpp"
#include "uwbpos/solve/pose_from_ranges.hpp"

#include "cases/entries.hpp"

namespace uwbpos {

template <class Words, int D>
void transfer(Words& words, PoseFix<float, D>& f) {
  firmware::transfer_all(words, f.pose, f.chi_squared, f.degrees_of_freedom);
}
template <class Words>
void transfer(Words& words, Twist2<float>& t) {
  firmware::transfer_all(words, t.global_velocity, t.body_velocity, t.turn_rate,
                         t.global_covariance, t.body_covariance);
}
template <class Words>
void transfer(Words& words, Target<float>& t) {
  firmware::transfer_all(words, t.distance, t.bearing, t.ahead, t.distance_variance,
                         t.bearing_variance);
}

}  // namespace uwbpos

namespace {

using namespace uwbpos;

struct TwoTags {
  Fix<float, 2> left, right;
};

template <class Words>
void transfer(Words& words, TwoTags& t) {
  firmware::transfer_all(words, t.left, t.right);
}

struct TwoPoses {
  Pose2<float> first, second;
};

template <class Words>
void transfer(Words& words, TwoPoses& p) {
  firmware::transfer_all(words, p.first, p.second);
}

#ifndef FIRMWARE_TARGET
Mat<float, 2> some_covariance(sim::Random& random) {
  const double a = random.uniform(1e-4, 4e-4);
  const double b = random.uniform(1e-4, 4e-4);
  const double ab = random.uniform(-0.5, 0.5) * std::sqrt(a * b);
  Mat<float, 2> covariance;
  covariance << firmware::to_float(a), firmware::to_float(ab), firmware::to_float(ab),
      firmware::to_float(b);
  return covariance;
}
#endif

struct Heading {
  static constexpr int kRounds = 20;
  using Input = TwoTags;
  using Output = Result<Pose2<float>>;
  static Output run(const Input& in) { return two_tag_pose(in.left, in.right, 0.6f); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    const Vec<double, 2> at = firmware::point_in_room(random).head<2>();
    const double angle = random.uniform(-std::numbers::pi, std::numbers::pi);
    const Vec<double, 2> arm{-0.3 * std::sin(angle), 0.3 * std::cos(angle)};
    const auto fix = [&](const Vec<double, 2>& place) {
      const Vec<double, 2> noisy =
          place + Vec<double, 2>{random.normal(0, 0.01), random.normal(0, 0.01)};
      return Fix<float, 2>{noisy.cast<float>(), some_covariance(random), 1.0f, 2};
    };
    in.left = fix(at + arm);
    in.right = fix(at - arm);
  }
#endif
};

struct Twist {
  static constexpr int kRounds = 20;
  using Input = TwoPoses;
  using Output = Result<Twist2<float>>;
  static Output run(const Input& in) { return twist_between(in.first, in.second, 0.1f); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    for (Pose2<float>* pose : {&in.first, &in.second}) {
      pose->position = firmware::point_in_room(random).head<2>().cast<float>();
      pose->heading = firmware::to_float(random.uniform(-3, 3));
      pose->covariance.setZero();
      pose->covariance.topLeftCorner<2, 2>() = some_covariance(random);
      pose->covariance(2, 2) = 1e-3f;
    }
  }
#endif
};

struct Bearing : Twist {
  using Output = Result<Target<float>>;
  static Output run(const Input& in) { return bearing_to(in.first, in.second.position); }
};

struct Pose2d {
  static constexpr int kRounds = 10;
  using Input = std::array<TagRange<float, 2>, 8>;
  using Output = Result<PoseFix<float, 2>>;
  static Output run(const Input& in) { return solve_pose(in); }
};
struct Pose3d {
  static constexpr int kRounds = 5;
  using Input = std::array<TagRange<float, 3>, 12>;
  using Output = Result<PoseFix<float, 3>>;
  static Output run(const Input& in) { return solve_pose(in); }
};
struct PoseRobust : Pose2d {
  static constexpr int kRounds = 2;
  static Output run(const Input& in) { return solve_pose(in, {.robust = {Loss::Cauchy}}); }
};

}  // namespace

FIRMWARE_FUNCTION(two_tag_pose_, Heading)
FIRMWARE_FUNCTION(twist_between_, Twist)
FIRMWARE_FUNCTION(bearing_to_, Bearing)
FIRMWARE_FUNCTION(pose_from_ranges_2d_8, Pose2d)
FIRMWARE_FUNCTION(pose_from_ranges_3d_12, Pose3d)
FIRMWARE_FUNCTION(pose_from_ranges_2d_cauchy, PoseRobust)

std::span<const firmware::Entry> firmware::pose_entries() {
  static constexpr Entry kEntries[] = {FIRMWARE_ENTRY(two_tag_pose_, Heading),
                                       FIRMWARE_ENTRY(twist_between_, Twist),
                                       FIRMWARE_ENTRY(bearing_to_, Bearing),
                                       FIRMWARE_ENTRY(pose_from_ranges_2d_8, Pose2d),
                                       FIRMWARE_ENTRY(pose_from_ranges_3d_12, Pose3d),
                                       FIRMWARE_ENTRY(pose_from_ranges_2d_cauchy, PoseRobust)};
  return kEntries;
}
