// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Which minimum of a pose's χ² to answer. The descent starts at the heading that the caller knows
/// or that of the linear system of heading_guess.hpp, and then at every direction which that
/// system's χ² does not rule out. The minima found are compared, and one is answered only where the
/// ranges, or the caller, tell it from its images: mirrored, or turned.

#include <algorithm>
#include <cstddef>
#include <optional>

#include "uwbpos/core/chi_squared.hpp"
#include "uwbpos/solve/pose_minima.hpp"

namespace uwbpos {

/// `pose_from_ranges` refuses a χ² that chance exceeds as rarely as a normal deviate exceeds so
/// many standard deviations, one sound input in three million; beyond fewer, one in 740, it widens
/// the covariance.
inline constexpr int kPoseSigmas = 5;
inline constexpr int kPoseDoubtSigmas = 3;  ///< where it begins to widen

namespace detail {

/// Which of two minima the caller's knowledge may tell apart: by `prior` if they are in different
/// places, by `side` if they are on different sides, by six standard deviations: each has an error.
template <class S, int D>
LocateOptions<S, D> telling(const PoseOptions<S, D>& options, const Minimum<S, D + 1>& first,
                            const Minimum<S, D + 1>& second) {
  LocateOptions<S, D> told{options.side, options.prior};
  const Ldlt<S, D + 1> factor{first.information};
  if (!factor.positive_definite()) return told;
  const Mat<S, D + 1> covariance = factor.inverse();
  S square = S(0);
  S variance = S(0);
  S along = S(0);
  S variance_along = S(0);
  for (int k = 0; k < D; ++k) {
    const S d = first.state[k] - second.state[k];
    square += d * d;
    variance += covariance(k, k);
    along += d * options.side[k];
    for (int j = 0; j < D; ++j)
      variance_along += options.side[k] * covariance(k, j) * options.side[j];
  }
  if (!(square > S(36) * variance)) told.prior.reset();
  if (!(along * along > S(36) * variance_along)) told.side.setZero();
  return told;
}

/// The minimum to answer.
template <class S, int D>
Result<Minimum<S, D + 1>> lowest_minimum(const PoseProblem<S, D>& problem,
                                         const PoseOptions<S, D>& options, int freedom) {
  const S rounding = chi_squared_rounding<S>(problem.ranges, problem.largest);
  PoseMinima<S, D> minima;
  std::optional<HeadingGuess<S>> linear;
  if (!problem.heading.pinned) linear = guess_heading(problem);
  std::optional<S> guess;
  if (options.heading) guess = options.heading->value;
  if (linear && !(guess && options.heading->variance < linear->variance)) guess = linear->heading;
  if (guess) descend_at<S, D>(problem, *guess, minima);

  // A heading whose least χ² is so far above the lowest met holds no pose to be answered, as long
  // as the linear system knows what it says.
  constexpr S kSure = S(1) / 16;  // 60° are four standard deviations
  const bool knows = !linear || linear->variance <= kSure;
  const bool by_squares = problem.robust.loss == Loss::Squares;
  const auto ruled_out = [&](int k) {
    constexpr S kNeeded = S(30);
    return by_squares && knows && minima.count() > 0 &&
           rules_out(minima[0].chi_squared, least_chi_squared(problem, linear, k), freedom, kNeeded,
                     rounding);
  };
  bool sure = problem.heading.pinned;
  const bool guessed = guess && (linear && linear->heading == *guess
                                     ? knows
                                     : options.heading && options.heading->variance <= kSure);
  if (!sure && guessed && minima.count() > 0) {
    // Headings within 60° of the guess are taken to lie in its basin.
    constexpr S kNear = S(0.5);
    const Turn<S> at = turn_of(*guess);
    sure = true;
    for (int k = 0; k < kPoseHeadings && sure; ++k) {
      const Turn<S>& turn = kPoseTurns<S>[static_cast<std::size_t>(k)];
      const bool near = at.cosine * turn.cosine + at.sine * turn.sine > kNear;
      sure = near || ruled_out(k);
    }
  }
  for (int k = 0; k < kPoseHeadings && !sure; ++k) {
    if (!ruled_out(k)) descend_at<S, D>(problem, pose_heading<S>(k), minima);
  }
  if (minima.count() == 0) return std::unexpected(minima.error());

  // Outliers make a robust loss great, whichever pose is right.
  const S lowest = minima[0].chi_squared;
  const int expected =
      by_squares ? freedom : std::max(freedom, static_cast<int>(std::min(lowest, S(1e6))) + 1);
  const S circle = S(2) * std::numbers::pi_v<S> * problem.arm;
  Result<Minimum<S, D + 1>> answer = minima[0];
  for (int i = 1; i < minima.count() && answer; ++i) {
    constexpr S kNeeded = S(25);  // as of settle_images
    if (rules_out(lowest, minima[i].chi_squared, expected, kNeeded, rounding)) break;
    // Beside each other on the circle, relative to the anchors' centre, the images are compared.
    Minimum<S, D + 1> other = minima[i];
    other.state[D] = answer->state[D] + std::remainder(other.state[D] - answer->state[D], circle);
    LocateOptions<S, D> relative = telling<S, D>(options, *answer, other);
    if (relative.prior) *relative.prior -= problem.center;
    answer =
        settle_images<S, D, D + 1>(answer, other, relative, expected, problem.largest, rounding);
  }
  // Between poses that miss by tens of sigmas there is nothing to choose.
  const S hopeless = S(100) * chi_squared_gate(std::max(freedom, 1), static_cast<S>(kPoseSigmas));
  if (!answer && lowest > hopeless + rounding) return std::unexpected(Error::InconsistentRanges);
  return answer;
}

}  // namespace detail

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
