// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/solve/fsri.hpp"

#include "properties/laws.hpp"

namespace tests::properties_ultrasound {

using namespace uwbpos;
using test::Answer;
using test::Kind;
using test::Problem;
using test::Scene;

constexpr double kWave = 0.0086426;

// A tenth of a room, and at most one receiver late by a wave of its own.
std::optional<Problem> make(const Scene& scene, int dimension) {
  // Where the linear system leaves a second root the search has no end.
  if (scene.shape != test::Shape::General || scene.count > 7) return std::nullopt;
  auto p = test::make_spanned(scene, dimension, true);
  if (!p || scene.seed % 64 < 4) return p;
  const double lag = kWave * (1 + scene.heading / 3142.0);
  p->tag /= 10;
  for (std::size_t i = 0; i < p->places.size(); ++i) {
    p->places[i] /= 10;
    p->sigmas[i] = scene.stations[0].sigma * 1e-6;
    p->values[i] = (p->tag - p->places[i]).norm() + lag + test::noise_of(scene, i) * p->sigmas[i];
  }
  if (scene.count > dimension + 2 && scene.seed % 3 == 0) p->values[0] += kWave;
  return p;
}

struct Fsri {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    std::vector<Vec<S, D>> receivers;
    std::vector<S> lengths;
    for (const std::size_t i : p.order) {
      receivers.push_back(test::as<S, D>(p.places[i]));
      lengths.push_back(static_cast<S>(p.values[i]));
    }
    FsriOptions<S, D> options;
    options.wavelength = static_cast<S>(kWave) * static_cast<S>(p.unit);
    options.sigma = static_cast<S>(p.sigmas[0]);
    const auto shot = fsri(receivers, lengths, options);
    if (!shot) return std::unexpected(shot.error());
    Answer answer =
        test::fix_answer(Fix<S, D>{shot->position, shot->covariance.template topLeftCorner<D, D>(),
                                   shot->chi_squared, shot->degrees_of_freedom},
                         p);
    const auto variance = static_cast<double>(shot->covariance(D, D));
    answer.quantities.push_back({"lag", Kind::Number, 1, 0,
                                 test::padded(static_cast<double>(shot->lag)),
                                 test::kStop * std::sqrt(variance)});
    double repairs = 0;
    for (std::size_t k = 0; k < p.order.size(); ++k) {
      repairs += (shot->repair[k] + 8) * std::pow(17.0, static_cast<double>(p.order[k]));
    }
    answer.quantities.push_back({"repairs", Kind::Number, 0, 0, test::padded(repairs)});
    answer.quantities.push_back(
        {"ambiguous", Kind::Number, 0, 0, test::padded(shot->ambiguous ? 1 : 0)});
    return answer;
  }
};

TEST_CASE("ultrasound: what is done to the receivers is done to the emitter") {
  // Which waves are repaired depends on sigma.
  test::check_all<Fsri>("fsri", make,
                        {.laws = test::but(test::Law::Noise), .honest = false, .share = 0.25});
}

}  // namespace tests::properties_ultrasound
