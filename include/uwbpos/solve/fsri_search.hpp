// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Which whole waves to move, by branch and bound. With m_i waves added to length i, a repair costs
/// \f[ J = \chi^2(p, q) + c \Big( \sum |m_i| + \sum_k \max(0, m_{(k)} - m_{(k+1)}) \Big)
///         + |p - p_0|^2 / \sigma_0^2, \qquad 0 \le q \le q_{max}, \qquad (1) \f]
/// (k) by descending length, c `kWaveCost`, p₀ a prior position: −2 log of its likelihood. Lag
/// grows with distance, so the second sum should be zero. Where nothing but q is left to judge
/// by it must be (the paper's rule); a residual or a prior may overrule it.
///
/// A wave more for all is a wave more of q at the same p, so repairs are sought up to a common
/// number and that is chosen afterwards. A q outside its bounds by δ is brought back at the price
/// δ²/var q. χ² of some receivers bounds that of all from below, as do their waves: receivers join
/// one by one, and a branch is left once its bound exceeds the best J by `kDoubtfulCost`.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "uwbpos/solve/fsri_options.hpp"
#include "uwbpos/solve/pseudorange_least_squares.hpp"
#include "uwbpos/solve/receiver_array.hpp"

namespace uwbpos {

/// Whole waves of each receiver.
using FsriWaves = std::array<int, kMaxFsriReceivers>;

/// The first `count` receivers in an order, their lengths repaired, as pseudoranges.
template <class S, int D>
struct RepairedLengths {
  std::span<const Vec<S, D>> receivers;  ///< [m]
  std::span<const S> lengths;            ///< [m]
  const FsriWaves& order;                ///< places of receivers
  const FsriWaves& waves;                ///< of each place
  std::size_t count;                     ///< how many
  S wavelength;                          ///< [m]
  S sigma;                               ///< of each length [m]

  /// How many there are.
  [[nodiscard]] std::size_t size() const { return count; }
  /// Entry `i` of the pseudoranges.
  [[nodiscard]] RangeTo<S, D> operator[](std::size_t i) const {
    const auto place = static_cast<std::size_t>(order[i]);
    return {receivers[place], lengths[place] + wavelength * static_cast<S>(waves[place]), sigma};
  }
};

/// One way to explain a shot.
template <class S, int D>
struct FsriExplanation {
  BiasedFix<S, D> fix;  ///< of position and lag, the lag within its bounds
  FsriWaves repair;     ///< waves added to each length
  S cost;               ///< J of (1)
};

/// The search itself; one object, one shot. About 1 kB, no allocation, recursion as deep as there
/// are receivers.
template <class S, int D>
class FsriSearch {
 public:
  /// Of checked input; `max_lag` and `sigma` resolved.
  FsriSearch(std::span<const Vec<S, D>> receivers, std::span<const S> lengths,
             const ReceiverArray<S, D>& array, const FsriOptions<S, D>& options)
      : receivers_{receivers}, lengths_{lengths}, array_{array}, options_{options} {
    sort_by_length();
    spread_out();
  }

  /// Searches; afterwards `best` and `other` are known.
  /// Errors: Error::NoRepairFits; that of the lengths as they are, when none could be solved.
  [[nodiscard]] Result<void> run() {
    waves_[static_cast<std::size_t>(order_[0])] = 0;
    in_order_ = true;
    join(1);
    if (static_cast<int>(lengths_.size()) > D + 1 || options_.prior) {
      in_order_ = false;
      join(1);
    }
    if (best_.cost < std::numeric_limits<S>::infinity()) return {};
    return std::unexpected(solved_ ? Error::NoRepairFits : first_error_);
  }

  /// The likeliest explanation.
  [[nodiscard]] const FsriExplanation<S, D>& best() const { return best_; }
  /// The next, of infinite cost if there is none.
  [[nodiscard]] const FsriExplanation<S, D>& other() const { return other_; }

 private:
  using State = Vec<S, D + 1>;

  // Places by descending length.
  void sort_by_length() {
    for (std::size_t i = 0; i < lengths_.size(); ++i) by_length_[i] = static_cast<int>(i);
    std::sort(by_length_.begin(), by_length_.begin() + static_cast<std::ptrdiff_t>(lengths_.size()),
              [&](int a, int b) {
                const S first = lengths_[static_cast<std::size_t>(a)];
                const S second = lengths_[static_cast<std::size_t>(b)];
                return first != second ? first > second : a < b;
              });
  }

