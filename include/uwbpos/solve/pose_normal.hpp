// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The normal equations of a pose, for the descent of newton.hpp. The state is (p, Lψ): a heading
/// times the longest arm L is a length like the others. With A = (I, r') and G = (gᵀ, gᵀr') of
/// model/tag_range.hpp the model's curvature is
/// \f[ \frac{\partial^2 h}{\partial (p, \psi)^2} =
///     \frac{A^T A - G\,G^T}{h} - (g^T r)_{xy}\, e_\psi e_\psi^T. \qquad (1) \f]

#include <algorithm>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/model/tag_range.hpp"
#include "uwbpos/solve/newton.hpp"
#include "uwbpos/solve/pose_problem.hpp"

namespace uwbpos {

/// The normal equations at `state`. O(n·D²), no allocation.
template <class S, int D>
[[nodiscard]] NormalEquations<S, D + 1> pose_normal(const PoseProblem<S, D>& problem,
                                                    const Vec<S, D + 1>& state,
                                                    Curvature curvature) {
  constexpr int N = D + 1;
  const bool bent = curvature == Curvature::Full;
  const S unit = S(1) / problem.arm;
  const Turn<S> turn = turn_of(state[D] * unit);
  const Vec<S, D> position = state.template head<D>();
  NormalEquations<S, N> normal;
  S bends = S(0);
  S bends_x = S(0);
  S bends_y = S(0);
  S bends_turn = S(0);
  for (const TagRange<S, D>& r : problem.ranges) {
    const Vec<S, D> anchor = r.anchor - problem.center;
    const auto predicted = predict_tag_range<S, D>(position, turn, r.lever_arm, anchor);
    Vec<S, N> row;
    for (int k = 0; k < D; ++k) row[k] = predicted.gradient[k];
    row[D] = predicted.heading_gradient * unit;
    const S inverse = S(1) / r.sigma;
    // A range below zero would be a cusp at the anchor.
    const S residual = (std::max(r.range, S(0)) - predicted.range) * inverse;
    const LossTerm<S> term = loss_term(problem.robust, residual);
    const S weight = inverse * inverse;
    const S pull = term.weight * residual * inverse;
    normal.gradient += pull * row;
    normal.chi_squared += term.cost;
    const S bend = predicted.range > S(0) ? pull / predicted.range : S(0);
    const S informs = term.weight * weight;
    normal.trace += informs * squared_norm(row);
    if (!bent) {
      add_outer(normal.matrix, row, informs);
      continue;
    }
    add_outer(normal.matrix, row, term.curvature * weight + bend);
    // Aᵀ A and the last part of (1), summed.
    const S ax = -predicted.arm[1] * unit;
    const S ay = predicted.arm[0] * unit;
    bends += bend;
    bends_x += bend * ax;
    bends_y += bend * ay;
    const S outward = predicted.gradient[0] * ay - predicted.gradient[1] * ax;  // (gᵀr)_xy / L
    bends_turn += bend * (ax * ax + ay * ay) - pull * outward * unit;
  }
  for (int k = 0; k < D; ++k) normal.matrix(k, k) -= bends;
  normal.matrix(D, 0) -= bends_x;
  normal.matrix(D, 1) -= bends_y;
  normal.matrix(D, D) -= bends_turn;

  const auto know = [&](int k, const Knowledge<S>& known, S error) {
    if (known.pinned) {
      // No step along k, and no part of k in the others' steps.
      for (int i = 0; i < N; ++i) normal.matrix(std::max(i, k), std::min(i, k)) = S(0);
      normal.matrix(k, k) = normal.trace;
      normal.gradient[k] = S(0);
    } else if (known.information > S(0)) {
      normal.matrix(k, k) += known.information;
      normal.trace += known.information;
      normal.gradient[k] += known.information * error;
      normal.chi_squared += known.information * error * error;
    }
  };
  know(D, problem.heading,
       angle_difference(problem.heading.value * unit, state[D] * unit) * problem.arm);
  if constexpr (D == 3) know(2, problem.height, problem.height.value - state[2]);
  return normal;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
