// SPDX-License-Identifier: MIT
// Which solver to call: every method on the same noisy arrivals, its error beside the least that is
// possible, and what happens when one anchor lies.
#include <cmath>
#include <cstdio>
#include <numbers>
#include <utility>
#include <vector>

#include <uwbpos/sim/noise.hpp>
#include <uwbpos/uwbpos.hpp>

namespace {

using namespace uwbpos;
using Point = Vec<double, 2>;

constexpr double kArrivalSigma = 0.1;  // of one arrival [m]
constexpr int kDraws = 2000;

// Mean squared error of `solve` over draws of noise, over the bound's.
template <class Solve>
void report(const char* name, const Point& tag, const Mat<double, 2>& bound, const Solve& solve) {
  sim::Random random{"methods"};
  double squares = 0;
  int solved = 0;
  for (int i = 0; i < kDraws; ++i) {
    const Result<Point> position = solve(random);
    if (!position) continue;
    squares += squared_norm<double, 2>(*position - tag);
    ++solved;
  }
  std::printf("  %-34s %6.1f cm   %5.2f   %4d\n", name, 100 * std::sqrt(squares / solved),
              squares / solved / bound.trace(), kDraws - solved);
}

template <class T>
Result<Point> position_of_fix(const Result<T>& fix) {
  if (!fix) return std::unexpected(fix.error());
  return fix->position;
}

}  // namespace

int main() {
  const std::vector<Point> anchors{{0, 0}, {10, 0}, {10, 8}, {0, 8}, {5, 8}};
  const Point tag{8.5, 3};
  const auto arrivals = [&](sim::Random& random) {
    std::vector<RangeTo<double, 2>> ranges;
    for (const Point& a : anchors) {
      ranges.push_back(
          {a, predict_range(tag, a).range + random.normal(0, kArrivalSigma), kArrivalSigma});
    }
    return ranges;
  };
  // What is left when the tag's clock is unknown: differences against the first anchor.
  const auto differences = [&](sim::Random& random) {
    const auto ranges = arrivals(random);
    std::vector<DifferenceTo<double, 2>> against_first;
    for (std::size_t i = 1; i < ranges.size(); ++i) {
      against_first.push_back({ranges[i].anchor, ranges[i].range - ranges[0].range});
    }
    return against_first;
  };

  sim::Random any{1};
  const auto range_bound = cramer_rao_bound(arrivals(any), tag);
  const auto difference_bound = cramer_rao_bound(anchors[0], differences(any), kArrivalSigma, tag);
  if (!range_bound || !difference_bound) return 1;

  std::printf("Five anchors, sigma %.2f m; error over bound, refused of %d\n\n", kArrivalSigma,
              kDraws);
  std::printf("Ranges: the bound is %.1f cm\n", 100 * std::sqrt(range_bound->trace()));
  report("toa_closed_form", tag, *range_bound, [&](auto& random) -> Result<Point> {
    const auto images = toa_closed_form(arrivals(random));
    if (!images) return std::unexpected(images.error());
    return images->first;
  });
  report("toa_three_anchors (the first)", tag, *range_bound, [&](auto& random) {
    const auto all = arrivals(random);
    return toa_three_anchors<double>({all[0], all[1], all[2]});
  });
  report("toa_linear", tag, *range_bound,
         [&](auto& random) { return position_of_fix(toa_linear(arrivals(random))); });
  report("toa_chan", tag, *range_bound,
         [&](auto& random) { return position_of_fix(toa_chan(arrivals(random))); });
  report("toa_least_squares", tag, *range_bound,
         [&](auto& random) { return position_of_fix(toa_least_squares(arrivals(random))); });
  report("toa_refine, 0.4 m beside", tag, *range_bound, [&](auto& random) {
    return position_of_fix(toa_refine(arrivals(random), tag + Point{0.24, -0.32}));
  });
  report("locate", tag, *range_bound,
         [&](auto& random) { return position_of_fix(locate(arrivals(random))); });

  std::printf("\nDifferences: the bound is %.1f cm\n", 100 * std::sqrt(difference_bound->trace()));
  report("tdoa_fang (the first three)", tag, *difference_bound, [&](auto& random) -> Result<Point> {
    auto fewest = differences(random);
    fewest.resize(2);
    const auto both = tdoa_fang(anchors[0], fewest);
    if (!both) return std::unexpected(both.error());
    return (both->first - tag).norm() < (both->second - tag).norm() ? both->first : both->second;
  });
  report("tdoa_chan", tag, *difference_bound, [&](auto& random) {
    return position_of_fix(tdoa_chan(anchors[0], differences(random), kArrivalSigma));
  });
  report("locate, shared reference", tag, *difference_bound, [&](auto& random) {
    return position_of_fix(locate(anchors[0], differences(random), kArrivalSigma));
  });
  report("locate_with_bias", tag, *difference_bound,
         [&](auto& random) { return position_of_fix(locate_with_bias(arrivals(random))); });
  report("bancroft", tag, *difference_bound, [&](auto& random) -> Result<Point> {
    const auto solutions = bancroft(arrivals(random));
    if (!solutions) return std::unexpected(solutions.error());
    return solutions->first.position;
  });
  const auto ring = [&](sim::Random& random) {
    std::vector<PairDifference<double, 2>> pairs;
    for (std::size_t i = 0; i < anchors.size(); ++i) {
      const Point& a = anchors[i];
      const Point& b = anchors[(i + 1) % anchors.size()];
      const double noise = random.normal(0, std::numbers::sqrt2 * kArrivalSigma);
      pairs.push_back({a, b, predict_range_difference(tag, a, b).difference + noise,
                       std::numbers::sqrt2 * kArrivalSigma});
    }
    return pairs;
  };
  const auto pair_bound = cramer_rao_bound(ring(any), tag);
  if (!pair_bound) return 1;
  std::printf("\nDifferences of neighbours, each with noise of its own: the bound is %.1f cm\n",
              100 * std::sqrt(pair_bound->trace()));
  report("locate, pairs", tag, *pair_bound,
         [&](auto& random) { return position_of_fix(locate(ring(random))); });

  std::printf("\nRanges, and the second anchor reads 3 m long:\n");
  const auto spoiled = [&](auto& random) {
    auto ranges = arrivals(random);
    ranges[1].range += 3;
    return ranges;
  };
  report("locate", tag, *range_bound,
         [&](auto& random) { return position_of_fix(locate(spoiled(random))); });
  report("locate_excluding", tag, *range_bound, [&](auto& random) -> Result<Point> {
    const auto kept = locate_excluding(spoiled(random));
    if (!kept) return std::unexpected(kept.error());
    return kept->fix.position;
  });
  return 0;
}
