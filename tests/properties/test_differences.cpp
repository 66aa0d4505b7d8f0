// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/solve/bancroft.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/tdoa_chan.hpp"
#include "uwbpos/solve/tdoa_fang.hpp"

#include "properties/laws.hpp"

namespace tests::properties_differences {

using namespace uwbpos;
using test::Answer;
using test::Kind;
using test::Problem;
using test::Scene;

template <class S, int D>
std::vector<RangeTo<S, D>> pseudoranges_of(const Problem& p) {
  std::vector<RangeTo<S, D>> all;
  for (const std::size_t i : p.order) {
    all.push_back(
        {test::as<S, D>(p.places[i]), static_cast<S>(p.values[i]), static_cast<S>(p.sigmas[i])});
  }
  return all;
}

// Against the station that comes first; of `fixed` always against the same.
template <class S, int D>
struct Differences {
  Vec<S, D> reference;
  std::vector<DifferenceTo<S, D>> all;
  S sigma;

  explicit Differences(const Problem& p, bool fixed)
      : reference{test::as<S, D>(p.places[fixed ? 0 : p.order[0]])},
        sigma{static_cast<S>(p.sigmas[0])} {
    const std::size_t from = fixed ? 0 : p.order[0];
    for (const std::size_t i : p.order) {
      if (i == from) continue;
      all.push_back({test::as<S, D>(p.places[i]),
                     static_cast<S>(p.values[i]) - static_cast<S>(p.values[from])});
    }
  }
};

template <class S, int D>
LocateOptions<S, D> options_of(const Problem& p) {
  return {.side = test::as<S, D>(p.side)};
}

std::optional<Problem> make(const Scene& scene, int dimension) {
  return test::make_stations(scene, dimension, true);
}

// Values are differences round a ring of stations, each with its own noise.
std::optional<Problem> make_ring(const Scene& scene, int dimension) {
  // Hundreds of descents find out that there is none: now and then.
  const bool hopeless = scene.shape == test::Shape::InLine ||
                        scene.shape == test::Shape::OnePoint || scene.count <= dimension;
  if (hopeless && scene.seed % 8 != 0) return std::nullopt;
  Scene sound = scene;
  sound.seed |= 32;
  auto p = test::make_stations(sound, dimension, true);
  if (!p) return p;
  const std::size_t n = p->places.size();
  for (std::size_t i = 0; i < n; ++i) {
    const test::Point& a = p->places[i];
    const test::Point& b = p->places[(i + 1) % n];
    p->sigmas[i] = scene.stations[i].sigma / 1000.0;
    p->values[i] =
        (p->tag - b).norm() - (p->tag - a).norm() + test::noise_of(scene, i) * p->sigmas[i];
  }
  if (scene.seed % 64 == 1) p->values[0] = std::numeric_limits<double>::quiet_NaN();
  if (scene.seed % 64 == 2) p->sigmas[0] = 0;
  return p;
}

std::optional<Problem> make_spanned(const Scene& scene, int dimension) {
  return test::make_spanned(scene, dimension, true);
}

std::optional<Problem> make_fewest(const Scene& scene, int dimension) {
  Scene fewer = scene;
  if (fewer.count > dimension) fewer.count = dimension + 1;
  return test::make_stations(fewer, dimension, true);
}

struct SharedReference {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const Differences<S, D> d{p, false};
    const auto fix = locate(d.reference, d.all, d.sigma, options_of<S, D>(p));
    if (!fix) return std::unexpected(fix.error());
    return test::fix_answer(*fix, p);
  }
};

struct Pairs {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    std::vector<PairDifference<S, D>> ring;
    for (const std::size_t i : p.order) {
      ring.push_back({test::as<S, D>(p.places[i]),
                      test::as<S, D>(p.places[(i + 1) % p.places.size()]),
                      static_cast<S>(p.values[i]), static_cast<S>(p.sigmas[i])});
    }
    const auto fix = locate(ring, options_of<S, D>(p));
    if (!fix) return std::unexpected(fix.error());
    return test::fix_answer(*fix, p);
  }
};

struct Chan {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const Differences<S, D> d{p, true};
    const auto fix = tdoa_chan(d.reference, d.all, d.sigma);
    if (!fix) return std::unexpected(fix.error());
    return test::fix_answer(*fix, p, 0);
  }
};

struct Fang {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const Differences<S, D> d{p, true};
    const auto images = tdoa_fang(d.reference, d.all);
    if (!images) return std::unexpected(images.error());
    return test::image_answer(images->first, images->second);
  }
};

struct Bancroft {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const auto both = bancroft(pseudoranges_of<S, D>(p));
    if (!both) return std::unexpected(both.error());
    // With redundancy the second is no solution, and depends on the axes.
    const auto& second = p.places.size() > D + 1 && !p.flat ? both->first : both->second;
    Answer answer = test::image_answer(both->first.position, second.position);
    answer.quantities.push_back(
        {"mean bias", Kind::Number, 1, 0,
         test::padded(static_cast<double>((both->first.bias + second.bias) / 2))});
    return answer;
  }
};

struct CommonBias {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const auto fix = locate_with_bias(pseudoranges_of<S, D>(p), options_of<S, D>(p));
    if (!fix) return std::unexpected(fix.error());
    Answer answer = test::fix_answer(position_of(*fix), p);
    const auto variance = static_cast<double>(fix->covariance(D, D));
    const double slack = 4 * test::kStop * variance;
    const double condition = answer.quantities[1].condition;
    answer.quantities.push_back({"bias", Kind::Number, 1, 0,
                                 test::padded(static_cast<double>(fix->bias)),
                                 test::kStop * std::sqrt(variance)});
    answer.quantities.push_back(
        {"variance of the bias", Kind::Number, 2, 2, test::padded(variance), slack, condition});
    const Vec<S, D> mixed = fix->covariance.template topRightCorner<D, 1>();
    answer.quantities.push_back(
        {"covariance with the bias", Kind::Vector, 2, 2, test::padded(mixed), slack, condition});
    return answer;
  }
};

TEST_CASE("differences: what is done to the anchors is done to the fix, by every solver") {
  // Shuffled, they also have another reference.
  test::check_all<SharedReference>("locate from differences", make);
  test::check_all<Pairs>("locate from pairs", make_ring, {.share = 0.25});
  test::check_all<Chan>("tdoa_chan", make_spanned, {.squared = true, .leaning = true});
  test::check_all<Fang>("tdoa_fang", make_fewest, {.honest = false});
  test::check_all<Bancroft>("bancroft", make, {.honest = false, .squared = true, .leaning = true});
  test::check_all<CommonBias>("locate_with_bias", make);
}

}  // namespace tests::properties_differences
