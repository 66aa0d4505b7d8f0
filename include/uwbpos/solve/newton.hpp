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
///
/// An evaluation makes one of the two matrices. The last one makes J, whose inverse is the
/// covariance; the H of the step before does for the last, short step.

#include <algorithm>
#include <cmath>
#include <limits>

#include "uwbpos/core/linalg.hpp"
#include "uwbpos/core/result.hpp"

namespace uwbpos {

/// Which matrix an evaluation makes.
enum class Curvature {
  Full,        ///< H
  Information  ///< J
};

/// (1) at one state of N numbers.
template <class S, int N>
struct NormalEquations {
  Mat<S, N> matrix = Mat<S, N>::Zero();    ///< H or J, lower triangle
  Vec<S, N> gradient = Vec<S, N>::Zero();  ///< ∇
  S trace = S(0);                          ///< of J
  /// t with |H(x + s) − H(x)| ≤ t |s| near x; infinite where nobody knows.
  S third = std::numeric_limits<S>::infinity();
  S chi_squared = S(0);  ///< what is made small
};

/// The third derivative of half of χ² by ranges is at most this times Σ w / d: of h² / 2 it is
/// 3 g (I − g gᵀ) / d along one direction, 3 · 2 / √27 at most.
template <class S>
inline constexpr S kThirdDerivative = S(1.1547005);

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
  /// Whether it is J.
  [[nodiscard]] bool gauss() const { return !newton && !(damping > S(0)); }
  /// Whether a small gain means a small error.
  [[nodiscard]] bool undamped() const { return damping <= S(1e-3); }
};

}  // namespace detail

/// Descends from `state` to the minimum in whose basin it lies. `evaluate(x, curvature)` returns
/// the `NormalEquations` at x; `rounding` [m] is the shortest step that the scalar can tell.
/// At most `max_iterations` evaluations, each with O(N³); two from a start within a standard
/// deviation or so. No allocation. Error::NotConverged.
template <class S, int N, class Evaluate>
[[nodiscard]] Result<Minimum<S, N>> minimise(const Evaluate& evaluate, Vec<S, N> state, S rounding,
                                             int max_iterations) {
  constexpr S kSmallStep = S(1e-8);   // a ten-thousandth of a standard deviation, squared
  constexpr S kSameMatrix = S(1e-6);  // a thousandth, squared
  constexpr S kHopeful = S(1e3);      // what bounds exceed as a rule, squared
  constexpr S kNever = std::numeric_limits<S>::infinity();
  detail::Descent<S> descent;
  Ldlt<S, N> factor;
  Vec<S, N> trial = state;
  S allowed = kNever;    // χ² of a step that helps
  S spread = S(0);       // of the state, by `factor`
  S change = kNever;     // of H, at most, by the step to `trial`, where that is H's
  S last_length = S(0);  // of the step to `trial`, squared
  bool stepped = false;  // `trial` is new
  bool certain = false;  // and the step to it negligible
  Curvature curvature = Curvature::Full;
  const auto again = [&](Curvature other) {
    trial = state;
    allowed = kNever;
    stepped = false;
    certain = false;
    last_length = S(0);
    change = kNever;
    curvature = other;
  };
  const auto made_of = [&] { return descent.gauss() ? Curvature::Information : Curvature::Full; };
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const NormalEquations<S, N>& normal = evaluate(trial, curvature);
    if (!(normal.chi_squared <= allowed)) {
      if (!stepped || !descent.harden()) break;
      again(made_of());
      continue;
    }
    state = trial;
    // J after a step of H: the last evaluation, if its step is as short as it should be.
    const bool last = stepped && descent.newton && curvature == Curvature::Information;
    if (stepped) descent.soften();
    if (!last) {
      do {
        const S damped = descent.damping * normal.trace;
        factor = Ldlt<S, N>{[&](int i, int j) __attribute__((always_inline)) {
          return i == j ? normal.matrix(i, j) + damped : normal.matrix(i, j);
        }};
      } while (!factor.positive_definite() && descent.harden() && curvature == made_of());
      if (!factor.positive_definite()) {
        if (curvature == made_of()) break;
        again(made_of());
        continue;
      }
    }
    const Vec<S, N> step = factor.solve(normal.gradient);
    const S gain = dot(step, normal.gradient);
    // The gain that rounding of every residual pretends, where that is more: less of it for an old
    // H, whose steps leave more. Exact measurements, which leave no χ², are worth exact answers.
    const S noise = normal.trace * rounding * rounding;
    const S enough =
        std::max(kSmallStep * std::min(normal.chi_squared, S(1)), last ? noise / S(16) : noise);
    const S length = squared_norm(step);
    const bool short_step = (descent.undamped() && gain <= enough) || length <= rounding * rounding;
    // What an old H leaves of a step, e = H⁻¹ ΔH s, and what the step changes of J.
    const S share = spread * normal.third;
    const bool settled = last && spread * change * change * length <= enough &&
                         share * share * length <= kSameMatrix;
    // Steps get shorter; one that does not, where J hardly holds a direction, is none.
    const bool shorter = length <= last_length;
    if (curvature == Curvature::Information && (((short_step || settled) && shorter) || certain)) {
      if (!shorter) return Minimum<S, N>{state, normal.matrix, normal.chi_squared};
      return Minimum<S, N>{state + step, normal.matrix, std::max(normal.chi_squared - gain, S(0))};
    }
    if (last) {
      again(Curvature::Full);
      continue;
    }
    // No worse than what rounding of every residual may add to χ².
    allowed = normal.chi_squared + noise + S(2) * std::sqrt(normal.chi_squared * noise);
    certain = short_step;
    bool near = short_step;
    change = kNever;
    if (descent.newton && normal.third < kNever) {
      change = normal.third * std::sqrt(length);
      spread = factor.inverse().trace();
      // The next step is this one's error, half of H⁻¹ ΔH s.
      const S next = spread * change * change;
      near = near || S(0.25) * spread * next * next * length <= kHopeful * enough;
    }
    trial = state + step;
    last_length = length;
    stepped = true;
    curvature = near ? Curvature::Information : Curvature::Full;
  }
  return std::unexpected(Error::NotConverged);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
