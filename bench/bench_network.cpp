// SPDX-License-Identifier: MIT
// A bias network beside the same written as Eigen expressions.
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <benchmark/benchmark.h>

#include "networks.hpp"

namespace {

using namespace uwbpos;
using namespace benches;

template <class S>
std::vector<std::array<S, kInputs>> links() {
  sim::Random random{"inputs"};
  std::vector<std::array<S, kInputs>> all(256);
  for (auto& inputs : all) inputs = random_inputs<S>(random);
  return all;
}

template <class S>
void network(benchmark::State& state) {
  const Network<S> net = random_network<S>();
  const auto all = links<S>();
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(net(all[i++ % all.size()]));
  state.SetItemsProcessed(state.iterations());
}

template <class S>
void eigen_expression(benchmark::State& state) {
  const Network<S> net = random_network<S>();
  const EigenNetwork<S> evaluate{net};
  const auto all = links<S>();
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(evaluate(all[i++ % all.size()]));
  state.SetItemsProcessed(state.iterations());
  for (const auto& inputs : all) {
    const auto ours = net(inputs);
    const S theirs = evaluate(inputs);
    if (!ours || std::abs(*ours - theirs) > S(1e-4)) state.SkipWithError("the answers differ");
  }
}

BENCHMARK(network<float>);
BENCHMARK(network<double>);
BENCHMARK(eigen_expression<float>);
BENCHMARK(eigen_expression<double>);

}  // namespace
