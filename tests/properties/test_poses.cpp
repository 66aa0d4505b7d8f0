// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/accuracy/pose_bound.hpp"
#include "uwbpos/pose/target.hpp"
#include "uwbpos/pose/twist.hpp"
#include "uwbpos/pose/two_tag.hpp"
#include "uwbpos/solve/pose_from_ranges.hpp"

#include "properties/laws.hpp"

namespace tests::properties_poses {

using namespace uwbpos;
using test::Answer;
using test::Kind;
using test::Point;
using test::Problem;
using test::Quantity;
using test::Scene;

template <class S, int D>
std::vector<TagRange<S, D>> ranges_of(const Problem& p) {
  std::vector<TagRange<S, D>> all;
  for (const std::size_t k : p.order) {
    all.push_back({test::as<S, D>(p.body[k / p.places.size()]),
                   test::as<S, D>(p.places[k % p.places.size()]), static_cast<S>(p.values[k]),
                   static_cast<S>(p.sigmas[k])});
  }
  return all;
}

// Two tags at least 20 cm apart in plan, up to six stations; the bound, where there is one, below
// 0.5 m and 0.3 rad.
std::optional<Problem> make(const Scene& given, int dimension) {
  Scene scene = given;
  scene.count = std::min(scene.count, 6);
  // Every heading is tried where there is none: now and then.
  const bool hopeless = scene.shape == test::Shape::InLine || scene.shape == test::Shape::OnePoint;
  if (hopeless && scene.seed % 8 != 0) return std::nullopt;
  auto p = test::make_stations(scene, dimension, false);
  if (!p) return p;
  const double heading = scene.heading / 1000.0;
  const auto bad = p->values;
  p->angles = {heading};
  p->values.clear();
  p->order.clear();
  const auto sigmas = p->sigmas;
  p->sigmas.clear();
  for (std::size_t t = 0; t < 2; ++t) {
    const test::Place& arm = scene.arms[t];
    p->body.push_back(Point(arm.x, arm.y, dimension == 3 ? arm.z : 0) / 1000);
  }
  if ((p->body[0] - p->body[1]).head<2>().norm() < 0.2) return std::nullopt;
  std::vector<TagRange<double, 2>> plane;
  std::vector<TagRange<double, 3>> solid;
  for (const Point& arm : p->body) {
    const Point tag = p->tag + turned<double, 3>(turn_of(heading), arm);
    for (std::size_t i = 0; i < p->places.size(); ++i) {
      const double range = (tag - p->places[i]).norm();
      if (range < 0.5) return std::nullopt;
      const std::size_t k = p->values.size();
      p->order.push_back(k);
      p->sigmas.push_back(sigmas[i]);
      p->values.push_back(range + test::noise_of(scene, i, k / p->places.size()) * sigmas[i]);
      solid.push_back({arm, p->places[i], range, 0.1});
      plane.push_back({arm.head<2>(), p->places[i].head<2>(), range, 0.1});
    }
  }
  // What make_stations made a fault of.
  if (scene.seed % 64 < 2) p->values[0] = bad[0];
  // In line and in one point there need not be one.
  const auto judge = [&](const auto& bound) {
    if (!bound) return hopeless;
    const double turn = (*bound)(dimension, dimension);
    return turn < 0.1 && bound->trace() - turn < 0.25;
  };
  const bool sharp = dimension == 3 ? judge(pose_bound(solid, p->tag, heading))
                                    : judge(pose_bound(plane, p->tag.head<2>(), heading));
  if (2 * scene.count > dimension && scene.seed % 64 > 3 && !sharp) return std::nullopt;
  return p;
}

template <class S, int D, class Options>
Result<Answer> solved(const Problem& p, const Options& options) {
  const auto fix = solve_pose(ranges_of<S, D>(p), options);
  if (!fix) return std::unexpected(fix.error());
  const auto& pose = fix->pose;
  Answer answer =
      test::fix_answer(Fix<S, D>{pose.position, pose.covariance.template topLeftCorner<D, D>(),
                                 fix->chi_squared, fix->degrees_of_freedom},
                       p);
  const auto variance = static_cast<double>(pose.covariance(D, D));
  const double slack = 4 * test::kStop;
  const double condition = answer.quantities[1].condition;
  const double spread = std::sqrt(variance * static_cast<double>(pose.covariance.trace()));
  const Vec<S, D> mixed = pose.covariance.template topRightCorner<D, 1>();
  answer.quantities.push_back({"heading", Kind::Angle, 0, 0,
                               test::padded(static_cast<double>(pose.heading)),
                               test::kStop * std::sqrt(variance), 4});
  answer.quantities.push_back({"variance of the heading", Kind::Number, 0, 2,
                               test::padded(variance), slack * variance, condition});
  answer.quantities.push_back(
      {"covariance with it", Kind::Vector, 1, 2, test::padded(mixed), slack * spread, condition});
  answer.error.push_back(angle_difference(static_cast<double>(pose.heading), p.angles[0]));
  answer.covariance.clear();
  for (int i = 0; i < (D + 1) * (D + 1); ++i) {
    answer.covariance.push_back(static_cast<double>(pose.covariance(i)));
  }
  return answer;
}

struct FromRanges {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    return solved<S, D>(p, PoseOptions<S, D>{.side = test::as<S, D>(p.side)});
  }
};

