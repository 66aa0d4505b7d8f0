// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/frames/fit_transform.hpp"
#include "uwbpos/frames/fuse_fixes.hpp"

#include "frames/scenes.hpp"
#include "properties/laws.hpp"

namespace tests::properties_frames {

using namespace uwbpos;
using test::Answer;
using test::Kind;
using test::Point;
using test::Problem;
using test::Scene;

/// Normals that belong to one station and its noise.
Point errors_of(const Scene& scene, std::size_t station, double sigma) {
  const int noise = scene.stations[station].noise;
  sim::Random random{static_cast<std::uint64_t>(1'000'000 + noise) * 64 + station};
  return test::random_normal<double, 3>(random, sigma);
}

/// Some rotation, about z in the plane.
Mat<double, 3> turn_from(int a, int b, int dimension) {
  const double yaw = a / 1000.0;
  Mat<double, 3> turn;
  turn << std::cos(yaw), -std::sin(yaw), 0, std::sin(yaw), std::cos(yaw), 0, 0, 0, 1;
  if (dimension == 2) return turn;
  Mat<double, 3> tilt;
  const double roll = b / 1000.0;
  tilt << 1, 0, 0, 0, std::cos(roll), -std::sin(roll), 0, std::sin(roll), std::cos(roll);
  return turn * tilt;
}

// Points of a room, and where they lie in the map; the true transform is turns[0] and tag.
std::optional<Problem> make_shared(const Scene& scene, int dimension) {
  Problem p;
  p.tag = Point(scene.tag.x, scene.tag.y, dimension == 3 ? scene.tag.z : 0) / 1000;
  p.turns = {turn_from(scene.heading, scene.arms[0].x, dimension)};
  for (std::size_t i = 0; i < static_cast<std::size_t>(scene.count); ++i) {
    const test::Station& s = scene.stations[i];
    Point place = Point(s.place.x, s.place.y, dimension == 3 ? s.place.z : 0) / 1000;
    if (scene.shape == test::Shape::InLine) place = Point(1, 2, dimension == 3 ? 3 : 0) * place[0];
    if (scene.shape == test::Shape::OnePoint) place = Point::Zero();
    Point error = errors_of(scene, i, s.sigma / 1000.0);
    if (dimension == 2) error[2] = 0;
    p.body.push_back(place);
    p.places.push_back(p.turns[0] * place + p.tag + error);
    p.sigmas.push_back(s.sigma / 1000.0);
    p.order.push_back(i);
  }
  if (scene.seed % 64 == 0) p.sigmas[0] = -1;
  if (scene.seed % 64 == 1) p.places[0][1] = std::numeric_limits<double>::quiet_NaN();
  return p;
}

template <int D>
std::vector<double> dense(const Mat<double, kTransformDof<D>>& c) {
  return {c.data(), c.data() + c.size()};
}

struct Fit {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    std::vector<SharedPoint<S, D>> points;
    for (const std::size_t i : p.order) {
      points.push_back(
          {test::as<S, D>(p.body[i]), test::as<S, D>(p.places[i]), static_cast<S>(p.sigmas[i])});
    }
    const auto fit = fit_transform(points);
    if (!fit) return std::unexpected(fit.error());
    const auto a_T_b = test::in_double(fit->a_T_b);
    constexpr int K = kTurnDof<D>;
    const auto& c = a_T_b.covariance;
    const double turn = c.template bottomRightCorner<K, K>().trace();
    double weight = 0;
    double reach = 0;
    for (std::size_t i = 0; i < p.body.size(); ++i) {
      reach = std::max(reach, p.body[i].norm());
      weight += p.body[i].squaredNorm() / (p.sigmas[i] * p.sigmas[i]);
    }
    const double condition = 4 * turn * weight;
    const Kind about = D == 2 ? Kind::Number : Kind::Tensor;
    const Kind between = D == 2 ? Kind::Vector : Kind::Tensor;
    Answer answer;
    answer.quantities = {
        {"translation", Kind::Place, 1, 0, test::padded(a_T_b.translation)},
        {"axes", Kind::Vector, 0, 0, test::padded(a_T_b.rotation), 0, 4},
        {"covariance of the translation", Kind::Tensor, 2, 2,
         test::padded(c.template topLeftCorner<D, D>()), 0, condition},
        {"covariance of the rotation", about, 0, 2,
         test::padded(c.template bottomRightCorner<K, K>()), 0, condition},
        {"between the two", between, 1, 2, test::padded(c.template topRightCorner<D, K>()), 0,
         condition},
        {"rms", Kind::Number, 1, 0, test::padded(static_cast<double>(fit->rms))},
        {"worst", Kind::Number, 1, 0, test::padded(static_cast<double>(fit->worst))},
        {"chi-squared", Kind::Number, 0, -2, test::padded(static_cast<double>(fit->chi_squared))},
        {"degrees of freedom", Kind::Number, 0, 0, test::padded(fit->degrees_of_freedom)}};
    const Transform<double, D> truth{p.turns[0].topLeftCorner<D, D>(), p.tag.head<D>()};
    const auto xi = test::error_of<D>(truth, a_T_b);
    answer.error.assign(xi.data(), xi.data() + xi.size());
    answer.covariance = dense<D>(c);
    answer.chi_squared = static_cast<double>(fit->chi_squared);
    answer.freedom = fit->degrees_of_freedom;
    return answer;
  }
};

