// SPDX-License-Identifier: MIT
#include <array>
#include <numbers>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/pose/two_tag.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/pose_from_ranges.hpp"

#include "pose/scenes.hpp"
#include "support/nees.hpp"
#include "support/statistics.hpp"

namespace tests::solve_pose_efficiency {

using namespace uwbpos;

namespace {

constexpr double kBaseline = 0.6;

// Mean squared errors over the bound's, on average over a grid.
struct Ratios {
  double position = 0;
  double heading = 0;
};

struct Sample {
  double position = 0;  // sums of squares above the bound's
  double heading = 0;
};

// Adds the squared errors of a pose, less what the same noise does to an estimate that is linear in
// it and at the bound, J⁻¹ Σ G e/σ²: what is left scatters some ten times less, and its mean is how
// much the pose is worse than the bound.
void add(Sample& sample, const Pose2<double>& pose, const Vec<double, 3>& linear,
         const test::Scene<double, 2>& scene) {
  sample.position += squared_norm<double, 2>(pose.position - scene.position) -
                     squared_norm<double, 2>(linear.head<2>());
  const double turn = angle_difference(pose.heading, scene.heading);
  sample.heading += turn * turn - linear[2] * linear[2];
}

Vec<double, 3> linear_error(const test::Scene<double, 2>& scene,
                            const std::vector<TagRange<double, 2>>& noisy,
                            const Mat<double, 3>& bound) {
  Vec<double, 3> sum = Vec<double, 3>::Zero();
  for (std::size_t i = 0; i < noisy.size(); ++i) {
    const auto& r = noisy[i];
    const auto at =
        predict_tag_range<double, 2>(scene.position, turn_of(scene.heading), r.lever_arm, r.anchor);
    const double pull = (r.range - scene.ranges[i].range) / (r.sigma * r.sigma);
    sum += pull * Vec<double, 3>{at.gradient[0], at.gradient[1], at.heading_gradient};
  }
  return bound * sum;
}

// A fix per tag, then the arctangent.
Pose2<double> two_steps(const std::vector<TagRange<double, 2>>& ranges) {
  std::array<Fix<double, 2>, 2> fixes;
  const std::size_t half = ranges.size() / 2;
  for (std::size_t tag = 0; tag < 2; ++tag) {
    std::vector<RangeTo<double, 2>> of_tag;
    for (std::size_t i = tag * half; i < (tag + 1) * half; ++i) {
      of_tag.push_back({ranges[i].anchor, ranges[i].range, ranges[i].sigma});
    }
    const auto fix = locate(of_tag);
    REQUIRE(fix);
    fixes[tag] = *fix;
  }
  const auto pose = two_tag_pose(fixes[0], fixes[1], kBaseline);
  REQUIRE(pose);
  return *pose;
}

// σ = 0.1 m, a grid of 5 × 5 over a hall of 10 m × 8 m to half a metre of its walls, 8 headings.
void check_hall(const char* name, const std::vector<Vec<double, 2>>& anchors, int draws) {
  sim::Random random{name};
  const std::vector<Vec<double, 2>> arms{{0, kBaseline / 2}, {0, -kBaseline / 2}};
  Ratios joint;
  Ratios steps;
  double nees = 0;
  double worst_gain = 0;
  Vec<double, 2> where = Vec<double, 2>::Zero();
  int cells = 0;
  int refused = 0;
  for (int i = 0; i < 5; ++i) {
    for (int j = 0; j < 5; ++j) {
      for (int k = 0; k < 8; ++k) {
        test::Scene<double, 2> scene{
            {0.5 + 9 * i / 4.0, 0.5 + 7 * j / 4.0}, (k - 3.5) * std::numbers::pi / 4, {}};
        scene.ranges = test::tag_ranges(scene.position, scene.heading, arms, anchors);
        const auto bound = pose_bound(scene.ranges, scene.position, scene.heading);
        REQUIRE(bound);
        Sample of_joint;
        Sample of_steps;
        for (int draw = 0; draw < draws; ++draw) {
          const auto ranges = test::noisy<double, 2>(random, scene.ranges);
          const auto pose = pose_from_ranges(ranges);
          if (!pose) {
            CHECK(pose.error() == Error::AmbiguousSolution);
            ++refused;
            continue;
          }
          const Vec<double, 3> linear = linear_error(scene, ranges, *bound);
          add(of_joint, *pose, linear, scene);
          add(of_steps, two_steps(ranges), linear, scene);
          const Vec<double, 3> estimate{
              pose->position[0], pose->position[1],
              scene.heading + angle_difference(pose->heading, scene.heading)};
          nees += test::normalised_squared_error<double, 3>(
              estimate, pose->covariance, {scene.position[0], scene.position[1], scene.heading});
        }
        const double place = (*bound)(0, 0) + (*bound)(1, 1);
        const double turn = (*bound)(2, 2);
        joint.position += 1 + of_joint.position / draws / place;
        joint.heading += 1 + of_joint.heading / draws / turn;
        steps.position += 1 + of_steps.position / draws / place;
        steps.heading += 1 + of_steps.heading / draws / turn;
        const double gain =
            (1 + of_steps.heading / draws / turn) / (1 + of_joint.heading / draws / turn);
        if (gain > worst_gain) {
          worst_gain = gain;
          where = scene.position;
        }
        ++cells;
      }
    }
  }
  const double n = cells;
  nees /= n * draws - refused;
  // Half a metre from an anchor noise may leave two headings some 60° apart.
  CHECK(refused <= n * draws / 5000);
  MESSAGE(std::string{name}, ": squared error over the bound, all at once: position ",
          joint.position / n, ", heading ", joint.heading / n,
          "; a fix per tag and the arctangent: position ", steps.position / n, ", heading ",
          steps.heading / n, "; the most that heading gains from the joint solution is a factor ",
          worst_gain, " in its square, at (", where[0], ", ", where[1], "); NEES ", nees);
  // What is above one is the second order of the noise: headings scatter by 10° and more.
  CHECK(joint.position / n <= 1.05);
  CHECK(joint.heading / n <= 1.05);
  // Jointly the pose is never worse, on average, than step by step.
  CHECK(joint.heading <= steps.heading);
  CHECK(nees == doctest::Approx(3).epsilon(0.03));
}

}  // namespace

TEST_CASE("poses reach the bound over a hall and all headings: 4 anchors") {
  check_hall("pose, 4 anchors", {{0, 0}, {10, 0}, {10, 8}, {0, 8}}, 60);
}

TEST_CASE("poses reach the bound over a hall and all headings: 8 anchors") {
  check_hall("pose, 8 anchors", {{0, 0}, {5, 0}, {10, 0}, {10, 4}, {10, 8}, {5, 8}, {0, 8}, {0, 4}},
             60);
}

}  // namespace tests::solve_pose_efficiency
