// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Loss functions that bound the pull of outliers: M-estimation after Huber (Ann. Math. Stat.
/// 35(1), 1964) and with Cauchy's density. For a residual u in standard deviations and a tuning k,
/// \f[ \rho_H = \begin{cases} u^2 & |u| \le k \\ 2k|u| - k^2 & \text{else,} \end{cases} \qquad
///     \rho_C = k^2 \ln(1 + u^2/k^2), \qquad w = \rho' / 2u. \f]
/// The default tunings keep 95 % of the efficiency of least squares where the noise is normal.

#include <cmath>
#include <cstdint>

#include "uwbpos/core/exponential.hpp"

namespace uwbpos {

/// Which loss a solver makes small.
enum class Loss : std::uint8_t {
  Squares,  ///< u²: maximum likelihood for normal noise
  Huber,    ///< bounded pull
  Cauchy    ///< a pull that fades: far outliers count for nothing
};

/// A loss and where it departs from squares.
template <class S>
struct RobustLoss {
  Loss loss = Loss::Squares;  ///< which
  S tuning = S(0);            ///< k, in standard deviations; 0: 1.345 for Huber, 2.385 for Cauchy
};

/// The loss of one residual and what a descent needs of it.
template <class S>
struct LossTerm {
  S cost;       ///< ρ(u)
  S weight;     ///< ρ'(u)/2u, in [0, 1]
  S curvature;  ///< ρ''(u)/2; negative beyond k for Cauchy
};

/// The term of a residual of `u` standard deviations. O(1).
template <class S>
[[nodiscard]] LossTerm<S> loss_term(const RobustLoss<S>& robust, S u) {
  const S square = u * u;
  if (robust.loss == Loss::Huber) {
    const S k = robust.tuning > S(0) ? robust.tuning : S(1.345);
    const S size = std::abs(u);
    if (size > k) return {k * (S(2) * size - k), k / size, S(0)};
  } else if (robust.loss == Loss::Cauchy) {
    const S k = robust.tuning > S(0) ? robust.tuning : S(2.385);
    const S share = square / (k * k);
    const S weight = S(1) / (S(1) + share);
    return {k * k * logarithm_of_one_plus(share), weight, weight * weight * (S(1) - share)};
  }
  return {square, S(1), S(1)};
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
