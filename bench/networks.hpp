// SPDX-License-Identifier: MIT
// A bias network and the same as plain Eigen expressions, for the benches.
#pragma once

#include <array>
#include <cstddef>
#include <tuple>

#include "uwbpos/core/eigen.hpp"
#include "uwbpos/filter/bias_network.hpp"
#include "uwbpos/sim/noise.hpp"

namespace benches {

inline constexpr int kInputs = 21;
inline constexpr int kHidden = 50;

template <class S>
using Network = uwbpos::BiasNetwork<S, kInputs, kHidden, kHidden>;

template <class S>
Network<S> random_network() {
  uwbpos::sim::Random random{"a network"};
  Network<S> network{};
  const auto fill = [&](auto& layer) {
    for (auto& row : layer.weights) {
      for (S& w : row) w = static_cast<S>(random.normal(0, 0.1));
    }
    for (S& c : layer.biases) c = static_cast<S>(random.normal(0, 0.1));
  };
  network.lowest.fill(-2);
  network.highest.fill(2);
  network.inverse_deviation.fill(1);
  fill(network.first);
  fill(network.second);
  fill(network.output);
  return network;
}

template <class S>
std::array<S, kInputs> random_inputs(uwbpos::sim::Random& random) {
  std::array<S, kInputs> inputs{};
  for (std::size_t i = 0; i < 10; ++i) inputs[i] = static_cast<S>(random.uniform(-1, 1));
  inputs[13] = inputs[19] = 1;  // codes of an anchor and a tag
  return inputs;
}

/// `net` with its weights as Eigen's matrices; it must outlive this.
template <class S>
struct EigenNetwork {
  using Inputs = Eigen::Matrix<S, kInputs, 1>;
  using Hidden = Eigen::Matrix<S, kHidden, 1>;

  explicit EigenNetwork(const Network<S>& net)
      : w1{matrix(net.first)},
        w2{matrix(net.second)},
        w3{matrix(net.output)},
        c1{net.first.biases.data()},
        c2{net.second.biases.data()},
        c3{net.output.biases[0]},
        low{net.lowest.data()},
        high{net.highest.data()},
        mean{net.mean.data()},
        scale{net.inverse_deviation.data()} {}

  S operator()(const std::array<S, kInputs>& inputs) const {
    const Eigen::Map<const Inputs> x{inputs.data()};
    const Inputs z = (x.cwiseMax(low).cwiseMin(high) - mean).cwiseProduct(scale);
    const Hidden h1 = (w1 * z + c1).cwiseMax(S(0));
    const Hidden h2 = (w2 * h1 + c2).cwiseMax(S(0));
    return S((w3 * h2)(0) + c3);
  }

  Eigen::Matrix<S, kHidden, kInputs> w1;
  Eigen::Matrix<S, kHidden, kHidden> w2;
  Eigen::Matrix<S, 1, kHidden> w3;
  Eigen::Map<const Hidden> c1, c2;
  S c3;
  Eigen::Map<const Inputs> low, high, mean, scale;

 private:
  template <class Layer>
  static auto matrix(const Layer& layer) {
    constexpr auto in = static_cast<Eigen::Index>(std::tuple_size_v<decltype(layer.weights)>);
    constexpr auto out = static_cast<Eigen::Index>(std::tuple_size_v<decltype(layer.biases)>);
    Eigen::Matrix<S, out, in> w;
    for (Eigen::Index i = 0; i < in; ++i) {
      for (Eigen::Index k = 0; k < out; ++k) {
        w(k, i) = layer.weights[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)];
      }
    }
    return w;
  }
};

}  // namespace benches
