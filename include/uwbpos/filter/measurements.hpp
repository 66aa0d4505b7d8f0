// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a tracker is fed. Times are integers of microseconds from any epoch: a float of seconds
/// since start is off by milliseconds after three hours, which is centimetres.

#include <cmath>
#include <cstdint>
#include <optional>

#include "uwbpos/core/linalg.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/filter/factored_covariance.hpp"
#include "uwbpos/model/range_set.hpp"

namespace uwbpos {

/// The distance from a tag to an anchor.
template <class S>
struct TimedRange {
  std::int64_t time;      ///< [µs]
  std::uint32_t anchor;   ///< its id
  S range;                ///< [m]
  S sigma = S(0.1);       ///< [m]
  std::uint32_t tag = 0;  ///< which of the body's tags
};

/// How much farther a tag is from anchor b than from anchor a.
template <class S>
struct TimedDifference {
  std::int64_t time;       ///< [µs]
  std::uint32_t anchor_a;  ///< its id
  std::uint32_t anchor_b;  ///< its id
  S difference;            ///< |p − b| − |p − a| [m]
  S sigma = S(0.15);       ///< of the difference [m]
  std::uint32_t tag = 0;   ///< which of the body's tags
  /// True when all differences of this time, tag and `anchor_a` hold one and the same arrival at
  /// `anchor_a`: those of one blink against one reference. Their noise is then correlated,
  /// σ²/2 (I + 1 1ᵀ), and treated so.
  bool shared = false;
};

/// A sample of an inertial unit, in axes of the body: x forward, y left, z up.
template <class S>
struct ImuSample {
  std::int64_t time;        ///< [µs]
  Vec<S, 3> gyro;           ///< turn rate [rad/s]
  Vec<S, 3> accelerometer;  ///< specific force: (0, 0, +g) at rest [m/s²]
};

/// Whether units measure such numbers and bodies bear them: turns of at most 200 rad/s and forces
/// of at most 2000 m/s² about and along each axis. NaN is neither.
template <class S>
[[nodiscard]] bool is_bearable(const ImuSample<S>& sample) {
  constexpr S fastest = S(200);
  constexpr S hardest = S(2000);
  for (int k = 0; k < 3; ++k) {
    if (!(std::abs(sample.gyro[k]) <= fastest)) return false;
    if (!(std::abs(sample.accelerometer[k]) <= hardest)) return false;
  }
  return true;
}

/// The height of the body.
template <class S>
struct TimedHeight {
  std::int64_t time;  ///< [µs]
  S height;           ///< [m]
  S sigma = S(0.05);  ///< [m]
};

/// The direction of the body's x axis.
template <class S>
struct TimedHeading {
  std::int64_t time;  ///< [µs]
  S heading;          ///< from +x counter-clockwise; any turn [rad]
  S sigma = S(0.05);  ///< [rad]
};

/// The position of the body, from another system or a snapshot solver.
template <class S>
struct TimedPosition {
  std::int64_t time;     ///< [µs]
  Vec<S, 3> position;    ///< [m]; the third is not read in the plane
  Mat<S, 3> covariance;  ///< [m²], positive definite
};

/// The velocity of the body in axes of the map.
template <class S>
struct TimedVelocity {
  std::int64_t time;   ///< [µs]
  Vec<S, 3> velocity;  ///< [m/s]; the third is not read in the plane
  S sigma = S(0.1);    ///< of each component [m/s]
};

/// What a planar robot's odometry tells.
template <class S>
struct TimedSpeed {
  std::int64_t time;  ///< [µs]
  S speed;            ///< forward [m/s]
  S sigma = S(0.05);  ///< [m/s]
};

/// The turn rate of a planar robot, by odometry or gyro.
template <class S>
struct TimedTurnRate {
  std::int64_t time;  ///< [µs]
  S rate;             ///< counter-clockwise [rad/s]
  S sigma = S(0.02);  ///< [rad/s]
};

/// What is wrong with a standard deviation, or nothing: Error::NotFinite; Error::NonPositiveSigma,
/// below `kSmallestSigma`; Error::NumericOverflow, its square is none.
template <class S>
[[nodiscard]] std::optional<Error> check_sigma(S sigma) {
  if (!std::isfinite(sigma)) return Error::NotFinite;
  if (!(sigma >= kSmallestSigma<S>)) return Error::NonPositiveSigma;
  if (!std::isfinite(sigma * sigma)) return Error::NumericOverflow;
  return std::nullopt;
}

/// What is wrong with a value or its standard deviation, or nothing. Error::NotFinite; those of
/// `check_sigma`.
template <class S>
[[nodiscard]] std::optional<Error> check_measured(S value, S sigma) {
  if (!std::isfinite(value)) return Error::NotFinite;
  return check_sigma(sigma);
}

/// What D dimensions read of a position, the rest zero. O(D³). Errors: NotFinite;
/// InvalidCovariance; those of `check_sigma`, of the direction that is known best.
template <int D, class S>
[[nodiscard]] Result<TimedPosition<S>> checked(const TimedPosition<S>& m) {
  const Vec<S, D> part = m.position.template head<D>();
  const Mat<S, D> covariance = m.covariance.template topLeftCorner<D, D>();
  if (!all_finite(part)) return std::unexpected(Error::NotFinite);
  const auto factored = FactoredCovariance<S, D>::from_matrix(covariance);
  if (!factored) return std::unexpected(factored.error());
  const S thinnest = std::sqrt(factored->diagonal().minCoeff());
  if (const auto error = check_sigma(thinnest)) return std::unexpected(*error);
  TimedPosition<S> read{m.time, Vec<S, 3>::Zero(), Mat<S, 3>::Zero()};
  read.position.template head<D>() = part;
  read.covariance.template topLeftCorner<D, D>() =
      covariance.template selfadjointView<Eigen::Lower>();
  return read;
}

/// What D dimensions read of a velocity, the rest zero. O(D). Errors: NotFinite; those of
/// `check_sigma`.
template <int D, class S>
[[nodiscard]] Result<TimedVelocity<S>> checked(const TimedVelocity<S>& m) {
  const Vec<S, D> part = m.velocity.template head<D>();
  if (!all_finite(part)) return std::unexpected(Error::NotFinite);
  if (const auto error = check_sigma(m.sigma)) return std::unexpected(*error);
  TimedVelocity<S> read{m.time, Vec<S, 3>::Zero(), m.sigma};
  read.velocity.template head<D>() = part;
  return read;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