  // Each next receiver as far as can be from those before it, that few determine a position well.
  void spread_out() {
    std::array<S, kMaxFsriReceivers> apart;
    const std::size_t n = lengths_.size();
    for (std::size_t i = 0; i < n; ++i) apart[i] = squared_norm<S, D>(receivers_[i] - array_.center);
    for (std::size_t k = 0; k < n; ++k) {
      std::size_t farthest = 0;
      for (std::size_t i = 1; i < n; ++i) farthest = apart[i] > apart[farthest] ? i : farthest;
      order_[k] = static_cast<int>(farthest);
      for (std::size_t i = 0; i < n; ++i) {
        const S distance = squared_norm<S, D>(receivers_[i] - receivers_[farthest]);
        apart[i] = k == 0 && i != farthest ? distance : std::min(apart[i], distance);
      }
      for (std::size_t i = 0; i <= k; ++i) apart[static_cast<std::size_t>(order_[i])] = S(-1);
    }
  }

  [[nodiscard]] RepairedLengths<S, D> view(std::size_t count) const {
    return {receivers_, lengths_, order_, waves_, count, options_.wavelength, *options_.sigma};
  }

  // Σ|m + shift| of the receivers joined; `kMax` where one of them exceeds the allowed repair.
  [[nodiscard]] int moved(std::size_t count, int shift) const {
    int sum = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const int waves = std::abs(waves_[static_cast<std::size_t>(order_[i])] + shift);
      if (waves > options_.max_repair) return kTooMany;
      sum += waves;
    }
    return sum;
  }

  // The fewest waves that any common shift leaves.
  [[nodiscard]] int fewest_moved(std::size_t count) const {
    int fewest = kTooMany;
    for (int shift = -options_.max_repair; shift <= options_.max_repair; ++shift) {
      fewest = std::min(fewest, moved(count, shift));
    }
    return fewest;
  }

  // The second sum of (1) over the receivers joined; equal lengths have equal lags.
  [[nodiscard]] int out_of_order(std::size_t count) const {
    std::array<bool, kMaxFsriReceivers> joined{};
    for (std::size_t i = 0; i < count; ++i) joined[static_cast<std::size_t>(order_[i])] = true;
    int sum = 0;
    int longer = -1;
    for (std::size_t k = 0; k < lengths_.size(); ++k) {
      const auto place = static_cast<std::size_t>(by_length_[k]);
      if (!joined[place]) continue;
      if (longer >= 0) {
        const auto before = static_cast<std::size_t>(longer);
        const int down = waves_[before] - waves_[place];
        sum += lengths_[before] == lengths_[place] ? std::abs(down) : std::max(down, 0);
      }
      longer = by_length_[k];
    }
    return sum;
  }

  [[nodiscard]] S limit() const { return best_.cost + kDoubtfulCost<S>; }

  // Adds receiver number `count` with each number of waves, nearest to none first.
  void join(std::size_t count) {
    if (count == lengths_.size()) {
      finish();
      return;
    }
    int& waves = waves_[static_cast<std::size_t>(order_[count])];
    for (int step = 0; step <= 4 * options_.max_repair; ++step) {
      waves = step % 2 == 0 ? step / 2 : -(step + 1) / 2;
      if (is_open(count + 1)) join(count + 1);
    }
  }

  // False when no completion of the first `count` receivers' waves can matter.
  [[nodiscard]] bool is_open(std::size_t count) {
    const int fewest = fewest_moved(count);
    if (fewest == kTooMany) return false;
    const int disorder = out_of_order(count);
    if (in_order_ && disorder > 0) return false;
    const S by_waves = kWaveCost<S> * static_cast<S>(fewest + disorder);
    if (!(by_waves < limit())) return false;
    if (count < D + 2 || count == lengths_.size()) return true;
    const RepairedLengths<S, D> some = view(count);
    S lowest = std::numeric_limits<S>::infinity();
    const Result<PseudorangeRoots<S, D>> roots = pseudorange_roots<S, D>(some);
    if (!roots || roots->count == 0) return true;
    for (int i = 0; i < roots->count; ++i) {
      if (skips(*roots, i)) continue;
      const Result<Minimum<S, D + 1>> minimum = pseudorange_minimum<S, D>(some, *roots, i);
      if (!minimum) return true;
      lowest = std::min(lowest, minimum->chi_squared);
    }
    const int freedom = static_cast<int>(lengths_.size()) - (D + 1);
    return is_believable(lowest, freedom) && lowest + by_waves < limit();
  }

