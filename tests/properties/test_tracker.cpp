// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/filter/motion/constant_velocity.hpp"
#include "uwbpos/filter/tracker.hpp"

#include "properties/laws.hpp"

namespace tests::properties_tracker {

using namespace uwbpos;
using test::Answer;
using test::Kind;
using test::Point;
using test::Problem;
using test::Scene;

constexpr std::size_t kMost = 60;   // measurements; the tracker remembers 64
constexpr std::size_t kFirst = 30;  // come in their order

// Ranges to at least six stations in turn, 20 ms apart, from a tag that moves at 0.5 m/s.
std::optional<Problem> make(const Scene& given, int dimension) {
  Scene scene = given;
  if (scene.shape != test::Shape::General || scene.count < 6) return std::nullopt;
  scene.seed |= 32;
  auto p = test::make_stations(scene, dimension, false);
  if (!p) return p;
  const Point speed{0.5 * std::cos(scene.heading / 1000.0), 0.5 * std::sin(scene.heading / 1000.0),
                    0};
  p->values.clear();
  p->order.clear();
  for (std::size_t k = 0; k < kMost; ++k) {
    const std::size_t i = k % p->places.size();
    const Point at = p->tag + 0.02 * static_cast<double>(k) * speed;
    const double noise = test::noise_of(scene, i, k / p->places.size());
    p->values.push_back((at - p->places[i]).norm() + noise * p->sigmas[i]);
    p->order.push_back(k);
  }
  return p;
}

struct Follow {
  // Later measurements in any order: what is remembered is put where it belongs.
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    Tracker<ConstantVelocity<S, D>> tracker;
    for (std::size_t i = 0; i < p.places.size(); ++i) {
      const auto id = static_cast<std::uint32_t>(i);
      if (const auto added = tracker.add_anchor(id, test::as<S, 3>(p.places[i])); !added) {
        return std::unexpected(added.error());
      }
    }
    int used = 0;
    const auto hear = [&](std::size_t k) {
      const std::size_t i = k % p.places.size();
      const auto told =
          tracker.update(TimedRange<S>{.time = 1'000'000 + 20'000 * static_cast<std::int64_t>(k),
                                       .anchor = static_cast<std::uint32_t>(i),
                                       .range = static_cast<S>(p.values[k]),
                                       .sigma = static_cast<S>(p.sigmas[i])});
      if (told) ++used;
    };
    for (std::size_t k = 0; k < kFirst; ++k) hear(k);
    for (const std::size_t k : p.order) {
      if (k >= kFirst) hear(k);
    }
    const auto pose = tracker.pose();
    if (!pose) return std::unexpected(pose.error());
    const Mat<S, D> place = pose->covariance.template topLeftCorner<D, D>();
    const Mat<S, D> moving = pose->covariance.template bottomRightCorner<D, D>();
    const auto slack = [](const Mat<S, D>& c) {
      return test::kStop * std::sqrt(static_cast<double>(c.trace()));
    };
    // It began where an iteration stopped.
    Answer answer;
    answer.quantities = {
        {"position", Kind::Place, 1, 0, test::padded(pose->position), slack(place)},
        {"velocity", Kind::Vector, 1, 0, test::padded(pose->velocity), slack(moving)},
        {"covariance", Kind::Tensor, 2, 2, test::padded(place),
         test::kStop * static_cast<double>(place.trace()), 100},
        {"covariance of the velocity", Kind::Tensor, 2, 2, test::padded(moving),
         test::kStop * static_cast<double>(moving.trace()), 100},
        {"used", Kind::Number, 0, 0, test::padded(used)}};
    return answer;
  }
};

TEST_CASE("tracker: what is done to the map is done to the track, and order means nothing") {
  // Its motion has a scale of its own.
  constexpr unsigned kLaws = test::but(test::Law::Scale, test::but(test::Law::Noise));
  test::check_all<Follow, 2, 2>("tracker", make,
                                {.laws = kLaws, .level = true, .honest = false, .share = 0.3});
}

}  // namespace tests::properties_tracker
