// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/accuracy/dop.hpp"
#include "uwbpos/geometry/height.hpp"

#include "properties/laws.hpp"

namespace tests::properties_bounds {

using namespace uwbpos;
using test::Answer;
using test::Kind;
using test::Problem;
using test::Scene;

// Nothing is measured: what matters is where the stations are.
std::optional<Problem> make(const Scene& scene, int dimension) {
  auto p = test::make_stations(scene, dimension, false);
  if (p) p->values.clear();
  return p;
}

std::optional<Problem> make_biased(const Scene& scene, int dimension) {
  auto p = test::make_stations(scene, dimension, true);
  if (p) p->values.clear();
  return p;
}

template <class S, int D>
std::vector<Vec<S, D>> anchors_of(const Problem& p) {
  std::vector<Vec<S, D>> anchors;
  for (const std::size_t i : p.order) anchors.push_back(test::as<S, D>(p.places[i]));
  return anchors;
}

template <class S>
Result<Answer> dilutions(const Result<Dop<S>>& dop) {
  if (!dop) return std::unexpected(dop.error());
  Answer answer;
  // Of directions, with conditions up to GDOP² times their number.
  const auto gdop = static_cast<double>(dop->gdop);
  const auto add = [&](const char* name, S value) {
    answer.quantities.push_back(
        {name, Kind::Number, 0, 0, test::padded(static_cast<double>(value)), 0, 12 * gdop * gdop});
  };
  add("gdop", dop->gdop);
  add("pdop", dop->pdop);
  add("hdop", dop->hdop);
  add("vdop", dop->vdop);
  add("tdop", dop->tdop);
  return answer;
}

struct RangeDop {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    return dilutions(range_dop(anchors_of<S, D>(p), test::as<S, D>(p.tag)));
  }
};

struct PseudorangeDop {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    return dilutions(pseudorange_dop(anchors_of<S, D>(p), test::as<S, D>(p.tag)));
  }
};

template <class S, int D>
Result<Answer> bounded(const Result<Mat<S, D>>& bound, const Problem& p) {
  if (!bound) return std::unexpected(bound.error());
  double weight = 0;
  for (const double sigma : p.sigmas) weight += 1 / (sigma * sigma);
  Answer answer;
  answer.quantities = {{"bound", Kind::Tensor, 2, 2, test::padded(*bound), 0,
                        weight * static_cast<double>(bound->trace())}};
  return answer;
}

struct RangeBound {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    std::vector<RangeTo<S, D>> ranges;
    for (const std::size_t i : p.order) {
      ranges.push_back({test::as<S, D>(p.places[i]), S(0), static_cast<S>(p.sigmas[i])});
    }
    return bounded<S, D>(cramer_rao_bound(ranges, test::as<S, D>(p.tag)), p);
  }
};

struct DifferenceBound {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    std::vector<DifferenceTo<S, D>> differences;
    for (const auto& anchor : anchors_of<S, D>(p)) differences.push_back({anchor, S(0)});
    const Vec<S, D> reference = differences[0].anchor;
    differences.erase(differences.begin());
    return bounded<S, D>(cramer_rao_bound(reference, differences, static_cast<S>(p.sigmas[0]),
                                          test::as<S, D>(p.tag)),
                         p);
  }
};

struct PairBound {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    std::vector<PairDifference<S, D>> ring;
    for (const std::size_t i : p.order) {
      ring.push_back({test::as<S, D>(p.places[i]),
                      test::as<S, D>(p.places[(i + 1) % p.places.size()]), S(0),
                      static_cast<S>(p.sigmas[i])});
    }
    return bounded<S, D>(cramer_rao_bound(ring, test::as<S, D>(p.tag)), p);
  }
};

TEST_CASE("bounds: what is done to the anchors is done to the bound, and nothing to dilutions") {
  constexpr test::Traits traits{.honest = false};
  test::check_all<RangeDop>("range_dop", make, {.level = true, .honest = false});
  test::check_all<PseudorangeDop>("pseudorange_dop", make_biased, {.level = true, .honest = false});
  test::check_all<RangeBound>("cramer_rao_bound of ranges", make, traits);
  test::check_all<DifferenceBound>("cramer_rao_bound of differences", make_biased, traits);
  test::check_all<PairBound>("cramer_rao_bound of pairs", make_biased, traits);
}

template <class S>
bool same(const Result<Measured<S>>& a, const Result<Measured<S>>& b, S lengths = 1, S noise = 1) {
  if (!a || !b) return !a && !b && a.error() == b.error();
  return b->value == a->value * lengths &&
         b->variance == a->variance * lengths * lengths * noise * noise;
}

TEST_CASE_TEMPLATE("horizontal ranges scale, and know heights by their difference alone", S, float,
                   double) {
  test::check("horizontal_range", [](const Scene& scene) -> test::Verdict {
    const test::Station& s = scene.stations[0];
    const S sigma = static_cast<S>(s.sigma) / 1000;
    // Quarters of metres, so that heights add without rounding.
    const S high = static_cast<S>(s.place.z / 250) / 4;
    const S low = static_cast<S>(scene.tag.z / 250) / 4;
    const S lift = static_cast<S>(scene.shift.z / 250) / 4;
    const Measured<S> slant{static_cast<S>(scene.tag.x) / 1000, sigma * sigma};
    const auto plain = horizontal_range(slant, high, low);
    if (!same(plain, horizontal_range(slant, low, high))) return {.fault = "exchanged"};
    if (!same(plain, horizontal_range<S>(slant, high + lift, low + lift)))
      return {.fault = "lifted"};
    const S scale = std::ldexp(S(1), scene.octaves);
    const Measured<S> longer{slant.value * scale, slant.variance * scale * scale};
    if (!same<S>(plain, horizontal_range<S>(longer, high * scale, low * scale), scale)) {
      return {.fault = "scaled"};
    }
    // At the foot of the anchor the variance is no longer the square of sigma.
    const S noise = std::ldexp(S(1), scene.noisier);
    const auto noisier =
        horizontal_range<S>({slant.value, slant.variance * noise * noise}, high, low);
    const bool foot =
        plain && plain->value < 4 * std::sqrt(slant.value * sigma * std::max(noise, S(1)));
    if (foot ? noisier->value != plain->value : !same<S>(plain, noisier, 1, noise)) {
      return {.fault = "noisier"};
    }
    return {};
  });
}

}  // namespace tests::properties_bounds