  // Of a flat array's two images the one behind it.
  [[nodiscard]] bool skips(const PseudorangeRoots<S, D>& roots, int i) const {
    if (!array_.flat || roots.count < 2) return false;
    const State apart = roots.candidates[i] - roots.candidates[1 - i];
    const Vec<S, D> offset = apart.template head<D>();
    const S ahead = dot(offset, array_.normal);
    return ahead < S(0) || (ahead == S(0) && i == 1);
  }

  // All receivers have joined.
  void finish() {
    if (!in_order_ && out_of_order(lengths_.size()) == 0) return;  // seen already
    const RepairedLengths<S, D> all = view(lengths_.size());
    const Result<PseudorangeRoots<S, D>> roots = pseudorange_roots<S, D>(all);
    if (!roots || roots->count == 0) {
      if (!tried_) first_error_ = roots ? Error::InconsistentRanges : roots.error();
      tried_ = true;
      return;
    }
    for (int i = 0; i < roots->count; ++i) {
      if (skips(*roots, i)) continue;
      const Result<Minimum<S, D + 1>> minimum = pseudorange_minimum<S, D>(all, *roots, i);
      const Result<BiasedFix<S, D>> fix =
          minimum ? make_biased_fix<S, D>(all, roots->center, roots->mean_pseudorange,
                                          minimum->state.template head<D>())
                  : Result<BiasedFix<S, D>>{std::unexpected(minimum.error())};
      if (fix) {
        solved_ = true;
        consider(*fix);
      } else if (!tried_) {
        first_error_ = fix.error();
      }
      tried_ = true;
    }
  }

  // Chooses the common number of waves, and keeps the explanation if it is the best or the next.
  void consider(const BiasedFix<S, D>& fix) {
    FsriExplanation<S, D> found = nothing();
    const int disorder = out_of_order(lengths_.size());
    for (int shift = -options_.max_repair; shift <= options_.max_repair; ++shift) {
      const int sum = moved(lengths_.size(), shift);
      if (sum == kTooMany) continue;
      const S lag = fix.bias + static_cast<S>(shift) * options_.wavelength;
      const S bounded = std::clamp(lag, S(0), *options_.max_lag);
      const S outside = lag - bounded;
      const S chi_squared = fix.chi_squared + outside * outside / fix.covariance(D, D);
      if (!is_believable(chi_squared, fix.degrees_of_freedom)) continue;
      Vec<S, D> position = fix.position;
      for (int k = 0; k < D; ++k) {
        position[k] -= fix.covariance(D, k) / fix.covariance(D, D) * outside;
      }
      S cost = chi_squared + kWaveCost<S> * static_cast<S>(sum + disorder);
      if (options_.prior) {
        const Vec<S, D> off = (position - *options_.prior) / options_.prior_sigma;
        cost += squared_norm(off);
      }
      if (!(cost < found.cost)) continue;
      found = {fix, {}, cost};
      found.fix.position = position;
      found.fix.bias = bounded;
      found.fix.chi_squared = chi_squared;
      for (std::size_t i = 0; i < lengths_.size(); ++i) found.repair[i] = waves_[i] + shift;
    }
    if (found.cost < best_.cost) {
      other_ = best_;
      best_ = found;
    } else if (found.cost < other_.cost) {
      other_ = found;
    }
  }

  static constexpr int kTooMany = std::numeric_limits<int>::max();

  [[nodiscard]] static FsriExplanation<S, D> nothing() {
    return {{Vec<S, D>::Zero(), S(0), Mat<S, D + 1>::Zero(), S(0), 0},
            {},
            std::numeric_limits<S>::infinity()};
  }

  std::span<const Vec<S, D>> receivers_;
  std::span<const S> lengths_;
  const ReceiverArray<S, D>& array_;
  const FsriOptions<S, D>& options_;
  FsriWaves by_length_{};  // places by descending length
  FsriWaves order_{};      // in which receivers join
  FsriWaves waves_{};      // of each place, up to a common number
  bool in_order_ = true;
  bool solved_ = false;
  bool tried_ = false;
  Error first_error_ = Error::NoRepairFits;
  FsriExplanation<S, D> best_ = nothing();
  FsriExplanation<S, D> other_ = nothing();
};

}  // namespace uwbpos
