// SPDX-License-Identifier: MIT
// ceres::Solver (automatic derivatives, DENSE_QR) and ceres::TinySolver, as their manuals have it:
// one block of residuals, defaults else, no logging.
#include <ceres/ceres.h>
#include <ceres/tiny_solver.h>
#include <ceres/tiny_solver_autodiff_function.h>

#include "cases.hpp"

namespace peers {

namespace {

template <class Problem>
struct Functor {
  const Case* epoch;
  template <class T>
  bool operator()(const T* const p, T* out) const {
    Problem::residuals(*epoch, p, out);
    return true;
  }
};

}  // namespace

template <class Problem>
Place ceres_solver(const Case& c) {
  using Cost = ceres::AutoDiffCostFunction<Functor<Problem>, Problem::kResiduals, 3>;
  Place p = c.start;
  ceres::Problem problem;
  problem.AddResidualBlock(new Cost(new Functor<Problem>{&c}), nullptr, p.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return p;
}

template <class Problem>
Place ceres_tiny(const Case& c) {
  using Function = ceres::TinySolverAutoDiffFunction<Functor<Problem>, Problem::kResiduals, 3>;
  const Functor<Problem> functor{&c};
  const Function function(functor);
  ceres::TinySolver<Function> solver;
  Place p = c.start;
  solver.Solve(function, &p);
  return p;
}

template Place ceres_solver<Toa>(const Case& c);
template Place ceres_solver<Tdoa>(const Case& c);
template Place ceres_tiny<Toa>(const Case& c);
template Place ceres_tiny<Tdoa>(const Case& c);

}  // namespace peers