constexpr double kArm = 20;  // a turn's deviation is that of a place over this [m]

// Up to four subnets at random places of a map, in random directions, that hear one tag.
std::optional<Problem> make_heard(const Scene& scene, int dimension) {
  Problem p;
  p.tag = Point(scene.tag.x, scene.tag.y, dimension == 3 ? scene.tag.z : 0) / 1000;
  const std::size_t count = 1 + static_cast<std::size_t>(scene.count) % 4;
  for (std::size_t i = 0; i < count; ++i) {
    const test::Station& s = scene.stations[i];
    const double sigma = s.sigma / 1000.0;
    const Point place = Point(s.place.x, s.place.y, dimension == 3 ? s.place.z : 0) / 1000;
    const Mat<double, 3> turn = turn_from(s.place.z, s.place.x, dimension);
    // The true transform departs from the known one, and the fix from the truth.
    const Point moved = errors_of(scene, i, sigma);
    Point theta = errors_of(scene, i + 4, sigma / kArm);
    if (dimension == 2) theta = {0, 0, theta[2]};
    Vec<double, 6> xi;
    xi << moved, theta;
    if (dimension == 2) xi[2] = 0;
    const Transform<double, 3> truth =
        test::perturbed<3>({.rotation = turn, .translation = place}, xi);
    Point error = errors_of(scene, i + 8, sigma);
    if (dimension == 2) error[2] = 0;
    error[0] *= 2;
    p.places.push_back(place);
    p.turns.push_back(turn);
    p.body.push_back(truth.rotation.transpose() * (p.tag - truth.translation) + error);
    p.sigmas.push_back(sigma);
    p.order.push_back(i);
  }
  if (scene.shape == test::Shape::OnePoint) p.sigmas[0] = -p.sigmas[0];
  return p;
}

struct Fuse {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    Subnets<S, D, 4> subnets;
    constexpr int K = kTurnDof<D>;
    for (std::size_t i = 0; i < p.places.size(); ++i) {
      const S sigma = static_cast<S>(p.sigmas[i]);
      const S turn = static_cast<S>(p.sigmas[i] / (kArm * p.unit));
      Transform<S, D> map_T_subnet;
      map_T_subnet.rotation = p.turns[i].topLeftCorner<D, D>().template cast<S>();
      map_T_subnet.translation = test::as<S, D>(p.places[i]);
      map_T_subnet.covariance.template topLeftCorner<D, D>().diagonal().setConstant(sigma * sigma);
      map_T_subnet.covariance.template bottomRightCorner<K, K>().diagonal().setConstant(turn *
                                                                                        turn);
      const auto id = static_cast<std::uint32_t>(i + 1);
      if (const auto added = subnets.add({id, id, map_T_subnet}); !added) {
        return std::unexpected(added.error());
      }
    }
    std::vector<SubnetFix<S, D>> fixes;
    for (const std::size_t i : p.order) {
      // A variance that is negative stays one.
      const S square = static_cast<S>(p.sigmas[i] * std::abs(p.sigmas[i]));
      Fix<S, D> fix{test::as<S, D>(p.body[i]), Mat<S, D>::Identity() * square, S(0), 0};
      fix.covariance(0, 0) *= S(4);
      fixes.push_back({static_cast<std::uint32_t>(i + 1), fix});
    }
    const auto fused = fuse_fixes<S, D, 4>(subnets, fixes);
    if (!fused) return std::unexpected(fused.error());
    Answer answer = test::fix_answer(fused->fix, p, 0);
    const auto add = [&](const char* name, int noise, double value) {
      answer.quantities.push_back({name, Kind::Number, 0, noise, test::padded(value), 0, 64});
    };
    // Of the covariances that meet.
    double squares = 0;
    double weights = 0;
    for (const double sigma : p.sigmas) {
      squares += 16 * sigma * sigma;  // at the end of its arm
      weights += 1 / (sigma * sigma);
    }
    answer.quantities[1].condition = squares * weights;
    // Of one fix alone it is rounding.
    answer.quantities[2].slack = 1e-6;
    add("disagreement", -2, static_cast<double>(fused->disagreement));
    answer.quantities.back().slack = 1e-6;
    add("heard", 0, fused->heard);
    add("fused", 0, fused->fused);
    add("leading", 0, fused->leading);
    double used = 0;
    for (std::size_t k = 0; k < p.order.size(); ++k) {
      if (fused->used[k]) used += std::ldexp(1.0, static_cast<int>(p.order[k]));
    }
    add("used", 0, used);
    answer.chi_squared = static_cast<double>(fused->fix.chi_squared);
    answer.freedom = fused->fix.degrees_of_freedom;
    return answer;
  }
};

TEST_CASE("frames: what is done to the map is done to transforms and fused fixes") {
  test::check_all<Fit>("fit_transform", make_shared);
  test::check_all<Fuse>("fuse_fixes", make_heard, {.gated = true});
}

}  // namespace tests::properties_frames
