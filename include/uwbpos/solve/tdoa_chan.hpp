// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Chan's two-stage weighted least squares for range differences (Chan, Ho, IEEE Trans. Signal
/// Process. 42(8), 1994; patent 001). With \f$ u_i = a_i - a_0, \; K_i = |u_i|^2, \; s = p - a_0
/// \f$ and \f$ r_0 = |s| \f$ taken for an unknown of its own, rows \f$ A_i = (u_i^T, d_i) \f$:
/// \f[ u_i^T s + d_i r_0 = \tfrac12 (K_i - d_i^2), \qquad
///     \theta_1 = (s; r_0) = (A^T \Psi^{-1} A)^{-1} A^T \Psi^{-1} h, \qquad
///     \Psi = B Q B, \quad B = \operatorname{diag}(r_i), \quad Q = \sigma^2 (I + 1 1^T). \quad (1)
///     \f]
/// First with B = I, then with the ranges found: the patent's matrices, Q⁻¹ = (I − 11ᵀ/n)/σ²
/// applied without being formed. **Stage 2** restores \f$ g = |s|^2 - r_0^2 = 0 \f$ at least cost
/// in the metric of stage 1 (from the point of its weakest line where g = 0), \f$ P = (A^T
/// \Psi^{-1} A)^{-1} \f$, with G the gradient of g at θ:
/// \f[ \theta \leftarrow \theta_1 - P G^T (G P G^T)^{-1} (g(\theta) + G (\theta_1 - \theta)).
///     \qquad (2) \f]
/// The patent squares the components of (s; r₀), solves them against [1 0; 0 1; 1 1] weighted by
/// \f$ \Psi_2 = 4 B_2 P B_2, \; B_2 = \operatorname{diag}(s, r_0) \f$, and takes signed roots. To
/// first order that is the same constrained minimum (its weights are those of P carried through the
/// squares); but Ψ₂ is singular where a component of s is zero, on the axes through a₀, and (2) is
/// not. The covariance is that of s with r₀ bound to |s|: \f$ (E^T P^{-1} E)^{-1} \f$, E = (I;
/// sᵀ/|s|).

#include <tuple>
#include <utility>

#include "uwbpos/solve/tdoa_least_squares.hpp"

