// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Which whole waves to move, by branch and bound. With m_i waves added to length i, a repair costs
/// \f[ J = \chi^2(p, q) + c \Big( \sum |m_i| + \sum_k \max(0, m_{(k)} - m_{(k+1)}) \Big)
///         + \frac{d^2}{1 + d^2/16}, \qquad 0 \le q \le q_{max}, \qquad (1) \f]
/// (k) by descending length, c `kWaveCost`, d the distance from a prior position over its sigma:
/// −2 log of its likelihood, but that a prior which is far off loses its say. Lag grows with
/// distance, so the second sum should be zero. Where nothing but q is left to judge by it must be
/// (the paper's rule); a residual or a prior may overrule it.
///
/// A wave more for all is a wave more of q at the same p, so repairs are sought up to a common
/// number and that is chosen afterwards. A q outside its bounds by δ is brought back at the price
/// δ²/var q. Receivers join one by one; what some cost, all cost at least, and a branch is left
/// once its cost exceeds the best J by `kDoubtfulCost`. From D + 1 receivers on, the fix so far
/// predicts the next length; waves that leave it off beyond noise are not tried. A search that has
/// solved `kMostSolutions` closed forms ends with what it has, called ambiguous.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "uwbpos/solve/fsri_waves.hpp"
#include "uwbpos/solve/pseudorange_least_squares.hpp"
#include "uwbpos/solve/receiver_array.hpp"

namespace uwbpos {

/// One way to explain a shot.
template <class S, int D>
struct FsriExplanation {
  BiasedFix<S, D> fix;  ///< of position and lag, the lag within its bounds
  FsriWaves repair;     ///< waves added to each length
  S cost;               ///< J of (1)
};

/// How many positions one search solves for at most, a descent counted as four.
inline constexpr int kMostSolutions = 16000;

/// The search itself; one object, one shot. About 1 kB, no allocation, recursion as deep as there
/// are receivers.
template <class S, int D>
class FsriSearch {
 public:
  /// Of checked input; `max_lag` and `sigma` of the options resolved. Refers to all of it.
  FsriSearch(std::span<const Vec<S, D>> receivers, std::span<const S> lengths,
             const ReceiverArray<S, D>& array, const FsriOptions<S, D>& options)
      : receivers_{receivers},
        lengths_{lengths},
        array_{array},
        options_{options},
        waves_{receivers, lengths, array.center, options.max_repair},
        in_order_{freedom() == 0 && !options.prior},
        most_{most_of(freedom())} {}

  /// Searches; afterwards `best` and `other` are known.
  /// Errors: Error::NoRepairFits; Error::NotConverged, nothing was found before the search had to
  /// end; that of the lengths as they are, when none could be solved.
  [[nodiscard]] Result<void> run() {
    waves_[0] = 0;
    // Cheap explanations first: most shots have one, and nothing dearer need be looked at.
    cap_ = freedom() > 0 ? S(24) : kUnlimited;
    join(1, {});
    if (best_.cost + kDoubtfulCost<S> > cap_) {
      cap_ = kUnlimited;
      best_ = other_ = nothing();
      join(1, {});
    }
    if (best_.cost < kUnlimited) return {};
    if (cut_short()) return std::unexpected(Error::NotConverged);
    return std::unexpected(solved_ ? Error::NoRepairFits : first_error_);
  }

  /// The likeliest explanation.
  [[nodiscard]] const FsriExplanation<S, D>& best() const { return best_; }
  /// The next; its cost is infinite if there is none.
  [[nodiscard]] const FsriExplanation<S, D>& other() const { return other_; }
  /// Whether another explanation is not much less likely, or may be.
  [[nodiscard]] bool ambiguous() const {
    return cut_short() || std::min(other_.cost, unsolved_) < best_.cost + kDoubtfulCost<S>;
  }

 private:
  using Lengths = RepairedLengths<S, D>;
  using Roots = PseudorangeRoots<S, D>;
  static constexpr S kMostPriorCost = S(16);
  static constexpr S kUnlimited = std::numeric_limits<S>::infinity();

  [[nodiscard]] static FsriExplanation<S, D> nothing() {
    return {{Vec<S, D>::Zero(), S(0), Mat<S, D + 1>::Zero(), S(0), 0}, {}, kUnlimited};
  }

