// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The descent that every maximum-likelihood solver shares. For residuals e of model h with
/// gradients g and variances σ² it needs, at a state x,
/// \f[ J = \sum g g^T / \sigma^2, \qquad \nabla = \sum g e / \sigma^2, \qquad
///     H = J - \sum \frac{e}{\sigma^2} \frac{\partial^2 h}{\partial x^2}, \qquad
///     H \, \Delta x = \nabla. \qquad (1) \f]
/// This is Newton's step: H adds to Gauss-Newton's J the curvature of the model, without which a
/// tag near the anchors' plane takes tens of steps. Where H is not positive or its step does not
/// help, J takes its place once; J creeps along a bent valley, such as the ring around an anchor
/// close by, so after that it is H, damped as Levenberg has it.

#include <algorithm>
#include <cmath>
#include <limits>

#include "uwbpos/core/linalg.hpp"
#include "uwbpos/core/result.hpp"

namespace uwbpos {

/// (1) at one state of N numbers.
template <class S, int N>
struct NormalEquations {
  Mat<S, N> information = Mat<S, N>::Zero();  ///< J, lower triangle
  Mat<S, N> hessian = Mat<S, N>::Zero();      ///< H, lower triangle
  Vec<S, N> gradient = Vec<S, N>::Zero();     ///< ∇
  S chi_squared = S(0);                       ///< what is made small
};

/// Where a descent ended, and J there.
template <class S, int N>
struct Minimum {
  Vec<S, N> state;        ///< the unknowns
  Mat<S, N> information;  ///< lower triangle
  S chi_squared;          ///< at the state, to first order in the last, negligible step
};

/// Whether a minimum determines its state, `from_middle` [m] away from the middle of anchors that
/// reach `reach` [m] around it. A descent that runs away comes to rest where nothing changes any
/// more; a tag out there is known by its direction alone. O(N³), no allocation.
template <class S, int N>
[[nodiscard]] bool is_determined(const Minimum<S, N>& found, const Vec<S, N>& from_middle,
                                 S reach) {
  const Ldlt<S, N> factor{found.information};
  if (!factor.positive_definite()) return false;
  const S away = squared_norm<S, N>(from_middle);
  return !(away > S(16) * reach * reach && factor.inverse().trace() > away);
}

namespace detail {

/// Which matrix the next step divides by: H; J once where that does not help; then H damped.
template <class S>
struct Descent {
  S damping = S(0);       ///< of H, in traces of J
  S last_damping = S(0);  ///< the last that helped
  bool newton = true;     ///< H as it is
  bool straight = true;   ///< and so was it for the last step that helped

  /// After a step that helped.
  void soften() {
    straight = newton;
    newton = true;
    if (damping > S(0)) last_damping = damping;
    damping = S(0);
  }
  /// After a matrix or a step that did not; false when there is nothing left to try.
  [[nodiscard]] bool harden() {
    constexpr S kLeast = S(1e-3);
    constexpr S kMost = S(1e6);
    const bool once = newton && straight;
    newton = false;
    if (once) return true;
    damping = damping > S(0) ? damping * S(4) : std::max(last_damping / S(8), kLeast);
    return damping < kMost;
  }
  /// Whether a small gain means a small error.
  [[nodiscard]] bool undamped() const { return damping <= S(1e-3); }

  /// The entry in row i ≥ j of the matrix to divide by; `trace` is that of J.
  template <int N>
  [[nodiscard, gnu::always_inline]] inline S entry(const NormalEquations<S, N>& normal, S trace,
                                                   int i, int j) const {
    if (!newton && !(damping > S(0))) return normal.information(i, j);
    return i == j ? normal.hessian(i, j) + damping * trace : normal.hessian(i, j);
  }
};

}  // namespace detail

/// Descends from `state` to the minimum in whose basin it lies. `evaluate(x)` returns the
/// `NormalEquations` at x; `rounding` [m] is the shortest step that the scalar can tell.
/// At most `max_iterations` evaluations, each with O(N³); one that has not helped costs another.
/// No allocation. Error::NotConverged.
template <class S, int N, class Evaluate>
[[nodiscard]] Result<Minimum<S, N>> minimise(const Evaluate& evaluate, Vec<S, N> state, S rounding,
                                             int max_iterations) {
  constexpr S kSmallStep = S(1e-8);  // a ten-thousandth of a standard deviation, squared
  constexpr S kContracts = S(0.01);
  detail::Descent<S> descent;
  Vec<S, N> trial = state;
  S allowed = std::numeric_limits<S>::infinity();  // χ² of a step that helps
  bool stepped = false;
  S last_gain = S(0);  // of the step to `trial`, where it is H's
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const NormalEquations<S, N> normal = evaluate(trial);
    if (!(normal.chi_squared <= allowed)) {
      if (!stepped || !descent.harden()) break;
      trial = state;
      allowed = std::numeric_limits<S>::infinity();
      stepped = false;
      last_gain = S(0);
      continue;
    }
    state = trial;
    if (stepped) descent.soften();
    const S trace = normal.information.trace();
    Vec<S, N> step;
    for (;;) {
      const Ldlt<S, N> factor{[&](int i, int j) __attribute__((always_inline)) {
        return descent.entry(normal, trace, i, j);
      }};
      if (factor.positive_definite()) {
        step = factor.solve(normal.gradient);
        break;
      }
      if (!descent.harden()) return std::unexpected(Error::NotConverged);
    }
    const S gain = dot(step, normal.gradient);
    // The gain that rounding of every residual pretends, where that is more.
    const S noise = trace * rounding * rounding;
    const S enough = std::max(kSmallStep, noise);
    // Newton's error e after a step is C e₀², e₀ that before it: two steps tell C.
    const bool settled = descent.newton && gain <= kContracts * last_gain &&
                         gain * gain * gain <= enough * last_gain * last_gain;
    if ((descent.undamped() && gain <= enough) || settled ||
        squared_norm(step) <= rounding * rounding) {
      return Minimum<S, N>{state + step, normal.information,
                           std::max(normal.chi_squared - gain, S(0))};
    }
    // No worse than what rounding of every residual may add to χ².
    allowed = normal.chi_squared + noise + S(2) * std::sqrt(normal.chi_squared * noise);
    last_gain = descent.newton ? gain : S(0);
    trial = state + step;
    stepped = true;
  }
  return std::unexpected(Error::NotConverged);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