struct Robust {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    PoseOptions<S, D> options{.side = test::as<S, D>(p.side)};
    options.robust.loss = Loss::Huber;
    return solved<S, D>(p, options);
  }
};

struct Bound {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const auto bound =
        pose_bound(ranges_of<S, D>(p), test::as<S, D>(p.tag), static_cast<S>(p.angles[0]));
    if (!bound) return std::unexpected(bound.error());
    const Mat<S, D> place = bound->template topLeftCorner<D, D>();
    const Vec<S, D> mixed = bound->template topRightCorner<D, 1>();
    // Rows are unit vectors and arms below a metre.
    double weight = 0;
    for (const double sigma : p.sigmas) weight += 2 * p.unit * p.unit / (sigma * sigma);
    const double condition = weight * static_cast<double>(bound->trace()) / (p.unit * p.unit);
    Answer answer;
    answer.quantities = {
        {"bound of the position", Kind::Tensor, 2, 2, test::padded(place), 0, condition},
        {"bound of the heading", Kind::Number, 0, 2,
         test::padded(static_cast<double>((*bound)(D, D))), 0, condition},
        {"between the two", Kind::Vector, 1, 2, test::padded(mixed), 0, condition}};
    return answer;
  }
};

// Two tags 0.6 m apart across the front of a robot, each with an error ellipse of its own.
std::optional<Problem> make_two_tags(const Scene& scene, int) {
  Problem p;
  p.tag = Point(scene.tag.x, scene.tag.y, 0) / 1000;
  p.angles = {scene.heading / 1000.0};
  for (std::size_t k = 0; k < 2; ++k) {
    const test::Station& s = scene.stations[k];
    const auto ellipse = turn_of(s.place.x / 1000.0);
    Mat<double, 3> axes = Mat<double, 3>::Identity();
    axes.topLeftCorner<2, 2>() << ellipse.cosine, -ellipse.sine, ellipse.sine, ellipse.cosine;
    p.turns.push_back(axes);
    p.sigmas.push_back(s.sigma / 1000.0);
    p.sigmas.push_back(s.sigma / 3000.0);
    const Point noise{p.sigmas[2 * k] * test::noise_of(scene, k),
                      p.sigmas[2 * k + 1] * test::noise_of(scene, k, 1), 0};
    p.places.push_back(p.tag +
                       turned<double, 3>(turn_of(p.angles[0]), Point(0, k == 0 ? 0.3 : -0.3, 0)) +
                       axes * noise);
  }
  if (scene.shape == test::Shape::OnePoint) p.places[1] = p.places[0];
  if (scene.shape == test::Shape::InLine) p.places[1] += Point(5, 5, 0);
  return p;
}

/// The covariance of a planar pose, by its blocks.
void add_planar(Answer& answer, const Mat<double, 3>& c, Kind place, Kind mixed) {
  answer.quantities.push_back(
      {"covariance", place, 2, 2, test::padded(c.topLeftCorner<2, 2>()), 0, 16});
  // Differences of what the tags have.
  answer.quantities.push_back({"covariance with the turn", mixed, 1, 2,
                               test::padded(c.topRightCorner<2, 1>()),
                               1e-6 * std::sqrt(c(2, 2) * c.topLeftCorner<2, 2>().trace())});
  answer.quantities.push_back(
      {"variance of the turn", Kind::Number, 0, 2, test::padded(c(2, 2)), 0, 16});
}

