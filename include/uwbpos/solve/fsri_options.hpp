// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What a shot of ultrasound is solved with and what comes out; see fsri.hpp.

#include <array>
#include <cstddef>
#include <optional>
#include <ranges>
#include <span>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/types.hpp"

namespace uwbpos {

/// Most receivers of one shot.
inline constexpr std::size_t kMaxFsriReceivers = 16;

/// What a shot is solved with.
template <class S, int D = 2>
struct FsriOptions {
  S wavelength = S(0.0086426);              ///< λ, of 40 kHz at 24 °C [m]
  std::optional<S> max_lag = std::nullopt;  ///< the lag lies in [0, this] [m]; 5 λ unless given
  int max_repair = 2;                       ///< most waves to add to a length or take off, 0 … 8
  std::optional<S> sigma = std::nullopt;    ///< of one length [m]; λ/100 unless given
  Vec<S, D> side = Vec<S, D>::Zero();       ///< where the emitter is from receivers in line, in a
                                            ///< plane; zero: as `ReceiverArray` says
  std::optional<Vec<S, D>> prior = std::nullopt;  ///< about where the emitter is [m]
  S prior_sigma = S(0.06);                        ///< how far from there, along each axis [m]
};

/// One shot solved.
template <class S, std::size_t N = 3, int D = 2>
struct FsriShot {
  Vec<S, D> position;         ///< of the emitter [m]
  S lag;                      ///< q, in [0, max_lag] [m]
  std::array<int, N> repair;  ///< whole waves added to each length; below zero: taken off
  bool ambiguous;             ///< another repair, or root, is not much less likely
  S residual;                 ///< root mean square over the lengths [m]; 0 without redundancy
  Mat<S, D + 1> covariance;   ///< of (position, lag), given the repair [m²]
  S chi_squared;              ///< squared normalised residuals
  int degrees_of_freedom;     ///< receivers − D − 1
  Vec<S, D> alternative;      ///< the likeliest other explanation's position; NaN if there is none
};

/// A contiguous, sized range of `Vec<S, D>`, D = 2 or 3: the receivers of a shot [m].
template <class R>
concept ReceiverSet = std::ranges::contiguous_range<R> && std::ranges::sized_range<R> &&
                      std::ranges::range_value_t<R>::ColsAtCompileTime == 1 &&
                      (std::ranges::range_value_t<R>::RowsAtCompileTime == 2 ||
                       std::ranges::range_value_t<R>::RowsAtCompileTime == 3);

/// The scalar of a set of receivers.
template <ReceiverSet R>
using ReceiverScalar = typename std::ranges::range_value_t<R>::Scalar;

/// The dimension of a set of receivers.
template <ReceiverSet R>
inline constexpr int kReceiverDimension = std::ranges::range_value_t<R>::RowsAtCompileTime;

/// How many receivers a type holds, where the type says; else as many as there may be.
template <class R>
inline constexpr std::size_t kReceiverCount = kMaxFsriReceivers;
/// Of an array.
template <class T, std::size_t N>
inline constexpr std::size_t kReceiverCount<std::array<T, N>> = N;
/// Of a C array.
template <class T, std::size_t N>
inline constexpr std::size_t kReceiverCount<T[N]> = N;
/// Of a span of fixed extent.
template <class T, std::size_t N>
  requires(N != std::dynamic_extent)
inline constexpr std::size_t kReceiverCount<std::span<T, N>> = N;

/// What receivers are inside the solvers: one instantiation per scalar and dimension. O(1).
template <ReceiverSet R>
[[nodiscard]] constexpr auto as_receiver_span(const R& receivers) {
  using Span = std::span<const Vec<ReceiverScalar<R>, kReceiverDimension<R>>>;
  return Span{std::ranges::data(receivers), std::ranges::size(receivers)};
}

/// The options of a set of receivers.
template <ReceiverSet R>
using FsriOptionsOf = FsriOptions<ReceiverScalar<R>, kReceiverDimension<R>>;

/// Each wave that a repair moves, and each wave by which it departs from the order of the lengths,
/// makes it e^(3/2) = 4.5 times less likely; in units of χ².
template <class S>
inline constexpr S kWaveCost = S(3);

/// Explanations whose odds against the best are below e^(5/2) = 12 : 1 make it ambiguous; in units
/// of χ².
template <class S>
inline constexpr S kDoubtfulCost = S(5);

/// How many positions one search solves for at most, a descent counted as four.
inline constexpr int kMostSolutions = 16000;

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
