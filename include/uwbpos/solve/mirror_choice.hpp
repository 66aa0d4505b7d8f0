// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Whether the measurements themselves tell two mirror images apart. With Gaussian noise the odds
/// of two positions are exp(Δχ²/2). Two ways to be sure, neither of which trusts a wrong sigma:
/// the odds exceed 90 : 1 while the better one is itself believable, or the better one fits a
/// hundred times closer than the other, which chance grants once in a hundred whatever the noise.

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "uwbpos/core/linalg.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/solve/newton.hpp"

namespace uwbpos {

/// What the caller knows that tells mirror images apart; either may be left out. Where both are
/// given the side decides.
template <class S, int D>
struct LocateOptions {
  /// A direction in which the tag lies from the anchors, e.g. (0, 0, −1) below a ceiling; its
  /// length does not matter, zero says nothing.
  Vec<S, D> side = Vec<S, D>::Zero();
  /// A position nearer to the tag than to its mirror image [m], such as the previous fix.
  std::optional<Vec<S, D>> prior = std::nullopt;
};

/// Error::NotFinite when an option is not finite. O(D).
template <class S, int D>
[[nodiscard]] std::optional<Error> check_options(const LocateOptions<S, D>& options) {
  if (!all_finite(options.side)) return Error::NotFinite;
  if (options.prior && !all_finite(*options.prior)) return Error::NotFinite;
  return std::nullopt;
}

/// Which of two images to answer.
enum class MirrorChoice : std::uint8_t { First, Second, Unknown };

/// True when χ² is within four standard deviations of what its degrees of freedom let expect, and
/// a little. O(1).
template <class S>
[[nodiscard]] bool is_believable(S chi_squared, int degrees_of_freedom) {
  const S freedom = static_cast<S>(degrees_of_freedom);
  return chi_squared <= freedom + S(4) * std::sqrt(S(2) * freedom) + S(1);
}

/// Whether no side or prior can change a solution whose mirror image has χ² of at least about
/// `other`: it is believable, and the image further from it than `settle_images` asks. O(1).
template <class S>
[[nodiscard]] bool is_without_doubt(S chi_squared, S other, int degrees_of_freedom) {
  constexpr S kFarther = S(64);
  return other - chi_squared > kFarther && is_believable(chi_squared, degrees_of_freedom);
}

/// True when `better` ≤ `worse`, the χ² of two images, rule the second out.
/// `needed`: the Δχ² to ask for; `rounding`: the χ² that rounding alone may cause.
template <class S>
[[nodiscard]] bool rules_out(S better, S worse, int degrees_of_freedom, S needed, S rounding) {
  const bool believable = is_believable(better, degrees_of_freedom);
  if (worse - better > needed && (believable || worse > S(2) * better)) return true;
  return worse > S(1e4) * (better + rounding);
}

/// Chooses between two images by what the caller knows alone. O(D), no allocation.
template <class S, int D>
[[nodiscard]] MirrorChoice choose_by_knowledge(const Vec<S, D>& first, const Vec<S, D>& second,
                                               const LocateOptions<S, D>& options) {
  const Vec<S, D> between = first - second;
  const S towards = dot(between, options.side);
  // A side within a thousandth of the mirror itself points at neither image.
  if (std::abs(towards) > S(1e-3) * norm(between) * norm(options.side)) {
    return towards > S(0) ? MirrorChoice::First : MirrorChoice::Second;
  }
  if (options.prior) {
    const S to_first = squared_norm<S, D>(first - *options.prior);
    const S to_second = squared_norm<S, D>(second - *options.prior);
    if (to_first != to_second) {
      return to_first < to_second ? MirrorChoice::First : MirrorChoice::Second;
    }
  }
  return MirrorChoice::Unknown;
}

/// Which of two minima to answer: the only one, the one that the measurements leave, or the one
/// that the caller's knowledge picks; `options` relative to what the states are relative to.
/// The first D numbers of a state are the position. Side and prior are heard while Δχ² < 25.
/// O(N²), no allocation. Error::AmbiguousSolution; the first one's error when neither converged;
/// Error::NotConverged when one did and does not explain the measurements.
template <class S, int D, int N>
[[nodiscard]] Result<Minimum<S, N>> settle_images(const Result<Minimum<S, N>>& first,
                                                  const Result<Minimum<S, N>>& second,
                                                  const LocateOptions<S, D>& options,
                                                  int degrees_of_freedom, S largest, S rounding) {
  if (!first && !second) return first;
  if (!first || !second) {
    // Where one descent failed the other is all that is known: it must speak for itself.
    const Result<Minimum<S, N>>& only = first ? first : second;
    if (is_believable(only->chi_squared, degrees_of_freedom)) return only;
    return std::unexpected(Error::NotConverged);
  }
  const bool in_order = first->chi_squared <= second->chi_squared;
  const Minimum<S, N>& best = in_order ? *first : *second;
  const Minimum<S, N>& other = in_order ? *second : *first;
  const Vec<S, N> apart = best.state - other.state;
  const S same = S(1e-3) * largest;
  if (squared_norm(apart) <= same * same) return best;
  const Vec<S, N> scaled = symmetric_from_lower(best.information) * apart;
  const bool near = dot(apart, scaled) < S(1);  // either will do
  const auto decided = [&](S needed) {
    return rules_out(best.chi_squared, other.chi_squared, degrees_of_freedom, needed, rounding);
  };
  if (decided(S(25))) return best;
  const Vec<S, D> best_position = best.state.template head<D>();
  const Vec<S, D> other_position = other.state.template head<D>();
  switch (choose_by_knowledge(best_position, other_position, options)) {
    case MirrorChoice::First:
      return best;
    case MirrorChoice::Second:
      return other;
    case MirrorChoice::Unknown:
      break;
  }
  if (near || decided(S(9))) return best;
  return std::unexpected(Error::AmbiguousSolution);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
