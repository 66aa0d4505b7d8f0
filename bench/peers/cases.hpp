// SPDX-License-Identifier: MIT
// The cases that all contenders solve, and what each contender promises.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <uwbpos/sim/noise.hpp>
#include <uwbpos/solve/locate.hpp>
#include <uwbpos/solve/tdoa_least_squares.hpp>
#include <uwbpos/solve/toa_least_squares.hpp>

namespace peers {

using uwbpos::Vec;
using Place = Vec<double, 3>;

inline constexpr int kAnchors = 8;
inline constexpr double kSigma = 0.1;  // [m] of one range or arrival

// One epoch of eight anchors: ranges to all, or differences of seven to the first.
struct Case {
  Place tag;
  Place start;  // the anchors' mean, where scripts start
  std::array<Place, kAnchors> anchors;
  std::array<double, kAnchors> ranges;
  std::vector<uwbpos::RangeTo<double, 3>> toa;
  std::vector<uwbpos::DifferenceTo<double, 3>> tdoa;
};

// A hall of 20 m × 15 m × 4 m, its anchors in the corners give or take 0.3 m, tags anywhere in it.
inline std::vector<Case> cases(std::size_t count) {
  uwbpos::sim::Random random{"peers"};
  std::vector<Case> all(count);
  for (Case& c : all) {
    c.tag = {random.uniform(1, 19), random.uniform(1, 14), random.uniform(0.5, 2)};
    c.start.setZero();
    for (std::size_t i = 0; i < kAnchors; ++i) {
      const double corner[3] = {((i & 1) ^ (i >> 1 & 1)) != 0 ? 20.0 : 0.0,
                                (i & 2) != 0 ? 15.0 : 0.0, (i & 4) != 0 ? 4.0 : 0.3};
      for (int k = 0; k < 3; ++k) c.anchors[i][k] = corner[k] + random.normal(0, 0.3);
      c.ranges[i] = (c.tag - c.anchors[i]).norm() + random.normal(0, kSigma);
      c.start += c.anchors[i] / kAnchors;
      c.toa.push_back({c.anchors[i], c.ranges[i], kSigma});
      if (i > 0) c.tdoa.push_back({c.anchors[i], c.ranges[i] - c.ranges[0]});
    }
  }
  return all;
}

// Residuals whose squares sum to χ², for any scalar: the peers' functors and the judge share them.
template <class T>
void toa_residuals(const Case& c, const T* p, T* out) {
  using std::sqrt;
  for (std::size_t i = 0; i < kAnchors; ++i) {
    const Place& a = c.anchors[i];
    const T x = p[0] - a[0];
    const T y = p[1] - a[1];
    const T z = p[2] - a[2];
    out[i] = (sqrt(x * x + y * y + z * z) - c.ranges[i]) * (1 / kSigma);
  }
}

// Differences share an arrival, Q = σ²(I + 11ᵀ): whitened by Q^(−1/2) = (I − c 11ᵀ)/σ with
// c = (1 − 1/√(n + 1))/n.
template <class T>
void tdoa_residuals(const Case& c, const T* p, T* out) {
  using std::sqrt;
  T far[kAnchors];
  for (std::size_t i = 0; i < kAnchors; ++i) {
    const Place& a = c.anchors[i];
    const T x = p[0] - a[0];
    const T y = p[1] - a[1];
    const T z = p[2] - a[2];
    far[i] = sqrt(x * x + y * y + z * z);
  }
  T sum = T(0);
  for (std::size_t i = 1; i < kAnchors; ++i) {
    out[i - 1] = (far[i] - far[0] - (c.ranges[i] - c.ranges[0])) * (1 / kSigma);
    sum += out[i - 1];
  }
  constexpr int n = kAnchors - 1;
  const double share = (1 - 1 / std::sqrt(n + 1.0)) / n;
  for (int i = 0; i < n; ++i) out[i] -= sum * share;
}

struct Toa {
  static constexpr int kResiduals = kAnchors;
  template <class T>
  static void residuals(const Case& c, const T* p, T* out) {
    toa_residuals(c, p, out);
  }
};
struct Tdoa {
  static constexpr int kResiduals = kAnchors - 1;
  template <class T>
  static void residuals(const Case& c, const T* p, T* out) {
    tdoa_residuals(c, p, out);
  }
};

template <class Problem>
double chi_squared(const Case& c, const Place& p) {
  double r[Problem::kResiduals];
  Problem::residuals(c, p.data(), r);
  double sum = 0;
  for (const double e : r) sum += e * e;
  return sum;
}

// The peers, all from `Case::start`, none with a covariance. Eigen's has the exact Jacobian.
template <class Problem>
Place ceres_solver(const Case& c);
template <class Problem>
Place ceres_tiny(const Case& c);
template <class Problem>
Place eigen_levenberg(const Case& c);

}  // namespace peers
