// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// χ² of pseudoranges as a function of the position alone: the bias that suits a position best is
/// the weighted mean of what is left of the pseudoranges there. With e the residuals, g the unit
/// vectors, w = 1/σ², bars for weighted means, W = Σw and primes for what departs from the mean,
/// \f[ b(p) = \bar e, \qquad \nabla = \sum w g' e', \qquad J = \sum w g' g'^T, \qquad
///     H = J - \sum w e' (I - g g^T) / r, \qquad (1) \f]
/// \f[ \mathrm{cov}(p, b) = \begin{pmatrix} P & -P \bar g \\ \cdot & 1/W + \bar g^T P \bar g
///     \end{pmatrix}, \qquad P = J^{-1}. \qquad (2) \f]
/// This is the system of (p, b) with b eliminated, but from unit vectors that had what they share
/// taken off before they were squared: receivers that see the emitter in nearly one direction,
/// where float has no digits left for the full system, are solved all the same.

#include "uwbpos/core/lanes.hpp"
#include "uwbpos/model/pseudorange.hpp"
#include "uwbpos/model/range_terms.hpp"
#include "uwbpos/solve/newton.hpp"

namespace uwbpos {

/// A position and the bias that all ranges share. `position`, `bias` [m]; `covariance` of
/// (position, bias) [m²]; χ² at the solution; measurements − unknowns.
template <class S, int D>
struct BiasedFix {
  Vec<S, D> position;        ///< [m]
  S bias;                    ///< [m]
  Mat<S, D + 1> covariance;  ///< of (position, bias) [m²]
  S chi_squared;             ///< at the solution
  int degrees_of_freedom;    ///< measurements − unknowns
};

/// (1) at one position.
template <class S, int D>
struct PseudorangeProfile {
  NormalEquations<S, D> normal;  ///< ∇, J or H, χ²
  S bias;                        ///< b(p), relative to the mean pseudorange given [m]
  Vec<S, D> mean_gradient;       ///< ḡ
  S total_weight;                ///< W [1/m²]
};

/// (1) at `position`, relative to `center`; pseudoranges relative to `mean`. H has the curvature of
/// residuals at the bias `near` [m], relative to `mean`, which a descent knows from where it was
/// before; it is that of (1) at the minimum. O(n·D²), no allocation.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] PseudorangeProfile<S, D> pseudorange_profile(const V& view, const Vec<S, D>& center,
                                                           S mean, const Vec<S, D>& position,
                                                           Curvature curvature, S near) {
  // Departures from the first pseudorange's, then from the mean of those.
  const RangePrediction<S, D> first =
      predict_range<S, D>(position, Vec<S, D>{view[0].anchor - center});
  const S first_residual = (view[0].range - mean) - first.range;
  const S beyond = near - first_residual;
  const S bending = curvature == Curvature::Full ? S(1) : S(0);

  constexpr int kMean = D * (D + 1) / 2;  // Σ w g', after Σ w g' g'ᵀ + Σ b g gᵀ with b = w e / r
  constexpr int kPull = kMean + D;        // Σ w e' g'
  constexpr int kResidual = kPull + D;    // Σ w e'
  constexpr int kSquare = kResidual + 1;  // Σ w e'²
  constexpr int kWeight = kSquare + 1;    // Σ w
  constexpr int kBend = kWeight + 1;      // Σ b
  constexpr int kTurn = kBend + 1;        // Σ w / r
  const auto sums = sum_in_lanes<S, kTurn + 1>(
      view, [&](auto& sum, const auto& take, const auto& one) __attribute__((always_inline)) {
        using P = std::remove_cvref_t<decltype(one)>;
        const RangeTerms<P, D> r = range_terms<S, D>(position, center, take, one);
        const P range = take([](const auto& taken) { return taken.range; });
        const P e = ((range - mean) - r.distance) - first_residual;
        const P bend = bending * ((e - beyond) * r.turn);
        const P weighted = r.weight * e;
        Numbers<P, D> apart;
        unroll<D>([&](auto k) __attribute__((always_inline)) {
          apart[k] = r.gradient[k] - first.gradient[int(k)];
          sum[kMean + k] += r.weight * apart[k];
          sum[kPull + k] += weighted * apart[k];
        });
        add_lower<D, 0>(sum, apart, r.weight);
        add_lower<D, 0>(sum, r.gradient, bend);
        sum[kResidual] += weighted;
        sum[kSquare] += weighted * e;
        sum[kWeight] += r.weight;
        sum[kBend] += bend;
        sum[kTurn] += r.turn;
      });

  PseudorangeProfile<S, D> profile;
  NormalEquations<S, D>& normal = profile.normal;
  const S total = sums[kWeight];
  const S residual = sums[kResidual] / total;
#pragma GCC unroll 4
  for (int j = 0; j < D; ++j) {
    const S gradient = sums[kMean + j] / total;
    profile.mean_gradient[j] = first.gradient[j] + gradient;
    normal.gradient[j] = sums[kPull + j] - residual * sums[kMean + j];
#pragma GCC unroll 4
    for (int i = j; i < D; ++i) {
      normal.matrix(i, j) = sums[lower_index<D>(i, j)] - sums[kMean + i] * gradient;
    }
    normal.matrix(j, j) -= sums[kBend];
    normal.trace += normal.matrix(j, j);
  }
  // J's: unit vectors have trace 1, and so the bends.
  normal.trace += static_cast<S>(D - 1) * sums[kBend];
  // As of ranges, with g' for g.
  normal.third = (kThirdDerivative<S> + S(3) * norm(profile.mean_gradient)) * sums[kTurn];
  normal.chi_squared = std::max(sums[kSquare] - sums[kResidual] * residual, S(0));
  profile.bias = first_residual + residual;
  profile.total_weight = total;
  return profile;
}

