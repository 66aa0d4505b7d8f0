// SPDX-License-Identifier: MIT
#pragma once

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
  S value;
  S variance;
};

/// A solved position in the anchors' frame.
/// `position` [m]; `covariance` [m²] of its error; `chi_squared`: the sum of squared normalised
/// residuals at the solution; `degrees_of_freedom`: measurements − unknowns, what `chi_squared`
/// should be near.
template <class S, int D>
struct Fix {
  Vec<S, D> position;
  Mat<S, D> covariance;
  S chi_squared;
  int degrees_of_freedom;
};

/// Two points that explain the same measurements, equal when there is one answer.
template <class S, int D>
struct Mirror {
  Vec<S, D> first;
  Vec<S, D> second;
};

/// A planar pose: `position` [m], `heading` [rad] from +x counter-clockwise in (−π, π],
/// `covariance` of (x, y, heading) [m², m·rad, rad²].
template <class S>
struct Pose2 {
  Vec<S, 2> position;
  S heading;
  Mat<S, 3> covariance;
};

/// A range to a known point: `anchor` and `range` [m], `sigma` its standard deviation [m].
template <class S, int D>
struct RangeTo {
  Vec<S, D> anchor;
  S range;
  S sigma = S(0.1);
};

}  // namespace uwbpos
