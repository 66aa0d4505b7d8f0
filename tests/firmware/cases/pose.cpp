// SPDX-License-Identifier: MIT
// Headings, poses, velocities, targets.
#include "uwbpos/accuracy/pose_bound.hpp"
#include "uwbpos/pose/target.hpp"
#include "uwbpos/pose/twist.hpp"
#include "uwbpos/pose/two_tag.hpp"
#include "uwbpos/solve/pose_from_ranges.hpp"

#include "bench.hpp"

namespace firmware::pose {

using namespace uwbpos;

namespace {

struct TwoTags {
  Fix<float, 2> left, right;
};

struct TwoPoses {
  Pose2<float> first, second;
};

#ifndef FIRMWARE_TARGET
Mat<float, 2> some_covariance(sim::Random& random) {
  const double a = random.uniform(1e-4, 4e-4);
  const double b = random.uniform(1e-4, 4e-4);
  const double ab = random.uniform(-0.5, 0.5) * std::sqrt(a * b);
  Mat<float, 2> covariance;
  covariance << to_float(a), to_float(ab), to_float(ab), to_float(b);
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
    const Vec<double, 2> at = point_in_room(random).head<2>();
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
      pose->position = point_in_room(random).head<2>().cast<float>();
      pose->heading = to_float(random.uniform(-3, 3));
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
struct PoseRecorded {
  static constexpr int kRounds = 5;
  using Input = std::array<TagRange<float, 3>, 24>;
  using Output = Result<PoseFix<float, 3>>;
  static Output run(const Input& in) { return solve_pose(in, {.side = {0, 0, -1}}); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random&, int round) {
    const std::vector<Row> rows = recorded("lias_mid");
    const std::vector<Row> anchors = recorded("lias_anchors");
    const std::vector<Row> tags = recorded("lias_tags");
    const auto point = [](const Row& row) {
      return Vec<float, 3>{to_float(row[1]), to_float(row[2]), to_float(row[3])};
    };
    for (std::size_t i = 0; i < in.size(); ++i) {
      const Row& row = rows[static_cast<std::size_t>(round) * 24 + i];
      in[i] = {point(tags[static_cast<std::size_t>(row[1])]),
               point(anchors[static_cast<std::size_t>(row[2])]), to_float(row[3]), 0.1f};
    }
  }
#endif
};
struct Known3d : Pose3d {
  static Output run(const Input& in) {
    return solve_pose(in,
                      {.heading = Measured<float>{0.3f, 1.0f}, .height = Measured<float>{3, 1}});
  }
};
struct PoseHuber : Pose2d {
  static constexpr int kRounds = 2;
  static Output run(const Input& in) { return solve_pose(in, {.robust = {Loss::Huber}}); }
};
struct Bound : Pose2d {
  using Output = Result<Mat<float, 3>>;
  static Output run(const Input& in) { return pose_bound(in, Vec<float, 2>{7, 6}, 0.5f); }
};
struct PoseRobust : Pose2d {
  static constexpr int kRounds = 2;
  static Output run(const Input& in) { return solve_pose(in, {.robust = {Loss::Cauchy}}); }
};

}  // namespace

#define POSE_CASES(X)                              \
  X(two_tag_pose_, Heading)                        \
  X(twist_between_, Twist)                         \
  X(bearing_to_, Bearing)                          \
  X(pose_from_ranges_2d_8, Pose2d)                 \
  X(pose_from_ranges_3d_12, Pose3d)                \
  X(pose_from_ranges_3d_24_recorded, PoseRecorded) \
  X(pose_from_ranges_3d_known, Known3d)            \
  X(pose_from_ranges_2d_huber, PoseHuber)          \
  X(pose_from_ranges_2d_cauchy, PoseRobust)        \
  X(pose_bound_2d_8, Bound)
FIRMWARE_UNIT(POSE_CASES)

}  // namespace firmware::pose
