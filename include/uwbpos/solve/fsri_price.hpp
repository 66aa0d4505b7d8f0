// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What an explanation of a shot of ultrasound costs. With m_i waves added to length i, a repair
/// costs
/// \f[ J = \chi^2(p, q) + c \Big( \sum |m_i| + \sum_k \max(0, m_{(k)} - m_{(k+1)}) \Big)
///         + \frac{d^2}{1 + d^2/16}, \qquad 0 \le q \le q_{max}, \qquad (1) \f]
/// (k) by descending length, c `kWaveCost`, d the distance from a prior position over its sigma:
/// −2 log of its likelihood, but that a prior which is far off loses its say. Lag grows with
/// distance, so the second sum should be zero. Where nothing but q is left to judge by it must be
/// (the paper's rule); a residual or a prior may overrule it. A q outside its bounds by δ is
/// brought back at the price δ²/var q, as long as that may be noise.

#include <algorithm>
#include <cmath>
#include <limits>

#include "uwbpos/solve/fsri_waves.hpp"
#include "uwbpos/solve/pseudorange_least_squares.hpp"

namespace uwbpos {

/// One way to explain a shot.
template <class S, int D>
struct FsriExplanation {
  BiasedFix<S, D> fix;  ///< of position and lag, the lag within its bounds
  FsriWaves repair;     ///< waves added to each length
  S cost;               ///< J of (1)

  /// None, at infinite cost.
  [[nodiscard]] static FsriExplanation nothing() {
    return {{Vec<S, D>::Zero(), S(0), Mat<S, D + 1>::Zero(), S(0), 0},
            {},
            std::numeric_limits<S>::infinity()};
  }
};

/// ν²/var ν of a length [m] that a fix of position and q predicts. O(D²), no allocation.
template <class S, int D>
[[nodiscard]] S squared_innovation(const BiasedFix<S, D>& fix, const Vec<S, D>& receiver, S length,
                                   S sigma) {
  const auto predicted = predict_pseudorange<S, D>(fix.position, fix.bias, receiver);
  const S off = length - predicted.pseudorange;
  S variance = sigma * sigma;
  for (int r = 0; r <= D; ++r) {
    for (int c = 0; c <= D; ++c) {
      variance += predicted.gradient[r] * fix.covariance(r, c) * predicted.gradient[c];
    }
  }
  return off * off / variance;
}

/// The price list of one shot of `count` receivers; refers to its options.
template <class S, int D>
class FsriPrice {
 public:
  /// `max_lag` of the options resolved.
  FsriPrice(const FsriOptions<S, D>& options, int count) : options_{options}, count_{count} {}

  /// χ² that is taken for noise.
  [[nodiscard]] S most() const { return most_of(freedom_of(count_)); }

  /// The cheapest common number of waves for a fix of the first `joined` receivers.
  /// O(n · max_repair), no allocation.
  [[nodiscard]] FsriExplanation<S, D> operator()(const WaveAssignment<S, D>& waves,
                                                 const BiasedFix<S, D>& fix, std::size_t joined,
                                                 int disorder) const {
    FsriExplanation<S, D> found = FsriExplanation<S, D>::nothing();
    // Where all move alike there is nothing to choose, and q may be out of bounds by noise.
    const S most = waves.alike(joined) ? most_of(freedom_of(count_) + 1) : this->most();
    for (int shift = -options_.max_repair; shift <= options_.max_repair; ++shift) {
      const int moved = waves.moved(joined, shift);
      if (moved == WaveAssignment<S, D>::kTooMany) continue;
      const S lag = fix.bias + static_cast<S>(shift) * options_.wavelength;
      const S bounded = std::clamp(lag, S(0), *options_.max_lag);
      const S outside = (lag - bounded) / fix.covariance(D, D);
      const S chi_squared = fix.chi_squared + outside * (lag - bounded);
      if (chi_squared > most) continue;
      Vec<S, D> position = fix.position;
      for (int k = 0; k < D; ++k) position[k] -= fix.covariance(D, k) * outside;
      S cost = chi_squared + kWaveCost<S> * static_cast<S>(moved + disorder);
      if (options_.prior && joined == static_cast<std::size_t>(count_)) {
        const Vec<S, D> off = (position - *options_.prior) / options_.prior_sigma;
        const S squares = squared_norm(off);
        cost += squares / (S(1) + squares / S(16));
      }
      if (!(cost < found.cost)) continue;
      found = {fix, waves.shifted(shift), cost};
      found.fix.position = position;
      found.fix.bias = bounded;
      found.fix.chi_squared = chi_squared;
    }
    return found;
  }

 private:
  [[nodiscard]] static int freedom_of(int count) { return count - (D + 1); }

  // χ² of f degrees of freedom that noise exceeds but once in 10⁴.
  [[nodiscard]] static S most_of(int f) { return S(1) + S(2 * f) + S(8) * std::sqrt(S(2 * f)); }

  const FsriOptions<S, D>& options_;
  int count_;
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