namespace uwbpos {

/// Stage 1: normal matrix AᵀΨ⁻¹A (lower triangle) and AᵀΨ⁻¹h, for ranges rᵢ = `theta`[D] + dᵢ, or
/// B = I without `theta`. O(n·D²), no allocation.
template <class S, int D>
[[nodiscard]] std::pair<Mat<S, D + 1>, Vec<S, D + 1>> chan_normal(const DifferenceView<S, D>& view,
                                                                  const Vec<S, D + 1>* theta) {
  Mat<S, D + 1> normal = Mat<S, D + 1>::Zero();
  Vec<S, D + 1> rhs = Vec<S, D + 1>::Zero();
  Vec<S, D + 1> sum = Vec<S, D + 1>::Zero();
  S sum_h = S(0);
  for (const DifferenceTo<S, D>& d : view.differences) {
    const Vec<S, D> u = d.anchor - view.reference;
    // A range of less than a sigma would weigh without bound.
    const S range = theta ? std::max((*theta)[D] + d.difference, view.sigma) : S(1);
    Vec<S, D + 1> row;
    for (int k = 0; k < D; ++k) row[k] = u[k] / range;
    row[D] = d.difference / range;
    const S h = (squared_norm(u) - d.difference * d.difference) / (S(2) * range);
    add_outer(normal, row, S(1));
    rhs += h * row;
    sum += row;
    sum_h += h;
  }
  const S share = S(1) / static_cast<S>(view.size());
  add_outer(normal, sum, -share);
  rhs -= (share * sum_h) * sum;
  const S weight = S(1) / (view.sigma * view.sigma);
  return {normal * weight, rhs * weight};
}

/// The point of the line that satisfies g = 0 with ranges that are not negative and lies nearest to
/// what the linear system says; the point nearest to g = 0 where noise leaves no such root.
/// O(n), no allocation. Error::AmbiguousSolution, two such points and a system that says nothing.
template <class S, int D>
[[nodiscard]] Result<Vec<S, D + 1>> chan_root(const DifferenceView<S, D>& view,
                                              const WeakLine<S, D + 1>& line) {
  const S a = space_time_product<S, D + 1>(line.direction, line.direction);
  const S h = space_time_product<S, D + 1>(line.foot, line.direction);
  const S c = space_time_product<S, D + 1>(line.foot, line.foot);
  const S discriminant = h * h - a * c;
  const S sum = -(h + std::copysign(std::sqrt(std::max(discriminant, S(0))), h));
  const S taus[2] = {sum / a, c / sum};
  Vec<S, D + 1> best;
  S nearest = std::numeric_limits<S>::infinity();
  int found = 0;
  for (const S tau : taus) {
    if (!(discriminant > S(0)) || !std::isfinite(tau)) continue;
    const Vec<S, D + 1> theta = line.foot + tau * line.direction;
    S shortest = theta[D];
    for (const DifferenceTo<S, D>& d : view.differences) {
      shortest = std::min(shortest, theta[D] + d.difference);
    }
    if (shortest < -S(3) * view.sigma) continue;
    ++found;
    const S distance = std::abs(tau - line.linear);
    if (distance < nearest) {
      nearest = distance;
      best = theta;
    }
  }
  const bool silent = !(line.information > S(0));
  if (found == 2 && silent) return std::unexpected(Error::AmbiguousSolution);
  if (found == 0) best = line.foot + (silent ? -h / a : line.linear) * line.direction;
  return best;
}

namespace detail {

/// `tdoa_chan` for one scalar and dimension.
template <class S, int D>
Result<Fix<S, D>> tdoa_chan(const Vec<S, D>& reference, DifferenceSpan<S, D> span, S sigma) {
  if (const auto error = check_differences<S, D>(reference, span, sigma, D + 1)) {
    return std::unexpected(*error);
  }
  const DifferenceView<S, D> view{reference, span, sigma};
  auto [normal, rhs] = chan_normal<S, D>(view, nullptr);
  Vec<S, D + 1> theta = Vec<S, D + 1>::Zero();
  for (int pass = 0; pass < 2; ++pass) {
    const Result<WeakLine<S, D + 1>> line = weak_line<S, D + 1>(normal, rhs);
    if (!line) return std::unexpected(line.error());
    const Result<Vec<S, D + 1>> root = chan_root<S, D>(view, *line);
    if (!root) return std::unexpected(root.error());
    theta = *root;
    if (pass == 0) std::tie(normal, rhs) = chan_normal<S, D>(view, &theta);
  }
  if (const Ldlt<S, D + 1> factor{normal}; factor.positive_definite()) {
    const Vec<S, D + 1> first = factor.solve(rhs);
    for (int iteration = 0; iteration < 3; ++iteration) {  // (2)
      Vec<S, D + 1> gradient = S(2) * theta;
      gradient[D] = -gradient[D];
      const S constraint = space_time_product<S, D + 1>(theta, theta);
      const Vec<S, D + 1> gain = factor.solve(gradient);
      const Vec<S, D + 1> back = first - theta;
      theta = first - gain * ((constraint + dot(gradient, back)) / dot(gradient, gain));
    }
  }

  // Eᵀ P⁻¹ E.
  Vec<S, D> s;
  for (int k = 0; k < D; ++k) s[k] = theta[k];
  const S range = norm(s);
  if (!(range > S(0))) return std::unexpected(Error::DegenerateGeometry);
  Mat<S, D> information;
  for (int j = 0; j < D; ++j) {
    for (int i = j; i < D; ++i) {
      information(i, j) = normal(i, j) + (s[i] * normal(D, j) + s[j] * normal(D, i)) / range +
                          normal(D, D) * s[i] * s[j] / (range * range);
    }
  }
  const Ldlt<S, D> factor{information};
  if (!factor.positive_definite()) return std::unexpected(Error::DegenerateGeometry);
  Fix<S, D> fix{reference + s, factor.inverse(), S(0), static_cast<int>(span.size()) - D};
  fix.chi_squared = difference_chi_squared<S, D>(view, fix.position);
  if (!all_finite(fix.position) || !all_finite(fix.covariance) || !std::isfinite(fix.chi_squared)) {
    return std::unexpected(Error::NumericOverflow);
  }
  return fix;
}

}  // namespace detail

/// Position [m] from n ≥ D + 1 differences |p − aᵢ| − |p − reference| [m] of arrivals with standard
/// deviation `sigma` [m], to anchors that span the space, in closed form. Reaches the bound inside
/// the anchors' hull while noise is small; at a wall its error can be many times the bound, where
/// `locate` is right. Where all differences are equal stage 1 is singular, and g = 0 on the line
/// that it leaves answers instead. O(n·D²), no allocation. Errors: those of `check_differences`;
/// Error::DegenerateGeometry; Error::AmbiguousSolution, equal differences and two positions;
/// Error::InconsistentRanges; Error::NumericOverflow.
template <DifferenceSet R>
[[nodiscard]] auto tdoa_chan(
    const std::type_identity_t<Vec<DifferenceScalar<R>, kDifferenceDimension<R>>>& reference,
    const R& differences, std::type_identity_t<DifferenceScalar<R>> sigma)
    -> Result<Fix<DifferenceScalar<R>, kDifferenceDimension<R>>> {
  return detail::tdoa_chan<DifferenceScalar<R>, kDifferenceDimension<R>>(
      reference, as_difference_span(differences), sigma);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