/// The profile at `position`, with J, as a minimum of (position, bias). O(D²), no allocation.
template <class S, int D>
[[nodiscard]] Minimum<S, D + 1> with_bias(const PseudorangeProfile<S, D>& profile,
                                          const Vec<S, D>& position) {
  Minimum<S, D + 1> minimum;
  minimum.state << position, profile.bias;
  minimum.chi_squared = profile.normal.chi_squared;
  Vec<S, D + 1> gradient;
  gradient << profile.mean_gradient, S(1);
  minimum.information.setZero();
  minimum.information.template topLeftCorner<D, D>() = profile.normal.matrix;
  add_outer<S, D + 1>(minimum.information, gradient, profile.total_weight);
  return minimum;
}

/// (2) of a position's `covariance`, ḡ, which numbers index, and W. O(D²), no allocation.
template <class S, int D, class X>
[[nodiscard]] Mat<S, D + 1> covariance_with_bias(const Mat<S, D>& covariance,
                                                 const X& mean_gradient, S total_weight) {
  Mat<S, D + 1> both;
  S spread = S(1) / total_weight;
  for (int j = 0; j < D; ++j) {
    S shared = S(0);
    for (int k = 0; k < D; ++k) {
      both(k, j) = covariance(k, j);
      shared -= covariance(j, k) * mean_gradient[k];
    }
    both(j, D) = both(D, j) = shared;
    spread -= shared * mean_gradient[j];
  }
  both(D, D) = spread;
  return both;
}

/// The fix that `profile`, with J at `position`, describes. O(D³), no allocation.
/// Errors: Error::DegenerateGeometry, all unit vectors alike or in a cone; Error::NumericOverflow.
template <class S, int D>
[[nodiscard]] Result<BiasedFix<S, D>> make_biased_fix(const PseudorangeProfile<S, D>& profile,
                                                      const Vec<S, D>& center, S mean,
                                                      const Vec<S, D>& position,
                                                      int degrees_of_freedom) {
  const Ldlt<S, D> factor{profile.normal.matrix};
  if (!factor.positive_definite()) return std::unexpected(Error::DegenerateGeometry);
  const Mat<S, D> p = factor.inverse();
  BiasedFix<S, D> fix;
  // Unit vectors hold rounding errors; what departs from their mean by no more is nothing.
  constexpr S kRounding = S(64) * std::numeric_limits<S>::epsilon();
  for (int k = 0; k < D; ++k) {
    if (!(p(k, k) * profile.total_weight * kRounding * kRounding < S(1))) {
      return std::unexpected(Error::DegenerateGeometry);
    }
  }
  fix.covariance = covariance_with_bias<S, D>(p, profile.mean_gradient, profile.total_weight);
  fix.position = center + position;
  fix.bias = mean + profile.bias;
  fix.chi_squared = profile.normal.chi_squared;
  fix.degrees_of_freedom = degrees_of_freedom;
  if (!all_finite(fix.position) || !std::isfinite(fix.bias) || !all_finite(fix.covariance) ||
      !std::isfinite(fix.chi_squared)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return fix;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
