// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The plain structs that every layer speaks in. Aggregates, fixed size, no allocation.

#include "uwbpos/core/eigen.hpp"

namespace uwbpos {

/// Column vector of D scalars.
template <class S, int D>
using Vec = Eigen::Matrix<S, D, 1>;

/// Square D × D matrix.
template <class S, int D>
using Mat = Eigen::Matrix<S, D, D>;

/// A scalar and the variance of its error, in the value's unit squared.
template <class S>
struct Measured {
  S value;     ///< the estimate
  S variance;  ///< of its error
};

/// A solved position in the anchors' frame.
template <class S, int D>
struct Fix {
  Vec<S, D> position;      ///< [m]
  Mat<S, D> covariance;    ///< of the position's error [m²]
  S chi_squared;           ///< sum of the squared normalised residuals at the solution
  int degrees_of_freedom;  ///< measurements − unknowns, what `chi_squared` should be near
};

/// Two points that explain the same measurements, equal when there is one answer.
template <class S, int D>
struct Mirror {
  Vec<S, D> first;   ///< [m]
  Vec<S, D> second;  ///< [m]
};

/// A planar pose.
template <class S>
struct Pose2 {
  Vec<S, 2> position;    ///< [m]
  S heading;             ///< from +x counter-clockwise, in (−π, π] [rad]
  Mat<S, 3> covariance;  ///< of (x, y, heading) [m², m·rad, rad²]
};

/// The pose of a body that stays level: a place in space and a heading.
template <class S>
struct LevelPose {
  Vec<S, 3> position;    ///< [m]
  S heading;             ///< from +x counter-clockwise seen from above, in (−π, π] [rad]
  Mat<S, 4> covariance;  ///< of (x, y, z, heading) [m², m·rad, rad²]
};

/// A range to a known point.
template <class S, int D>
struct RangeTo {
  Vec<S, D> anchor;  ///< where the point is [m]
  S range;           ///< distance to it, as measured [m]
  S sigma = S(0.1);  ///< standard deviation of the range [m]
};

/// A range from a tag on a body to a known point.
template <class S, int D>
struct TagRange {
  Vec<S, D> lever_arm;  ///< where on the body the tag is: x forward, y left, z up [m]
  Vec<S, D> anchor;     ///< where the point is [m]
  S range;              ///< distance between the two, as measured [m]
  S sigma = S(0.1);     ///< standard deviation of the range [m]
};

/// A range difference against a reference that others share: |p − `anchor`| − |p − reference| [m].
template <class S, int D>
struct DifferenceTo {
  Vec<S, D> anchor;  ///< where it is [m]
  S difference;      ///< farther than the reference by this [m]
};

/// A range difference of any two anchors: |p − `anchor_b`| − |p − `anchor_a`|.
template <class S, int D>
struct PairDifference {
  Vec<S, D> anchor_a;  ///< [m]
  Vec<S, D> anchor_b;  ///< [m]
  S difference;        ///< b is farther than a by this [m]
  S sigma = S(0.15);   ///< standard deviation of the difference [m]
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
