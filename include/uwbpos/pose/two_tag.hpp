// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A robot's pose from the positions of two tags, a known baseline d apart across its front and
/// symmetric about its centre. Source: posture of a mobile robot from two UWB tags (002), which
/// treats four quadrants one by one; the two-argument arctangent is all four.
/// \f[ c = \tfrac12 (L + R), \qquad
///     \psi = \operatorname{atan2}(x_R - x_L,\; y_L - y_R) \qquad (1), (2) \f]
/// With n the unit vector from L to R, t = n turned by +90° and independent errors of covariance
/// \f$ C_L, C_R \f$, to first order
/// \f[ \operatorname{cov} c = \tfrac14 (C_L + C_R), \qquad
///     \operatorname{var} \psi = t^T (C_L + C_R)\, t / d^2, \qquad
///     \operatorname{cov}(c, \psi) = (C_R - C_L)\, t / 2d. \qquad (3) \f]
/// Where the tags' ranges are at hand, `pose_from_ranges` makes more of them: it solves all at once
/// and uses d as knowledge instead of testing it.

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/pose/check_pose.hpp"

namespace uwbpos {

/// How many standard deviations the tags' distance may depart from the baseline and still be noise.
inline constexpr int kBaselineSigmas = 5;

namespace detail {

template <class S>
std::optional<Error> check_tag(const Fix<S, 2>& tag) {
  if (!all_finite(tag.position) || !all_finite(tag.covariance)) return Error::NotFinite;
  if (!looks_like_covariance<S, 2>(tag.covariance)) return Error::InvalidCovariance;
  return std::nullopt;
}

/// vᵀ C w, summed in order.
template <class S>
S weighted_product(const Vec<S, 2>& v, const Mat<S, 2>& c, const Vec<S, 2>& w) {
  return v[0] * (c(0, 0) * w[0] + c(0, 1) * w[1]) + v[1] * (c(1, 0) * w[0] + c(1, 1) * w[1]);
}

}  // namespace detail

/// The pose of the robot whose front carries `left` and `right`, in their frame; `baseline` is the
/// tags' distance on the robot [m]. The tags' errors are taken as independent; of a `Fix` only
/// position [m] and covariance [m²] are used, and a covariance of zeros is exact knowledge.
/// One arctangent, two roots; no allocation.
///
/// Errors: Error::NotFinite; Error::InvalidOption, a baseline that is not above zero;
/// Error::InvalidCovariance; Error::HeadingUndetermined, tags in one place;
/// Error::BaselineMismatch, the measured distance departs from the baseline by more than five
/// standard deviations along it, what five across it add, and rounding; Error::NumericOverflow.
template <class S>
[[nodiscard]] Result<Pose2<S>> two_tag_pose(const Fix<S, 2>& left, const Fix<S, 2>& right,
                                            std::type_identity_t<S> baseline) {
  if (!std::isfinite(baseline)) return std::unexpected(Error::NotFinite);
  if (!(baseline > S(0))) return std::unexpected(Error::InvalidOption);
  if (const auto error = detail::check_tag(left)) return std::unexpected(*error);
  if (const auto error = detail::check_tag(right)) return std::unexpected(*error);

  const Vec<S, 2> across = right.position - left.position;
  const S length = norm(across);
  if (!std::isfinite(length)) return std::unexpected(Error::NumericOverflow);
  const S largest = std::max(norm(left.position), norm(right.position));
  const S rounding = S(4) * std::numeric_limits<S>::epsilon() * largest;
  if (!(length > rounding)) return std::unexpected(Error::HeadingUndetermined);

  const Mat<S, 2> sum = left.covariance + right.covariance;
  const Mat<S, 2> difference = right.covariance - left.covariance;
  const Vec<S, 2> n = across / length;
  const Vec<S, 2> t{-n[1], n[0]};
  const S along = std::max(detail::weighted_product(n, sum, n), S(0));
  const S aside = std::max(detail::weighted_product(t, sum, t), S(0));
  // |d n + e| = d + n·e + (t·e)²/2d + …
  constexpr S k = S(kBaselineSigmas);
  const S allowed = k * std::sqrt(along) + k * k * aside / (2 * baseline) + rounding;
  if (!(std::abs(length - baseline) <= allowed)) return std::unexpected(Error::BaselineMismatch);

  Pose2<S> pose;
  pose.position = left.position + S(0.5) * across;                 // (1)
  pose.heading = wrap_angle(std::atan2(across[0], -across[1]));    // (2)
  pose.covariance.template topLeftCorner<2, 2>() = S(0.25) * sum;  // (3)
  for (int i = 0; i < 2; ++i) {
    const S cross = (difference(i, 0) * t[0] + difference(i, 1) * t[1]) / (2 * baseline);
    pose.covariance(i, 2) = pose.covariance(2, i) = cross;
  }
  pose.covariance(2, 2) = aside / (baseline * baseline);
  if (!all_finite(pose.covariance)) return std::unexpected(Error::NumericOverflow);
  pose.covariance = without_rounding<S, 3>(pose.covariance);
  return pose;
}

}  // namespace uwbpos