  // χ² of f degrees of freedom that noise exceeds but once in 10⁴.
  [[nodiscard]] static S most_of(int f) { return S(1) + S(2 * f) + S(8) * std::sqrt(S(2 * f)); }

  // Whether there may be explanations that the search did not come to.
  [[nodiscard]] bool cut_short() const { return solutions_ >= kMostSolutions; }

  [[nodiscard]] int freedom() const { return static_cast<int>(lengths_.size()) - (D + 1); }
  [[nodiscard]] S limit() const { return std::min(cap_, best_.cost + kDoubtfulCost<S>); }

  // What the receivers that have joined say of position and q, where it is known.
  struct Outlook {
    std::array<BiasedFix<S, D>, 2> fixes;
    int count = 0;
  };

  // Gives receiver number `joined` each number of waves, those of the first before others.
  void join(std::size_t joined, const Outlook& so_far) {
    if (joined == lengths_.size()) {
      finish();
      return;
    }
    for (int step = 0; step <= 4 * options_.max_repair && !cut_short(); ++step) {
      waves_[joined] = step % 2 == 0 ? step / 2 : -(step + 1) / 2;
      Outlook outlook;
      if (is_foreseen(joined, so_far) && is_open(joined + 1, outlook)) join(joined + 1, outlook);
    }
  }

  // Whether the next length with its waves is anywhere near what a fix predicts; twice the limit,
  // as prediction is to first order.
  [[nodiscard]] bool is_foreseen(std::size_t joined, const Outlook& outlook) const {
    if (outlook.count == 0) return true;
    const S most = S(2) * std::min(limit(), most_);
    const std::size_t place = waves_.place(joined);
    const S length = lengths_[place] + options_.wavelength * static_cast<S>(waves_[joined]);
    for (int i = 0; i < outlook.count; ++i) {
      const BiasedFix<S, D>& fix = outlook.fixes[static_cast<std::size_t>(i)];
      const auto predicted = predict_pseudorange<S, D>(fix.position, fix.bias, receivers_[place]);
      const S off = length - predicted.pseudorange;
      S variance = *options_.sigma * *options_.sigma;
      for (int r = 0; r <= D; ++r) {
        for (int c = 0; c <= D; ++c) {
          variance += predicted.gradient[r] * fix.covariance(r, c) * predicted.gradient[c];
        }
      }
      if (!(off * off > most * variance)) return true;
    }
    return false;
  }

  // False when no completion of the first `joined` receivers' waves can matter.
  [[nodiscard]] bool is_open(std::size_t joined, Outlook& outlook) {
    const int fewest = waves_.fewest_moved(joined);
    if (fewest == WaveAssignment<S, D>::kTooMany) return false;
    const int disorder = waves_.out_of_order(joined);
    if ((in_order_ && disorder > 0) ||
        !(kWaveCost<S> * static_cast<S>(fewest + disorder) < limit())) {
      return false;
    }
    if (joined < D + 1 || joined == lengths_.size()) return true;
    const Lengths some = repaired(joined);
    ++solutions_;
    const Result<Roots> roots = pseudorange_roots<S, D>(some);
    if (!roots || roots->count == 0) return true;
    for (int i = 0; i < roots->count; ++i) {
      if (is_behind(*roots, i)) continue;
      Result<BiasedFix<S, D>> fix = step_from<S, D>(some, *roots, i);
      if (!fix) fix = polished(some, *roots, i);
      if (!fix) {
        outlook.count = 0;
        return true;
      }
      if (price(*fix, joined, disorder).cost < limit()) {
        outlook.fixes[static_cast<std::size_t>(outlook.count++)] = *fix;
      }
    }
    return outlook.count > 0;
  }

  [[nodiscard]] Result<BiasedFix<S, D>> polished(const Lengths& some, const Roots& roots, int i) {
    constexpr int kCost = 4;  // of closed forms
    solutions_ += kCost;
    return minimum_from<S, D>(some, roots, i);
  }

