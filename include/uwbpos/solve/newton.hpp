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
  S chi_squared;          ///< before the last, negligible step
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

/// Descends from `state` to the minimum in whose basin it lies. `evaluate(x)` returns the
/// `NormalEquations` at x; `rounding` [m] is the shortest step that the scalar can tell.
/// At most `max_iterations` steps, tried or taken; each costs one evaluation and O(N³).
/// No allocation. Error::NotConverged.
template <class S, int N, class Evaluate>
[[nodiscard]] Result<Minimum<S, N>> minimise(const Evaluate& evaluate, Vec<S, N> state, S rounding,
                                             int max_iterations) {
  constexpr S kSmallStep = S(1e-8);  // a ten-thousandth of a standard deviation, squared
  constexpr S kLeastDamping = S(1e-3);
  constexpr S kMostDamping = S(1e6);
  NormalEquations<S, N> normal = evaluate(state);
  bool newton = true;    // the next step is H's; else J's, or with damping the damped H's
  bool straight = true;  // the last step was H's
  S damping = S(0);
  S last_damping = S(0);
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const S trace = normal.information.trace();
    Mat<S, N> matrix = newton || damping > S(0) ? normal.hessian : normal.information;
    for (int i = 0; i < N; ++i) matrix(i, i) += damping * trace;
    const Ldlt<S, N> factor{matrix};
    bool helps = factor.positive_definite();
    if (helps) {
      const Vec<S, N> step = factor.solve(normal.gradient);
      const S gain = dot(step, normal.gradient);
      // The gain that rounding of every residual pretends, where that is more.
      const S noise = trace * rounding * rounding;
      if ((damping <= kLeastDamping && gain <= std::max(kSmallStep, noise)) ||
          squared_norm(step) <= rounding * rounding) {
        // Newton squares what is left: after a step so small nothing need be evaluated again.
        return Minimum<S, N>{state + step, normal.information, normal.chi_squared};
      }
      const NormalEquations<S, N> next = evaluate(Vec<S, N>{state + step});
      // No worse than what rounding of every residual may add to χ².
      const S worst = std::sqrt(normal.chi_squared) + std::sqrt(noise);
      helps = next.chi_squared <= worst * worst;
      if (helps) {
        state += step;
        normal = next;
      }
    }
    if (helps) {
      straight = newton;
      newton = true;
      if (damping > S(0)) last_damping = damping;
      damping = S(0);
    } else if (newton && straight) {
      newton = false;
    } else {
      newton = false;
      damping = damping > S(0) ? damping * S(4) : std::max(last_damping / S(8), kLeastDamping);
      if (!(damping < kMostDamping)) break;
    }
  }
  return std::unexpected(Error::NotConverged);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
