// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Where a track begins: the maximum-likelihood pose of the last measurements of a tracker, each
/// with a variance that grows with its age, for the body moves at an unknown speed.
/// filter/first_position.hpp gives the position to start from; the descent of solve/newton.hpp then
/// takes lever arms, heights and slant ranges as they are, and where the tags can tell a heading
/// starts from eight of them. Readings beyond five standard deviations are left out, twice over,
/// and what is left must pass the χ² test.

#include <bit>
#include <cmath>
#include <optional>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/core/chi_squared.hpp"
#include "uwbpos/filter/first_position.hpp"
#include "uwbpos/model/lever_arm.hpp"

namespace uwbpos {

/// A pose to begin with.
template <class S, int D>
struct FirstFix {
  Vec<S, D> position;        ///< [m]
  std::optional<S> heading;  ///< where the measurements tell it [rad]
  Mat<S, D + 1> covariance;  ///< of (position, heading); without a heading, of the position alone
  int degrees_of_freedom;    ///< what it could be judged by

  /// Begins where a position was measured; nothing judges it.
  [[nodiscard]] static FirstFix at(const TimedPosition<S>& reading) {
    FirstFix fix{};
    fix.position = reading.position.template head<D>();
    fix.covariance.setZero();
    fix.covariance.template topLeftCorner<D, D>() =
        reading.covariance.template topLeftCorner<D, D>();
    return fix;
  }
  /// Variance of the position in all directions together [m²].
  [[nodiscard]] S spread() const {
    S sum = S(0);
    for (int k = 0; k < D; ++k) sum += covariance(k, k);
    return sum;
  }
};

namespace detail {

// The readings against a pose (position, perhaps heading), all relative to `center`.
template <class S, int D, int N>
struct PoseReadings {
  const FirstReadings<S>& set;
  const FirstFixOptions<S, D>& options;
  Vec<S, 3> center;
  std::uint64_t kept;

  [[nodiscard]] Vec<S, 3> arm(const Vec<S, N>& pose, const Vec<S, 3>& lever) const {
    const S heading = N > D ? pose[N - 1] : options.heading ? options.heading->value : S(0);
    return turned<S, 3>(turn_of(heading), lever);
  }

  // Residual of one reading, and its gradient with respect to the pose.
  S residual(const FirstReading<S>& r, const Vec<S, N>& pose, Vec<S, N>& gradient) const {
    const Vec<S, 3> reach = arm(pose, r.lever);
    Vec<S, 3> place = reach;
    for (int k = 0; k < D; ++k) place[k] += pose[k];
    if constexpr (D == 2) place[2] += options.height - center[2];
    RangePrediction<S, 3> to = predict_range<S, 3>(place, r.b - center);
    if (r.is_difference) {
      const RangePrediction<S, 3> from = predict_range<S, 3>(place, r.a - center);
      to.range -= from.range;
      to.gradient -= from.gradient;
    }
    for (int k = 0; k < D; ++k) gradient[k] = to.gradient[k];
    if constexpr (N > D) gradient[N - 1] = heading_gradient<S, 3>(reach, to.gradient);
    return r.value - to.range;
  }

