// SPDX-License-Identifier: MIT
// A bias network beside the same written as Eigen expressions.
#include <array>

#include <benchmark/benchmark.h>

#include "uwbpos/core/eigen.hpp"
#include "uwbpos/filter/bias_network.hpp"
#include "uwbpos/sim/noise.hpp"

namespace {

using namespace uwbpos;

constexpr int kInputs = 21;
constexpr int kHidden = 50;

template <class S>
using Network = BiasNetwork<S, kInputs, kHidden, kHidden>;

template <class S>
Network<S> random_network() {
  sim::Random random{"a network"};
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
std::array<S, kInputs> random_inputs() {
  sim::Random random{"inputs"};
  std::array<S, kInputs> inputs{};
  for (std::size_t i = 0; i < 10; ++i) inputs[i] = static_cast<S>(random.uniform(-1, 1));
  inputs[13] = inputs[19] = 1;  // codes of an anchor and a tag
  return inputs;
}

template <class S>
void network(benchmark::State& state) {
  const Network<S> net = random_network<S>();
  auto inputs = random_inputs<S>();
  for (auto _ : state) {
    benchmark::DoNotOptimize(inputs);
    benchmark::DoNotOptimize(net(inputs));
  }
}

template <class S>
void eigen_expression(benchmark::State& state) {
  const Network<S> net = random_network<S>();
  auto inputs = random_inputs<S>();
  using Inputs = Eigen::Matrix<S, kInputs, 1>;
  using Hidden = Eigen::Matrix<S, kHidden, 1>;
  const auto matrix = [](const auto& layer) {
    constexpr auto in = static_cast<Eigen::Index>(std::tuple_size_v<decltype(layer.weights)>);
    constexpr auto out = static_cast<Eigen::Index>(std::tuple_size_v<decltype(layer.biases)>);
    Eigen::Matrix<S, out, in> w;
    for (Eigen::Index i = 0; i < in; ++i) {
      for (Eigen::Index k = 0; k < out; ++k) {
        w(k, i) = layer.weights[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)];
      }
    }
    return w;
  };
  const auto w1 = matrix(net.first);
  const auto w2 = matrix(net.second);
  const auto w3 = matrix(net.output);
  const Eigen::Map<const Hidden> c1{net.first.biases.data()};
  const Eigen::Map<const Hidden> c2{net.second.biases.data()};
  const Eigen::Map<const Inputs> low{net.lowest.data()};
  const Eigen::Map<const Inputs> high{net.highest.data()};
  const Eigen::Map<const Inputs> mean{net.mean.data()};
  const Eigen::Map<const Inputs> scale{net.inverse_deviation.data()};
  const auto evaluate = [&] {
    const Eigen::Map<const Inputs> x{inputs.data()};
    const Inputs z = (x.cwiseMax(low).cwiseMin(high) - mean).cwiseProduct(scale);
    const Hidden h1 = (w1 * z + c1).cwiseMax(S(0));
    const Hidden h2 = (w2 * h1 + c2).cwiseMax(S(0));
    return S((w3 * h2)(0) + net.output.biases[0]);
  };
  for (auto _ : state) {
    benchmark::DoNotOptimize(inputs);
    benchmark::DoNotOptimize(evaluate());
  }
  const auto ours = net(inputs);
  const S theirs = evaluate();
  if (!ours || std::abs(*ours - theirs) > S(1e-4)) state.SkipWithError("the answers differ");
}

BENCHMARK(network<float>);
BENCHMARK(network<double>);
BENCHMARK(eigen_expression<float>);
BENCHMARK(eigen_expression<double>);

}  // namespace
