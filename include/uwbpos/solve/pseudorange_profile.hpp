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

#include "uwbpos/model/pseudorange.hpp"
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
  NormalEquations<S, D> normal;  ///< ∇, J, H, χ²
  S bias;                        ///< b(p), relative to the mean pseudorange given [m]
  Vec<S, D> mean_gradient;       ///< ḡ
  S total_weight;                ///< W [1/m²]
};

/// (1) at `position`, relative to `center`; pseudoranges relative to `mean`. O(n·D²), no
/// allocation.
template <class S, int D, PseudorangeView<S, D> V>
[[nodiscard]] PseudorangeProfile<S, D> pseudorange_profile(const V& view, const Vec<S, D>& center,
                                                           S mean, const Vec<S, D>& position) {
  // Departures from the first pseudorange's, then from the mean of those.
  PseudorangeProfile<S, D> profile;
  NormalEquations<S, D>& normal = profile.normal;
  Vec<S, D> first_gradient = Vec<S, D>::Zero();
  S first_residual = S(0);
  Vec<S, D> gradients = Vec<S, D>::Zero();
  S residuals = S(0);
  S total = S(0);
  NormalEquations<S, D> bends;  // Σ w (I − g gᵀ)/r in `hessian`; Σ w e (I − g gᵀ)/r beside it
  for (std::size_t i = 0; i < view.size(); ++i) {
    const RangeTo<S, D>& r = view[i];
    const Vec<S, D> anchor = r.anchor - center;
    const RangePrediction<S, D> predicted = predict_range(position, anchor);
    const S residual = (r.range - mean) - predicted.range;
    if (i == 0) {
      first_gradient = predicted.gradient;
      first_residual = residual;
    }
    const S weight = S(1) / (r.sigma * r.sigma);
    const Vec<S, D> gradient = predicted.gradient - first_gradient;
    const S e = residual - first_residual;
    add_outer(normal.information, gradient, weight);
    gradients += weight * gradient;
    residuals += weight * e;
    normal.gradient += (weight * e) * gradient;
    normal.chi_squared += weight * e * e;
    total += weight;
    const S bend = predicted.range > S(0) ? weight / predicted.range : S(0);
    add_outer<S, D>(bends.hessian, predicted.gradient, -bend);
    add_outer<S, D>(bends.information, predicted.gradient, -bend * e);
    for (int k = 0; k < D; ++k) {
      bends.hessian(k, k) += bend;
      bends.information(k, k) += bend * e;
    }
  }
  gradients /= total;
  residuals /= total;
  add_outer<S, D>(normal.information, gradients, -total);
  normal.gradient -= (total * residuals) * gradients;
  normal.chi_squared = std::max(normal.chi_squared - total * residuals * residuals, S(0));
  normal.hessian = normal.information - (bends.information - residuals * bends.hessian);
  profile.bias = first_residual + residuals;
  profile.mean_gradient = first_gradient + gradients;
  profile.total_weight = total;
  return profile;
}

/// The profile at `position` as a minimum of (position, bias), J with its bias. O(D²), no
/// allocation.
template <class S, int D>
[[nodiscard]] Minimum<S, D + 1> with_bias(const PseudorangeProfile<S, D>& profile,
                                          const Vec<S, D>& position) {
  Minimum<S, D + 1> minimum;
  minimum.state << position, profile.bias;
  minimum.chi_squared = profile.normal.chi_squared;
  Vec<S, D + 1> gradient;
  gradient << profile.mean_gradient, S(1);
  minimum.information.setZero();
  minimum.information.template topLeftCorner<D, D>() = profile.normal.information;
  add_outer<S, D + 1>(minimum.information, gradient, profile.total_weight);
  return minimum;
}

/// The fix that `profile`, at `position`, describes. O(D³), no allocation.
/// Errors: Error::DegenerateGeometry, all unit vectors alike or in a cone; Error::NumericOverflow.
template <class S, int D>
[[nodiscard]] Result<BiasedFix<S, D>> make_biased_fix(const PseudorangeProfile<S, D>& profile,
                                                      const Vec<S, D>& center, S mean,
                                                      const Vec<S, D>& position,
                                                      int degrees_of_freedom) {
  const Ldlt<S, D> factor{profile.normal.information};
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
  S spread = S(1) / profile.total_weight;
  for (int j = 0; j < D; ++j) {
    S shared = S(0);
    for (int k = 0; k < D; ++k) {
      fix.covariance(k, j) = p(k, j);
      shared -= p(j, k) * profile.mean_gradient[k];
    }
    fix.covariance(j, D) = fix.covariance(D, j) = shared;
    spread -= shared * profile.mean_gradient[j];
  }
  fix.covariance(D, D) = spread;
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