struct TwoTags {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    Fix<S, 2> fixes[2];
    for (std::size_t k = 0; k < 2; ++k) {
      const Mat<double, 2> axes = p.turns[k].topLeftCorner<2, 2>();
      const Vec<double, 2> squares{p.sigmas[2 * k] * p.sigmas[2 * k],
                                   p.sigmas[2 * k + 1] * p.sigmas[2 * k + 1]};
      const Mat<double, 2> covariance = axes * squares.asDiagonal() * axes.transpose();
      fixes[k] = {test::as<S, 2>(p.places[k]), covariance.template cast<S>(), S(0), 0};
      fixes[k].covariance(0, 1) = fixes[k].covariance(1, 0);
    }
    const auto pose = two_tag_pose(fixes[0], fixes[1], static_cast<S>(0.6 * p.unit));
    if (!pose) return std::unexpected(pose.error());
    const Mat<double, 3> c = pose->covariance.template cast<double>();
    Answer answer;
    answer.quantities = {
        {"centre", Kind::Place, 1, 0, test::padded(pose->position)},
        {"heading", Kind::Angle, 0, 0, test::padded(static_cast<double>(pose->heading)), 0, 4}};
    add_planar(answer, c, Kind::Tensor, Kind::Vector);
    answer.error = {static_cast<double>(pose->position[0]) - p.tag[0],
                    static_cast<double>(pose->position[1]) - p.tag[1],
                    angle_difference(static_cast<double>(pose->heading), p.angles[0])};
    answer.covariance.assign(c.data(), c.data() + 9);
    return answer;
  }
};

// Two poses, the second also a target; deviations of the headings as those of an arm of a metre.
std::optional<Problem> make_two_poses(const Scene& scene, int dimension) {
  auto p = make_two_tags(scene, dimension);
  p->angles.push_back(wrap_angle(scene.arms[0].x / 100.0));
  return p;
}

template <class S>
Pose2<S> pose_of(const Problem& p, std::size_t k) {
  const Mat<double, 2> axes = p.turns[k].topLeftCorner<2, 2>();
  const Vec<double, 2> squares{p.sigmas[2 * k] * p.sigmas[2 * k],
                               p.sigmas[2 * k + 1] * p.sigmas[2 * k + 1]};
  const double turn = p.sigmas[2 * k] / p.unit;
  Mat<double, 3> c = Mat<double, 3>::Zero();
  c.topLeftCorner<2, 2>() = axes * squares.asDiagonal() * axes.transpose();
  c(0, 1) = c(1, 0);
  c(2, 2) = turn * turn;
  return {test::as<S, 2>(p.places[k]), static_cast<S>(p.angles[k]), c.template cast<S>()};
}

struct Twist {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const auto twist = twist_between(pose_of<S>(p, 0), pose_of<S>(p, 1), S(0.25));
    if (!twist) return std::unexpected(twist.error());
    Answer answer;
    answer.quantities = {
        {"velocity", Kind::Vector, 1, 0, test::padded(twist->global_velocity)},
        {"body velocity", Kind::Number, 1, 0, test::padded(twist->body_velocity), 0, 4},
        // The angles are rounded when they are turned.
        {"turn rate", Kind::Number, 0, 0, test::padded(static_cast<double>(twist->turn_rate)),
         4 * static_cast<double>(std::numeric_limits<S>::epsilon()) * 16}};
    add_planar(answer, twist->global_covariance.template cast<double>(), Kind::Tensor,
               Kind::Vector);
    add_planar(answer, twist->body_covariance.template cast<double>(), Kind::Number, Kind::Number);
    return answer;
  }
};

struct Bearing {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const auto seen = bearing_to(pose_of<S>(p, 0), test::as<S, 2>(p.places[1]));
    if (!seen) return std::unexpected(seen.error());
    Answer answer;
    answer.quantities = {
        {"distance", Kind::Number, 1, 0, test::padded(static_cast<double>(seen->distance))},
        {"sine of the bearing", Kind::Number, 0, 0,
         test::padded(std::sin(static_cast<double>(seen->bearing))),
         16 * static_cast<double>(std::numeric_limits<S>::epsilon())},
        {"variance of the distance", Kind::Number, 2, 2,
         test::padded(static_cast<double>(seen->distance_variance)), 0, 16},
        {"variance of the bearing", Kind::Number, 0, 2,
         test::padded(static_cast<double>(seen->bearing_variance)), 0, 16}};
    return answer;
  }
};

TEST_CASE("poses: what is done to the anchors is done to the pose") {
  test::check_all<FromRanges>("solve_pose", make, {.level = true, .share = 0.5});
  // Where a residual passes from the middle to the wings depends on its sigma.
  test::check_all<Robust, 2, 2>(
      "solve_pose, Huber", make,
      {.laws = test::but(test::Law::Noise), .level = true, .honest = false, .share = 0.25});
  test::check_all<Bound>("pose_bound", make, {.level = true, .honest = false});
}

TEST_CASE("two tags, twists and targets: what is done to the map is done to them") {
  constexpr unsigned kLaws = test::but(test::Law::Permutation);
  test::check_all<TwoTags, 2, 2>("two_tag_pose", make_two_tags, {.laws = kLaws, .gated = true});
  test::check_all<Twist, 2, 2>("twist_between", make_two_poses, {.laws = kLaws, .honest = false});
  test::check_all<Bearing, 2, 2>("bearing_to", make_two_poses, {.laws = kLaws, .honest = false});
}

}  // namespace tests::properties_poses