  // All receivers have joined: one or two explanations more.
  void finish() {
    const Lengths all = repaired(lengths_.size());
    ++solutions_;
    const Result<Roots> roots = pseudorange_roots<S, D>(all);
    if (!roots || roots->count == 0) {
      const Error error = roots ? Error::InconsistentRanges : roots.error();
      if (first_error_ == Error::NoRepairFits) first_error_ = error;
      return;
    }
    const int disorder = waves_.out_of_order(lengths_.size());
    std::optional<Vec<S, D>> first;
    for (int i = 0; i < roots->count; ++i) {
      if (is_behind(*roots, i)) continue;
      // What a step from the closed form shows to be hopeless by far is not polished.
      const Result<BiasedFix<S, D>> near = step_from<S, D>(all, *roots, i);
      if (near && !(price(*near, lengths_.size(), disorder).cost < S(2) * limit())) {
        solved_ = true;
        continue;
      }
      const Result<BiasedFix<S, D>> fix = polished(all, *roots, i);
      if (!fix) {
        if (first_error_ == Error::NoRepairFits) first_error_ = fix.error();
        const int moved = waves_.fewest_moved(lengths_.size());
        unsolved_ = std::min(unsolved_, kWaveCost<S> * static_cast<S>(moved + disorder));
        continue;
      }
      solved_ = true;
      // Two roots may have one minimum.
      const S same = S(1e-3) * roots->largest;
      if (!first || norm<S, D>(fix->position - *first) > same) {
        keep(price(*fix, lengths_.size(), disorder));
      }
      first = fix->position;
    }
  }

  // The cheapest common number of waves for a fix of the first `joined` receivers, by (1).
  [[nodiscard]] FsriExplanation<S, D> price(const BiasedFix<S, D>& fix, std::size_t joined,
                                            int disorder) const {
    FsriExplanation<S, D> found = nothing();
    // Where all move alike there is nothing to choose, and q may be out of bounds by noise.
    const S most = waves_.alike(joined) ? most_of(freedom() + 1) : most_;
    for (int shift = -options_.max_repair; shift <= options_.max_repair; ++shift) {
      const int moved = waves_.moved(joined, shift);
      if (moved == WaveAssignment<S, D>::kTooMany) continue;
      const S lag = fix.bias + static_cast<S>(shift) * options_.wavelength;
      const S bounded = std::clamp(lag, S(0), *options_.max_lag);
      const S outside = (lag - bounded) / fix.covariance(D, D);
      const S chi_squared = fix.chi_squared + outside * (lag - bounded);
      if (chi_squared > most) continue;
      Vec<S, D> position = fix.position;
      for (int k = 0; k < D; ++k) position[k] -= fix.covariance(D, k) * outside;
      S cost = chi_squared + kWaveCost<S> * static_cast<S>(moved + disorder);
      if (options_.prior && joined == lengths_.size()) {
        const Vec<S, D> off = (position - *options_.prior) / options_.prior_sigma;
        const S squares = squared_norm(off);
        cost += squares / (S(1) + squares / kMostPriorCost);
      }
      if (!(cost < found.cost)) continue;
      found = {fix, waves_.shifted(shift), cost};
      found.fix.position = position;
      found.fix.bias = bounded;
      found.fix.chi_squared = chi_squared;
    }
    return found;
  }

  void keep(const FsriExplanation<S, D>& found) {
    if (found.cost < other_.cost) other_ = found;
    if (other_.cost < best_.cost) std::swap(best_, other_);
  }

  [[nodiscard]] Lengths repaired(std::size_t joined) const {
    return {receivers_, lengths_, waves_, joined, options_.wavelength, *options_.sigma};
  }

  // Whether root `i` is that of a flat array's two images which is not meant.
  [[nodiscard]] bool is_behind(const Roots& roots, int i) const {
    if (!array_.flat || roots.count < 2) return false;
    const Vec<S, D + 1> apart = roots.candidates[i] - roots.candidates[1 - i];
    const Vec<S, D> offset = apart.template head<D>();
    const S ahead = dot(offset, array_.normal);
    return ahead < S(0) || (ahead == S(0) && i == 1);
  }

  std::span<const Vec<S, D>> receivers_;
  std::span<const S> lengths_;
  const ReceiverArray<S, D>& array_;
  const FsriOptions<S, D>& options_;
  WaveAssignment<S, D> waves_;  // the first receiver's zero, the others' relative to that
  bool in_order_;               // repairs must be
  S most_;                      // χ² that is taken for noise
  S cap_ = kUnlimited;          // what costs more is not looked at yet
  int solutions_ = 0;
  S unsolved_ = kUnlimited;  // least cost, but for χ², of waves whose position was not found
  bool solved_ = false;
  Error first_error_ = Error::NoRepairFits;
  FsriExplanation<S, D> best_ = nothing();
  FsriExplanation<S, D> other_ = nothing();
};

}  // namespace uwbpos
