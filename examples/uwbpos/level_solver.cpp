// SPDX-License-Identifier: MIT
#include "level_solver.hpp"

#include <algorithm>
#include <vector>

#include "uwbpos/frames/joint_fix.hpp"

namespace uwbpos::host {
namespace {

constexpr int kGrid = 6;           // places on a side
constexpr double kSettled = 1e-9;  // [m]

NormalEquations<double, 2> normal_at(Pairs pairs, const Vec<double, 3>& position,
                                     Curvature curvature) {
  NormalEquations<double, 2> normal;
  for (const PairDifference<double, 3>& d : pairs) {
    const RangePrediction<double, 3> a = predict_range<double, 3>(position, d.anchor_a);
    const RangePrediction<double, 3> b = predict_range<double, 3>(position, d.anchor_b);
    const Vec<double, 2> ga = a.gradient.head<2>();
    const Vec<double, 2> gb = b.gradient.head<2>();
    const double weight = 1 / (d.sigma * d.sigma);
    const double residual = d.difference - (b.range - a.range);
    const Vec<double, 2> gradient = gb - ga;
    add_outer(normal.matrix, gradient, weight);
    normal.trace += weight * gradient.squaredNorm();
    normal.gradient += weight * residual * gradient;
    normal.chi_squared += weight * residual * residual;
    if (curvature == Curvature::Information) continue;
    // The model's curvature in the plane, (I − g gᵀ)/r of each range.
    const double bend_a = a.range > 0 ? -weight * residual / a.range : 0;
    const double bend_b = b.range > 0 ? weight * residual / b.range : 0;
    add_outer(normal.matrix, ga, bend_a);
    add_outer(normal.matrix, gb, bend_b);
    for (int i = 0; i < 2; ++i) normal.matrix(i, i) -= bend_a + bend_b;
  }
  return normal;
}

Mat<double, 2> covariance_of(const Minimum<double, 2>& found) {
  return Ldlt<double, 2>{found.information}.inverse();
}

}  // namespace

Result<Fix<double, 2>> locate_level(Pairs pairs, double height,
                                    const LocateOptions<double, 2>& options) {
  if (const auto error = check_pairs<double, 3>(pairs, 2)) return std::unexpected(*error);
  Vec<double, 2> low = pairs.front().anchor_a.head<2>();
  Vec<double, 2> high = low;
  for (const PairDifference<double, 3>& d : pairs) {
    for (const Vec<double, 3>& anchor : {d.anchor_a, d.anchor_b}) {
      low = low.cwiseMin(anchor.head<2>());
      high = high.cwiseMax(anchor.head<2>());
    }
  }
  const double extent = (high - low).norm();
  const auto evaluate = [&](const Vec<double, 2>& at, Curvature curvature) {
    return normal_at(pairs, {at.x(), at.y(), height}, curvature);
  };
  std::optional<Minimum<double, 2>> best;
  std::optional<Minimum<double, 2>> other;
  const auto same = [&](const Minimum<double, 2>& a, const Minimum<double, 2>& b) {
    return (a.state - b.state).norm() < 1e-3 * extent;
  };
  const auto descend_from = [&](const Vec<double, 2>& start) {
    constexpr int most = 50;
    const auto found = minimise<double, 2>(evaluate, start, kSettled, most);
    if (!found) return;
    const Vec<double, 2> from_middle = found->state - (low + high) / 2;
    if (!is_determined<double, 2>(*found, from_middle, extent / 2)) return;
    if (!best || (found->chi_squared < best->chi_squared && !same(*found, *best))) {
      other = best;
      best = *found;
    } else if (!same(*found, *best) && (!other || found->chi_squared < other->chi_squared)) {
      other = *found;
    }
  };
  if (options.prior) descend_from(*options.prior);
  const int freedom = static_cast<int>(pairs.size()) - 2;
  // What the prior leads to and the differences confirm, no other place could take from it.
  const bool settled = best && freedom > 0 && is_believable(best->chi_squared, freedom);
  for (int i = 0; i < kGrid && !settled; ++i) {
    for (int j = 0; j < kGrid; ++j) {
      const Vec<double, 2> share{-0.3 + 1.6 * i / (kGrid - 1), -0.3 + 1.6 * j / (kGrid - 1)};
      descend_from(low + share.cwiseProduct(high - low));
    }
  }
  if (!best) return std::unexpected(Error::DegenerateGeometry);
  constexpr double needed = 9;  // odds of 90 : 1
  if (other && !rules_out(best->chi_squared, other->chi_squared, freedom, needed, 1e-12)) {
    if (!options.prior) return std::unexpected(Error::AmbiguousSolution);
    if ((other->state - *options.prior).norm() < (best->state - *options.prior).norm()) {
      best = other;
    }
  }
  return Fix<double, 2>{best->state, covariance_of(*best), best->chi_squared, freedom};
}

Result<ExclusionFix<double, 2>> locate_level_excluding(Pairs pairs, double height,
                                                       const LocateOptions<double, 2>& options,
                                                       const ExclusionOptions<double>& exclusion) {
  using Pair = PairDifference<double, 3>;
  return exclude_outliers<Pair, double, 2>(
      pairs, exclusion, options.prior,
      [&](Pairs some) { return locate_level(some, height, options); },
      [&](const Pair& d, const Vec<double, 2>& at) {
        return residual_of<double, 3>(d, {at.x(), at.y(), height});
      });
}

}  // namespace uwbpos::host