  [[nodiscard]] NormalEquations<S, N> operator()(const Vec<S, N>& pose, Curvature) const {
    NormalEquations<S, N> normal;
    for (int i = 0; i < set.count; ++i) {
      if ((kept >> i & 1) == 0) continue;
      const FirstReading<S>& r = set.readings[static_cast<std::size_t>(i)];
      Vec<S, N> gradient;
      const S e = residual(r, pose, gradient);
      add_outer(normal.matrix, gradient, S(S(1) / r.variance));
      normal.trace += squared_norm(gradient) / r.variance;
      normal.gradient += gradient * (e / r.variance);
      normal.chi_squared += e * e / r.variance;
    }
    if (N > D && options.heading) {
      const S off = angle_difference<S>(options.heading->value, pose[N - 1]);
      normal.matrix(N - 1, N - 1) += S(1) / options.heading->variance;
      normal.trace += S(1) / options.heading->variance;
      normal.gradient[N - 1] += off / options.heading->variance;
      normal.chi_squared += off * off / options.heading->variance;
    }
    return normal;
  }
};

// Descends from a start, leaving out what five standard deviations do not reach.
template <class S, int D, int N>
Result<Minimum<S, N>> descend_pose(PoseReadings<S, D, N>& readings, const Vec<S, N>& start) {
  constexpr int kRounds = 3;
  constexpr int kIterations = 40;
  constexpr S kSigmas = S(5);
  const S rounding = S(64) * std::numeric_limits<S>::epsilon();
  Vec<S, N> pose = start;
  for (int round = 0;; ++round) {
    const Result<Minimum<S, N>> found = minimise<S, N>(readings, pose, rounding, kIterations);
    if (!found || round == kRounds) return found;
    pose = found->state;
    std::uint64_t kept = 0;
    for (int i = 0; i < readings.set.count; ++i) {
      const FirstReading<S>& r = readings.set.readings[static_cast<std::size_t>(i)];
      Vec<S, N> gradient;
      const S e = readings.residual(r, pose, gradient);
      if (e * e <= kSigmas * kSigmas * r.variance) kept |= std::uint64_t{1} << i;
    }
    if (kept == readings.kept) return found;
    readings.kept = kept;
  }
}

template <class S, int D, int N>
Result<FirstFix<S, D>> first_pose(const FirstReadings<S>& set, const FirstFixOptions<S, D>& options,
                                  const Vec<S, D>& position) {
  PoseReadings<S, D, N> readings{set, options, Vec<S, 3>::Zero(), 0};
  for (int i = 0; i < set.count; ++i) {
    readings.center += set.readings[static_cast<std::size_t>(i)].b / static_cast<S>(set.count);
  }
  const std::uint64_t all = ~std::uint64_t{0} >> (64 - set.count);
  const int starts = N == D || options.heading ? 1 : 8;
  Result<Minimum<S, N>> best = std::unexpected(Error::NotConverged);
  std::uint64_t kept = 0;
  S second = std::numeric_limits<S>::infinity();  // χ² of another heading
  for (int k = 0; k < starts; ++k) {
    Vec<S, N> start = Vec<S, N>::Zero();
    for (int j = 0; j < D; ++j) start[j] = position[j] - readings.center[j];
    if (N > D) {
      start[N - 1] = options.heading ? options.heading->value : degrees_to_radians(S(45) * S(k));
    }
    readings.kept = all;
    const Result<Minimum<S, N>> found = descend_pose(readings, start);
    if (!found) continue;
    // Leaving a reading out costs what five deviations would.
    const auto cost = [&](const Minimum<S, N>& m, std::uint64_t mask) {
      return m.chi_squared + S(25 * (set.count - std::popcount(mask)));
    };
    const bool same =
        best &&
        (N == D || std::abs(angle_difference<S>(found->state[N - 1], best->state[N - 1])) < S(0.1));
    if (!best || cost(*found, readings.kept) < cost(*best, kept)) {
      if (best && !same) second = std::min(second, cost(*best, kept));
      best = found;
      kept = readings.kept;
    } else if (!same) {
      second = std::min(second, cost(*found, readings.kept));
    }
  }
  if (!best) return std::unexpected(best.error());
  const int used = std::popcount(kept);
  const int freedom = used + (options.heading ? 1 : 0) - N;
  const Ldlt<S, N> factor{best->information};
  constexpr S kSigmas = S(3);
  const bool believed = freedom >= 1 && 3 * used >= 2 * set.count && factor.positive_definite() &&
                        best->chi_squared <= chi_squared_gate(freedom, kSigmas);
  if (!believed) return std::unexpected(Error::NotYetLocated);
  // Another heading must be nine less likely in χ², as mirror images.
  const S cost = best->chi_squared + S(25 * (set.count - used));
  if (second - cost < S(9)) return std::unexpected(Error::AmbiguousSolution);

  FirstFix<S, D> fix;
  for (int k = 0; k < D; ++k) fix.position[k] = best->state[k] + readings.center[k];
  if (N > D) fix.heading = wrap_angle(best->state[N - 1]);
  fix.covariance.setZero();
  fix.covariance.template topLeftCorner<N, N>() = factor.inverse();
  fix.degrees_of_freedom = freedom;
  return fix;
}

}  // namespace detail

/// The pose that the readings give. O(n²·D²) with outliers, about 12 kB of stack in double; no
/// allocation. Errors: those of `locate`; Error::NotYetLocated, too few readings to judge by, or
/// readings that do not agree; Error::AmbiguousSolution, two headings or mirror images.
template <class S, int D>
[[nodiscard]] Result<FirstFix<S, D>> first_fix(const FirstReadings<S>& set,
                                               const FirstFixOptions<S, D>& options) {
  if (set.count <= D) return std::unexpected(Error::NotYetLocated);
  const Result<Vec<S, D>> position = first_position<S, D>(set, options);
  if (!position) return std::unexpected(position.error());
  if (options.wants_heading && set.has_levers) {
    return detail::first_pose<S, D, D + 1>(set, options, *position);
  }
  return detail::first_pose<S, D, D>(set, options, *position);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
