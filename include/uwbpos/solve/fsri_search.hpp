// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Which whole waves to move, by branch and bound, at the price J of fsri_price.hpp.
///
/// A wave more for all is a wave more of q at the same p, so repairs are sought up to a common
/// number and that is chosen afterwards. Receivers join one by one; what some cost, all cost at
/// least, and a branch is left once its cost exceeds the best J by `kDoubtfulCost`. From D + 1
/// receivers on, the fix so far predicts the next length; waves that leave it off beyond noise are
/// not tried. After `kMostSolutions` closed forms it ends with what it has, called ambiguous.

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "uwbpos/solve/fsri_price.hpp"
#include "uwbpos/solve/receiver_array.hpp"

namespace uwbpos {

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
        price_{options, static_cast<int>(lengths.size())} {}

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
      best_ = other_ = FsriExplanation<S, D>::nothing();
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
  static constexpr S kUnlimited = std::numeric_limits<S>::infinity();

  [[nodiscard]] bool cut_short() const { return solutions_ >= kMostSolutions; }
  [[nodiscard]] int freedom() const { return static_cast<int>(lengths_.size()) - (D + 1); }
  [[nodiscard]] S limit() const { return std::min(cap_, best_.cost + kDoubtfulCost<S>); }

  // What the receivers that have joined say of position and q.
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

  // Whether the next length is near a prediction: twice the limit, as that is to first order.
  [[nodiscard]] bool is_foreseen(std::size_t joined, const Outlook& outlook) const {
    if (outlook.count == 0) return true;
    const S most = S(2) * std::min(limit(), price_.most());
    const std::size_t place = waves_.place(joined);
    const S length = lengths_[place] + options_.wavelength * static_cast<S>(waves_[joined]);
    for (int i = 0; i < outlook.count; ++i) {
      const BiasedFix<S, D>& fix = outlook.fixes[static_cast<std::size_t>(i)];
      if (!(squared_innovation<S, D>(fix, receivers_[place], length, *options_.sigma) > most)) {
        return true;
      }
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
      if (price_(waves_, *fix, joined, disorder).cost < limit()) {
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
    if (!roots) return unsolved(roots.error());
    if (roots->count == 0) return note(Error::InconsistentRanges);
    const int disorder = waves_.out_of_order(lengths_.size());
    std::optional<Vec<S, D>> first;
    for (int i = 0; i < roots->count; ++i) {
      if (is_behind(*roots, i)) continue;
      // What a step from the closed form shows to be hopeless by far is not polished.
      const Result<BiasedFix<S, D>> near = step_from<S, D>(all, *roots, i);
      if (near && !(price_(waves_, *near, lengths_.size(), disorder).cost < S(2) * limit())) {
        solved_ = true;
        continue;
      }
      const Result<BiasedFix<S, D>> fix = polished(all, *roots, i);
      if (!fix) {
        unsolved(fix.error());
        continue;
      }
      solved_ = true;
      // Two roots may have one minimum.
      const S same = S(1e-3) * roots->largest;
      if (!first || norm<S, D>(fix->position - *first) > same) {
        keep(price_(waves_, *fix, lengths_.size(), disorder));
      }
      first = fix->position;
    }
  }

  void note(Error e) { first_error_ = first_error_ == Error::NoRepairFits ? e : first_error_; }
  // Waves that may be right, but whose position was not found.
  void unsolved(Error error) {
    note(error);
    const auto moved = static_cast<S>(waves_.fewest_moved(lengths_.size()));
    unsolved_ = std::min(unsolved_, kWaveCost<S> * moved);
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
  FsriPrice<S, D> price_;
  S cap_ = kUnlimited;  // what costs more is not looked at yet
  int solutions_ = 0;
  S unsolved_ = kUnlimited;  // least price of moving waves whose position was not found
  bool solved_ = false;
  Error first_error_ = Error::NoRepairFits;
  FsriExplanation<S, D> best_ = FsriExplanation<S, D>::nothing();
  FsriExplanation<S, D> other_ = FsriExplanation<S, D>::nothing();
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
