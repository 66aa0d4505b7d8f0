// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A robot's pose from the positions of two tags, a known baseline d apart across its front and
/// symmetric about its centre. Source: posture of a mobile robot from two UWB tags (002), which
/// treats four quadrants one by one; the two-argument arctangent is all four.
/// \f[ c = \tfrac12 (L + R), \qquad
///     \psi = \operatorname{atan2}(x_R - x_L,\; y_L - y_R) \qquad (1), (2) \f]
/// With n the unit vector from L to R, t = n turned by +90° and independent errors of covariance
/// \f$ C_L, C_R \f$, to first order
/// \f[ \operatorname{cov} c = \tfrac14 (C_L + C_R), \qquad
///     \operatorname{var} \psi = t^T (C_L + C_R)\, t / b^2, \qquad
///     \operatorname{cov}(c, \psi) = (C_R - C_L)\, t / 2b, \qquad
///     b^2 = d\, |R - L|. \qquad (3) \f]
/// b is d but for noise: the direction of a vector of known length d and isotropic error of
/// variance s² has von Mises' density, of concentration d |R − L| / s². Tags that noise brought
/// together say little of the heading. Where the tags' ranges are at hand, `pose_from_ranges` makes
/// more of them: it solves all at once and uses d as knowledge instead of testing it.

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/pose/check_pose.hpp"

namespace uwbpos {

/// How many standard deviations the tags' distance may depart from the baseline and still be noise.
inline constexpr int kBaselineSigmas = 5;

namespace detail {

/// What is wrong with the input, or else `otherwise`.
template <class S>
Error two_tag_error(const Fix<S, 2>& left, const Fix<S, 2>& right, S baseline, Error otherwise) {
  if (!std::isfinite(baseline)) return Error::NotFinite;
  if (!(baseline > S(0))) return Error::InvalidOption;
  for (const Fix<S, 2>* tag : {&left, &right}) {
    if (!all_finite(tag->position) || !all_finite(tag->covariance)) return Error::NotFinite;
    if (!looks_like_covariance<S, 2>(tag->covariance)) return Error::InvalidCovariance;
  }
  return otherwise;
}

/// vᵀ C v of a symmetric C, of which the lower triangle is read.
template <class S>
S variance_along(const Vec<S, 2>& v, const Mat<S, 2>& c) {
  return v[0] * (v[0] * c(0, 0) + S(2) * v[1] * c(1, 0)) + v[1] * v[1] * c(1, 1);
}

}  // namespace detail

/// The pose of the robot whose front carries `left` and `right`, in their frame; `baseline` is the
/// tags' distance on the robot [m]. The tags' errors are taken as independent; of a `Fix` only
/// position [m] and covariance [m²] are used, and a covariance of zeros is exact knowledge.
/// One arctangent, seven roots; no allocation.
///
/// Errors: Error::NotFinite; Error::InvalidOption, a baseline that is not above zero;
/// Error::InvalidCovariance; Error::HeadingUndetermined, tags in one place, or for their noise so
/// near each other that the variance exceeds that of any direction at all;
/// Error::BaselineMismatch, the measured distance departs from the baseline by more than five
/// standard deviations along it, what five across it add, and rounding; Error::NumericOverflow.
template <class S>
[[nodiscard]] Result<Pose2<S>> two_tag_pose(const Fix<S, 2>& left, const Fix<S, 2>& right,
                                            std::type_identity_t<S> baseline) {
  // What is not finite fails a comparison here or leaves a variance that is not.
  const auto refuse = [&](Error error) {
    return std::unexpected(detail::two_tag_error<S>(left, right, baseline, error));
  };
  if (!(baseline > S(0))) return refuse(Error::InvalidOption);
  if (!looks_like_covariance<S, 2>(left.covariance) ||
      !looks_like_covariance<S, 2>(right.covariance)) {
    return refuse(Error::InvalidCovariance);
  }
  const Vec<S, 2> across = right.position - left.position;
  const S length = norm(across);
  const S largest = std::sqrt(std::max(squared_norm(left.position), squared_norm(right.position)));
  const S rounding = S(4) * std::numeric_limits<S>::epsilon() * largest;
  if (!std::isfinite(largest)) return refuse(Error::NumericOverflow);
  if (!(length > rounding)) return refuse(Error::HeadingUndetermined);

  const Mat<S, 2> sum = left.covariance + right.covariance;
  const Vec<S, 2> n = across / length;
  const Vec<S, 2> t{-n[1], n[0]};
  const S along = std::max(detail::variance_along(n, sum), S(0));
  const S aside = std::max(detail::variance_along(t, sum), S(0));
  // |d n + e| = d + n·e + (t·e)²/2d + …
  constexpr S k = S(kBaselineSigmas);
  const S half = S(0.5) / baseline;
  const S allowed = k * std::sqrt(along) + k * k * aside * half + rounding;
  if (!(std::abs(length - baseline) <= allowed)) return refuse(Error::BaselineMismatch);

  Pose2<S> pose;
  pose.position = left.position + S(0.5) * across;     // (1)
  pose.heading = direction_of(-across[1], across[0]);  // (2)
  const Mat<S, 2>& l = left.covariance;
  const Mat<S, 2>& r = right.covariance;
  const S across_x = (r(0, 0) - l(0, 0)) * t[0] + (r(1, 0) - l(1, 0)) * t[1];  // (C_R − C_L) t
  const S across_y = (r(1, 0) - l(1, 0)) * t[0] + (r(1, 1) - l(1, 1)) * t[1];
  const S x = S(0.25) * sum(0, 0);
  const S y = S(0.25) * sum(1, 1);
  const S turn = aside / (baseline * length);
  if (!std::isfinite(x + y)) return refuse(Error::NumericOverflow);
  if (!(turn <= kAnyDirectionVariance<S>)) return refuse(Error::HeadingUndetermined);
  const Vec<S, 3> sigma{std::sqrt(x), std::sqrt(y), std::sqrt(turn)};
  const S xy = bounded(S(0.25) * sum(1, 0), sigma[0], sigma[1]);
  const S inverse = S(0.5) / std::sqrt(baseline * length);
  const S x_turn = bounded(across_x * inverse, sigma[0], sigma[2]);
  const S y_turn = bounded(across_y * inverse, sigma[1], sigma[2]);
  pose.covariance << x, xy, x_turn, xy, y, y_turn, x_turn, y_turn, turn;  // (3)
  return pose;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
