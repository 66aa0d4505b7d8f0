// SPDX-License-Identifier: MIT
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/sim/noise.hpp"
#include "uwbpos/solve/locate.hpp"

#include "support/nees.hpp"

namespace tests::solve_flat_height {

using namespace uwbpos;

namespace {

constexpr double kSigma = 0.1;

// Six anchors on a ceiling 3 m high.
template <class S>
std::vector<RangeTo<S, 3>> below_ceiling(const Vec<double, 3>& tag, sim::Random& random) {
  constexpr double xs[] = {0, 10, 10, 0, 5, 5};
  constexpr double ys[] = {0, 0, 8, 8, 9, -1};
  std::vector<RangeTo<S, 3>> ranges;
  for (int i = 0; i < 6; ++i) {
    const Vec<double, 3> anchor{xs[i], ys[i], 3};
    const double range = (tag - anchor).norm() + random.normal(0, kSigma) + 2;
    ranges.push_back({anchor.cast<S>(), static_cast<S>(range), static_cast<S>(kSigma)});
  }
  return ranges;
}

// Differences against the first, its own left out.
template <class S>
Result<Fix<S, 3>> by_differences(const std::vector<RangeTo<S, 3>>& ranges,
                                 const LocateOptions<S, 3>& options) {
  std::vector<DifferenceTo<S, 3>> differences;
  for (std::size_t i = 1; i < ranges.size(); ++i) {
    differences.push_back({ranges[i].anchor, ranges[i].range - ranges[0].range});
  }
  return locate(ranges[0].anchor, differences, static_cast<S>(kSigma), options);
}

// Fixes of tags that `draw` places, below by their side, to `take`; how many there are none of.
template <class S, class Draw, class Take>
int refused_of(int trials, sim::Random& random, const Draw& draw, const Take& take) {
  int refused = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const Vec<double, 3> tag = draw();
    const auto fix = by_differences(below_ceiling<S>(tag, random), {.side = {0, 0, -1}});
    if (fix) {
      take(*fix, tag);
    } else {
      ++refused;
    }
  }
  return refused;
}

}  // namespace

TEST_CASE_TEMPLATE("flat height: below a ceiling differences give a fix, as honest as it can be", S,
                   float, double) {
  sim::Random random{"below a ceiling"};
  for (const double below : {0.05, 0.3, 0.6, 1.0, 1.5, 2.5}) {
    CAPTURE(below);
    constexpr int trials = 600;
    double in_plan = 0;
    double of_height = 0;
    const auto draw = [&] {
      return Vec<double, 3>{random.uniform(3, 7), random.uniform(2, 6), 3 - below};
    };
    const int refused =
        refused_of<S>(trials, random, draw, [&](const Fix<S, 3>& fix, const Vec<double, 3>& tag) {
          CHECK(fix.position[2] <= S(3));
          in_plan += test::normalised_squared_error<S, 2>(
                         fix.position.template head<2>(),
                         fix.covariance.template topLeftCorner<2, 2>(), tag.head<2>()) /
                     2;
          const double off = static_cast<double>(fix.position[2]) - tag[2];
          of_height += off * off / static_cast<double>(fix.covariance(2, 2));
        });
    CHECK(refused * 200 <= trials);
    CHECK(in_plan / trials < 1.15);
    CHECK(in_plan / trials > 0.7);
    CHECK(of_height / trials < 1.8);  // a square is no Gaussian
    CHECK(of_height / trials > 0.5);
  }
}

TEST_CASE_TEMPLATE(
    "flat height: beside the anchors, where all hangs on the height, few are refused", S, float,
    double) {
  sim::Random random{"beside a ceiling"};
  for (const double below : {0.05, 1.0, 2.5}) {
    CAPTURE(below);
    constexpr int trials = 500;
    int far = 0;
    double joint = 0;
    const auto draw = [&] {
      return Vec<double, 3>{random.uniform(11, 14), random.uniform(2, 5), 3 - below};
    };
    const int refused =
        refused_of<S>(trials, random, draw, [&](const Fix<S, 3>& fix, const Vec<double, 3>& tag) {
          const double square =
              test::normalised_squared_error<S, 3>(fix.position, fix.covariance, tag);
          joint += square / 3;
          far += square > 16.3 ? 1 : 0;  // one in a thousand
        });
    CHECK(refused * 12 <= trials);
    CHECK(joint / trials < 1.1);
    CHECK(far <= 5);
  }
}

TEST_CASE_TEMPLATE("flat height: the side picks the image, where noise leaves one root, too", S,
                   float, double) {
  sim::Random random{"sides of a ceiling"};
  int apart = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Vec<double, 3> tag{random.uniform(0, 10), random.uniform(0, 8), random.uniform(1, 3)};
    const auto ranges = below_ceiling<S>(tag, random);
    for (const bool differences : {false, true}) {
      const auto solve = [&](S side) -> Result<Vec<S, 3>> {
        const LocateOptions<S, 3> options{.side = {S(0), S(0), side}};
        if (differences) {
          const auto fix = by_differences(ranges, options);
          if (!fix) return std::unexpected(fix.error());
          return fix->position;
        }
        const auto fix = locate_with_bias(ranges, options);
        if (!fix) return std::unexpected(fix.error());
        return fix->position;
      };
      const auto below = solve(S(-1));
      const auto above = solve(S(1));
      REQUIRE(below.has_value() == above.has_value());
      if (!below) continue;
      const S near = sizeof(S) == 4 ? S(2e-2) : S(1e-6);
      CHECK((*below)[2] <= S(3) + near);
      CHECK((*above)[2] >= S(3) - near);
      CHECK(std::abs((*below)[2] + (*above)[2] - S(6)) < near);
      apart += (*above)[2] - (*below)[2] > S(0.1) ? 1 : 0;
    }
  }
  CHECK(apart > 400);
}

}  // namespace tests::solve_flat_height
