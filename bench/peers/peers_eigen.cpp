// SPDX-License-Identifier: MIT
// Eigen's unsupported Levenberg-Marquardt (MINPACK's), with the exact Jacobian by Eigen's own
// automatic derivatives.
#include <Eigen/Dense>
#include <unsupported/Eigen/AutoDiff>
#include <unsupported/Eigen/NonLinearOptimization>

#include "cases.hpp"

namespace peers {

namespace {

template <class Problem>
struct Functor {
  const Case* epoch;
  [[nodiscard]] int values() const { return Problem::kResiduals; }
  int operator()(const Eigen::VectorXd& p, Eigen::VectorXd& out) const {
    Problem::residuals(*epoch, p.data(), out.data());
    return 0;
  }
  int df(const Eigen::VectorXd& p, Eigen::MatrixXd& jacobian) const {
    using Dual = Eigen::AutoDiffScalar<Eigen::Vector3d>;
    Dual x[3];
    Dual out[Problem::kResiduals];
    for (int k = 0; k < 3; ++k) x[k] = Dual(p[k], 3, k);
    Problem::residuals(*epoch, x, out);
    for (int i = 0; i < Problem::kResiduals; ++i) {
      jacobian.row(i) = out[i].derivatives().transpose();
    }
    return 0;
  }
};

}  // namespace

template <class Problem>
Place eigen_levenberg(const Case& c) {
  Functor<Problem> functor{&c};
  Eigen::LevenbergMarquardt<Functor<Problem>> solver(functor);
  Eigen::VectorXd p = c.start;
  solver.minimize(p);
  return p;
}

template Place eigen_levenberg<Toa>(const Case& c);
template Place eigen_levenberg<Tdoa>(const Case& c);

}  // namespace peers
