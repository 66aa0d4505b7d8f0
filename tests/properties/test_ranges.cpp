// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/solve/exclude_outliers.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/toa_chan.hpp"
#include "uwbpos/solve/toa_closed_form.hpp"
#include "uwbpos/solve/toa_linear.hpp"

#include "properties/laws.hpp"

namespace tests::properties_ranges {

using namespace uwbpos;
using test::Answer;
using test::Problem;
using test::Scene;

template <class S, int D>
std::vector<RangeTo<S, D>> ranges_of(const Problem& p) {
  std::vector<RangeTo<S, D>> ranges;
  for (const std::size_t i : p.order) {
    ranges.push_back(
        {test::as<S, D>(p.places[i]), static_cast<S>(p.values[i]), static_cast<S>(p.sigmas[i])});
  }
  return ranges;
}

template <class S, int D>
LocateOptions<S, D> options_of(const Problem& p) {
  return {.side = test::as<S, D>(p.side)};
}

std::optional<Problem> make(const Scene& scene, int dimension) {
  return test::make_stations(scene, dimension, false);
}

std::optional<Problem> make_spanned(const Scene& scene, int dimension) {
  return test::make_spanned(scene, dimension, false);
}

struct Locate {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const auto fix = locate(ranges_of<S, D>(p), options_of<S, D>(p));
    if (!fix) return std::unexpected(fix.error());
    return test::fix_answer(*fix, p);
  }
};

struct LeastSquares {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const auto fix = toa_least_squares(ranges_of<S, D>(p));
    if (!fix) return std::unexpected(fix.error());
    return test::fix_answer(*fix, p);
  }
};

struct Linear {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const auto fix = toa_linear(ranges_of<S, D>(p));
    if (!fix) return std::unexpected(fix.error());
    return test::fix_answer(*fix, p, 0);
  }
};

struct Chan {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const auto fix = toa_chan(ranges_of<S, D>(p));
    if (!fix) return std::unexpected(fix.error());
    return test::fix_answer(*fix, p, 0);
  }
};

struct ClosedForm {
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const auto images = toa_closed_form(ranges_of<S, D>(p));
    if (!images) return std::unexpected(images.error());
    return test::image_answer(images->first, images->second);
  }
};

struct Excluding {
  // One of the ranges is far too long.
  template <class S, int D>
  static Result<Answer> solve(const Problem& p) {
    const auto found = locate_excluding(ranges_of<S, D>(p), options_of<S, D>(p));
    if (!found) return std::unexpected(found.error());
    Answer answer = test::fix_answer(found->fix, p);
    answer.quantities.push_back(
        {"consistent", test::Kind::Number, 0, 0, test::padded(found->consistent ? 1 : 0)});
    double excluded = 0;
    for (std::size_t k = 0; k < p.order.size(); ++k) {
      if ((found->excluded >> k & 1U) != 0)
        excluded += std::ldexp(1.0, static_cast<int>(p.order[k]));
    }
    answer.quantities.push_back({"excluded", test::Kind::Number, 0, 0, test::padded(excluded)});
    return answer;
  }
};

std::optional<Problem> make_outlier(const Scene& scene, int dimension) {
  auto p = make(scene, dimension);
  if (p && scene.count > dimension + 2) {
    p->values[static_cast<std::size_t>(scene.seed % scene.count)] += 4;
  }
  return p;
}

TEST_CASE("ranges: what is done to the anchors is done to the fix, by every solver") {
  test::check_all<Locate>("locate", make);
  test::check_all<LeastSquares>("toa_least_squares", make);
  test::check_all<Linear>("toa_linear", make_spanned, {.squared = true});
  test::check_all<Chan>("toa_chan", make_spanned, {.squared = true});
  // Whether it looks for a mirror image, in another way, depends on the sigmas.
  test::check_all<ClosedForm>(
      "toa_closed_form", make_spanned,
      {.laws = test::but(test::Law::Noise), .honest = false, .squared = true, .leaning = true});
  // Which range is the outlier depends on the sigmas.
  test::check_all<Excluding>("locate_excluding", make_outlier,
                             {.laws = test::but(test::Law::Noise), .honest = false});
}

}  // namespace tests::properties_ranges
