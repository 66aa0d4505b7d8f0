// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <vector>

#include <doctest/doctest.h>

#include "frames/building.hpp"
#include "support/nees.hpp"
#include "support/statistics.hpp"

namespace tests::frames_hand_over {

using namespace uwbpos;

namespace {

// What a walk, or many, showed; errors and steps squared, over what was claimed.
struct Walks {
  std::vector<double> error;         // one mean per walk
  std::vector<double> border_error;  // right after a change of subnets
  std::vector<double> step;          // of the track at such a change, less the walk's own
  std::vector<double> step_elsewhere;
  std::vector<double> added_step;  // what the change alone adds, noise apart
  int contradictions = 0;
};

double length_over(const Vec<double, 2>& s, const Mat<double, 2>& c) {
  return test::normalised_squared_error<double, 2>(s, c, Vec<double, 2>::Zero());
}
double length_over(const Vec<double, 3>& s, const Mat<double, 3>& c) {
  return test::normalised_squared_error<double, 3>(s, c, Vec<double, 3>::Zero());
}

template <class S, int D>
SubnetFix<S, D> fix_of(const test::Building<D>& building, std::size_t k, const Vec<double, D>& p,
                       const Mat<double, D>& c, const Vec<double, D>& noise) {
  const Vec<double, D> at = apply(inverse(building.truth[k]), p) + noise;
  return {static_cast<std::uint32_t>(k + 1),
          {at.template cast<S>(), c.template cast<S>(), S(0), 0}};
}

template <class S, int D>
Walks walk_through(const char* name, int buildings, double survey_sigma, bool learning = true) {
  sim::Random random{name};
  Walks walks;
  const std::vector<Vec<double, D>> path = test::walk<D>();
  for (int b = 0; b < buildings; ++b) {
    const test::Building<D> building{random, survey_sigma};
    if (!building.good) continue;
    Subnets<S, D, 4> subnets;
    for (const auto& s : building.fitted) {
      REQUIRE(subnets.add({s.id,
                           s.control_anchor,
                           {.rotation = s.map_T_subnet.rotation.template cast<S>(),
                            .translation = s.map_T_subnet.translation.template cast<S>(),
                            .covariance = s.map_T_subnet.covariance.template cast<S>()}}));
    }
    double sum = 0;
    double border_sum = 0;
    int borders = 0;
    Vec<double, D> last_error = Vec<double, D>::Zero();
    Mat<double, D> last_covariance = Mat<double, D>::Zero();
    std::vector<std::size_t> last_heard;
    for (const auto& p : path) {
      std::vector<std::size_t> heard;
      std::vector<SubnetFix<S, D>> fixes;
      for (std::size_t k = 0; k < 4; ++k) {
        if (!building.hears(static_cast<int>(k), p)) continue;
        heard.push_back(k);
        const Mat<double, D> c = test::random_covariance<double, D>(random, 0.05, 0.2);
        fixes.push_back(fix_of<S, D>(building, k, p, c, test::draw<D>(random, c)));
      }
      const bool border = !last_heard.empty() && heard != last_heard;
      if (border) {
        // One place, once as the old subnets and once as the new ones see it without noise.
        const auto seen_by = [&](const std::vector<std::size_t>& by) {
          std::vector<SubnetFix<S, D>> seen;
          for (const std::size_t k : by) {
            seen.push_back(fix_of<S, D>(building, k, p, Mat<double, D>::Identity() * 0.015,
                                        Vec<double, D>::Zero()));
          }
          const auto fused = fuse_fixes(subnets, seen, {.gate = S(1000)});
          REQUIRE(fused);
          return fused->fix;
        };
        const auto before = seen_by(last_heard);
        const auto after = seen_by(heard);
        const Vec<double, D> s = (after.position - before.position).template cast<double>();
        walks.added_step.push_back(
            std::min(length_over(s, Mat<double, D>{before.covariance.template cast<double>()}),
                     length_over(s, Mat<double, D>{after.covariance.template cast<double>()})));
      }
      const auto fused = learning ? fuse_and_learn(subnets, fixes) : fuse_fixes(subnets, fixes);
      REQUIRE(fused);
      walks.contradictions += fused->fused < fused->heard ? 1 : 0;
      const Vec<double, D> error = fused->fix.position.template cast<double>() - p;
      const Mat<double, D> c = fused->fix.covariance.template cast<double>();
      const double e = length_over(error, c);
      sum += e;
      if (!last_heard.empty()) {
        const double step =
            length_over(Vec<double, D>{error - last_error}, Mat<double, D>{c + last_covariance});
        (border ? walks.step : walks.step_elsewhere).push_back(step);
      }
      if (border) {
        border_sum += e;
        ++borders;
      }
      last_error = error;
      last_covariance = c;
      last_heard = heard;
    }
    walks.error.push_back(sum / static_cast<double>(path.size()));
    walks.border_error.push_back(border_sum / borders);
  }
  return walks;
}

double share_above(const std::vector<double>& samples, double limit) {
  const auto above =
      std::count_if(samples.begin(), samples.end(), [limit](double x) { return x > limit; });
  return static_cast<double>(above) / static_cast<double>(samples.size());
}

template <class S, int D>
void accept(double survey_sigma) {
  const Walks walks = walk_through<S, D>("four subnets", 60, survey_sigma);
  REQUIRE(walks.error.size() > 50);
  REQUIRE(walks.step.size() > 20 * walks.error.size());
  CAPTURE(D);
  CAPTURE(survey_sigma);
  // Within the covariance that it claims: a walk's errors hang together by its transforms, so that
  // the walks' means are the independent samples; four of their own deviations, 1 in 16,000.
  // Learning counts ten fixes for one, so that it claims a few percent too much where fixes are
  // independent.
  const auto n = static_cast<double>(walks.error.size());
  for (const auto* errors : {&walks.error, &walks.border_error}) {
    const double mean = test::mean(*errors);
    const double slack = 4 * test::standard_deviation(*errors) / std::sqrt(n);
    CHECK(mean < D + slack);
    CHECK(mean > 0.9 * D - slack);
  }
  // What a hand-over adds to the track never exceeds 3σ.
  CHECK(*std::max_element(walks.added_step.begin(), walks.added_step.end()) < 9);
  // With the fixes' own noise the track steps beyond 3σ at a border no more often than a χ² does.
  const double tail = 1 - test::chi_squared_cdf(9, D);
  const auto count = static_cast<double>(walks.step.size());
  CHECK(share_above(walks.step, 9) < tail + 4 * std::sqrt(tail / count));
  // ... and no more often than it does where nothing changes.
  const double elsewhere = share_above(walks.step_elsewhere, 9);
  CHECK(share_above(walks.step, 9) < elsewhere + 4 * std::sqrt(tail / count));
  CHECK(walks.contradictions <= 3);  // 60 walks of 500 overlaps: 1 in 30,000 each
}

}  // namespace

TEST_CASE_TEMPLATE("a walk through four subnets stays within its covariance and does not jump", S,
                   float, double) {
  accept<S, 2>(0.05);
  accept<S, 3>(0.05);
}

TEST_CASE_TEMPLATE("transforms worse than the fixes make no jump either", S, float, double) {
  accept<S, 2>(0.2);
}

TEST_CASE("learning makes hand-overs smoother than fusion alone") {
  const Walks learned = walk_through<double, 2>("smoother", 60, 0.2);
  const Walks fused = walk_through<double, 2>("smoother", 60, 0.2, false);
  // A walk crosses every border at least twice: only the first crossing is news.
  CHECK(test::mean(learned.added_step) < 0.5 * test::mean(fused.added_step));
}

}  // namespace tests::frames_hand_over
