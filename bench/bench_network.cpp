// SPDX-License-Identifier: MIT
// A bias network beside the same written as Eigen expressions.
#include <cmath>

#include <benchmark/benchmark.h>

#include "networks.hpp"

namespace {

using namespace uwbpos;
using namespace benches;

template <class S>
void network(benchmark::State& state) {
  const Network<S> net = random_network<S>();
  sim::Random random{"inputs"};
  auto inputs = random_inputs<S>(random);
  for (auto _ : state) {
    benchmark::DoNotOptimize(inputs);
    benchmark::DoNotOptimize(net(inputs));
  }
}

template <class S>
void eigen_expression(benchmark::State& state) {
  const Network<S> net = random_network<S>();
  const EigenNetwork<S> evaluate{net};
  sim::Random random{"inputs"};
  auto inputs = random_inputs<S>(random);
  for (auto _ : state) {
    benchmark::DoNotOptimize(inputs);
    benchmark::DoNotOptimize(evaluate(inputs));
  }
  const auto ours = net(inputs);
  const S theirs = evaluate(inputs);
  if (!ours || std::abs(*ours - theirs) > S(1e-4)) state.SkipWithError("the answers differ");
}

BENCHMARK(network<float>);
BENCHMARK(network<double>);
BENCHMARK(eigen_expression<float>);
BENCHMARK(eigen_expression<double>);

}  // namespace
