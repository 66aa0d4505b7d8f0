// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A small multilayer perceptron that predicts the bias of a range from how the link lies (004):
/// inputs clamped to what training saw and normalised, two hidden layers, ReLU,
/// \f[ b = w_3^T h_2 + c_3, \qquad h_2 = \max(0, W_2 h_1 + c_2), \qquad
///     h_1 = \max(0, W_1 z + c_1), \qquad z_i = (x_i - \mu_i) / s_i. \qquad (1) \f]
/// Weights are stored input by input: each input's are multiplied by one number and added to many
/// sums side by side, in the same order with SIMD registers as without; and an input of zero, as
/// half of a ReLU layer's and all but one of a code are, is passed over.
///
/// All members are plain arrays: a `constexpr` network stays in flash. examples/bias_training/
/// trains one from ranges and truth and writes it as a header and as JSON.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <span>

#include "uwbpos/core/eigen.hpp"
#include "uwbpos/core/result.hpp"

namespace uwbpos {

/// W x + c, `Out` sums of `In` products.
template <class S, std::size_t In, std::size_t Out>
struct DenseLayer {
  std::array<std::array<S, Out>, In> weights;  ///< of input i on all outputs
  std::array<S, Out> biases;                   ///< c

  /// W `input` + c. In·Out multiplications but for inputs of zero; no allocation.
  [[nodiscard]] std::array<S, Out> operator()(const std::array<S, In>& input) const {
    std::array<std::size_t, In> places;
    std::size_t count = 0;
    for (std::size_t i = 0; i < In; ++i) {
      if (input[i] != S(0)) places[count++] = i;
    }
    std::array<S, Out> sums;
    add<0>(input, std::span<const std::size_t>{places.data(), count}, sums);
    return sums;
  }

 private:
  // Sums from number `From` on, as many side by side as registers hold.
  template <std::size_t From>
  void add(const std::array<S, In>& input, std::span<const std::size_t> places,
           std::array<S, Out>& sums) const {
    constexpr std::size_t left = Out - From;
    // Twelve registers of SIMD, or 24 scalars.
    constexpr std::size_t most = Eigen::internal::packet_traits<S>::size > 1
                                     ? 12 * Eigen::internal::packet_traits<S>::size
                                     : 24;
    constexpr std::size_t width = left >= most ? most : std::bit_floor(left);
    using Block = Eigen::Array<S, static_cast<int>(width), 1>;
    Block block = Eigen::Map<const Block>{biases.data() + From};
    for (const std::size_t i : places) {
      block += input[i] * Eigen::Map<const Block>{weights[i].data() + From};
    }
    Eigen::Map<Block>{sums.data() + From} = block;
    if constexpr (left > width) add<From + width>(input, places, sums);
  }
};

/// Equation (1): `Inputs` numbers to one bias [m].
template <class S, std::size_t Inputs, std::size_t First = 50, std::size_t Second = 50>
struct BiasNetwork {
  std::array<S, Inputs> lowest;             ///< of each input in training
  std::array<S, Inputs> highest;            ///< of each input in training
  std::array<S, Inputs> mean;               ///< μ
  std::array<S, Inputs> inverse_deviation;  ///< 1/s
  DenseLayer<S, Inputs, First> first;       ///< W₁, c₁
  DenseLayer<S, First, Second> second;      ///< W₂, c₂
  DenseLayer<S, Second, 1> output;          ///< w₃, c₃ [m]

  /// The bias [m], estimate minus truth, of a link with these inputs; an input beyond those of
  /// training counts as the nearest of them. Inputs·First + First·Second + Second multiplications
  /// at most; no allocation, (Inputs + First + Second) scalars of stack.
  /// Errors: Error::NotFinite, an input; Error::NumericOverflow, a result that is not finite.
  [[nodiscard]] Result<S> operator()(const std::array<S, Inputs>& inputs) const {
    std::array<S, Inputs> z{};
    for (std::size_t i = 0; i < Inputs; ++i) {
      if (!std::isfinite(inputs[i])) return std::unexpected(Error::NotFinite);
      const S clamped = std::min(std::max(inputs[i], lowest[i]), highest[i]);
      z[i] = (clamped - mean[i]) * inverse_deviation[i];
    }
    std::array<S, First> h1 = first(z);
    for (S& h : h1) h = h > S(0) ? h : S(0);
    std::array<S, Second> h2 = second(h1);
    for (S& h : h2) h = h > S(0) ? h : S(0);
    const S bias = output(h2)[0];
    if (!std::isfinite(bias)) return std::unexpected(Error::NumericOverflow);
    return bias;
  }
};

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
