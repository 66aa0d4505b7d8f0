// SPDX-License-Identifier: MIT
// Cost of one shot of ultrasound: three, four and eight receivers, in the plane and in space, lags
// common to all or whole waves apart. `error_over_bound` is the error over the bound of a shot
// whose waves are known, so that where waves are mistaken it is far above one.
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include <benchmark/benchmark.h>

#include <uwbpos/accuracy/cramer_rao.hpp>
#include <uwbpos/sim/ultrasonic.hpp>
#include <uwbpos/solve/fsri.hpp>

namespace {

using namespace uwbpos;

constexpr std::size_t kCount = 256;

template <int D, std::size_t N>
std::array<Vec<double, D>, N> ring() {
  std::array<Vec<double, D>, N> receivers;
  for (std::size_t i = 0; i < N; ++i) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(i) / N;
    receivers[i].setZero();
    receivers[i][0] = 0.8 + 1.2 * std::cos(angle);
    receivers[i][1] = 0.8 + 1.2 * std::sin(angle);
    if (D == 3) receivers[i][2] = i % 2 == 0 ? 0.0 : 0.7;
  }
  return receivers;
}

template <class S, int D, std::size_t N>
void run(benchmark::State& state, const std::array<Vec<double, D>, N>& placed, bool common) {
  sim::Random random{"bench fsri"};
  std::array<Vec<S, D>, N> receivers;
  for (std::size_t i = 0; i < N; ++i) receivers[i] = placed[i].template cast<S>();
  std::vector<std::array<S, N>> shots(kCount);
  std::vector<Vec<double, D>> emitters(kCount);
  for (std::size_t k = 0; k < kCount; ++k) {
    emitters[k].setConstant(0.3);
    emitters[k].template head<2>() = sim::paper_emitter(static_cast<int>(k));
    std::array<int, N> waves{};
    waves.fill(2);
    const auto shot = common ? sim::late_shot<D, N>(random, placed, emitters[k], waves)
                             : sim::paper_shot<D, N>(random, placed, emitters[k]);
    for (std::size_t i = 0; i < N; ++i) shots[k][i] = S(shot.lengths[i]);
  }
  std::size_t k = 0;
  const auto solve = [&](const std::array<S, N>& lengths) {
    return fsri(receivers, lengths, {.wavelength = S(sim::kPaperWave)});
  };
  for (auto _ : state) {
    benchmark::DoNotOptimize(solve(shots[k]));
    k = (k + 1) % kCount;
  }
  state.SetItemsProcessed(state.iterations());
  double squares = 0;
  double bounds = 0;
  double refused = 0;
  std::vector<DifferenceTo<double, D>> others;
  for (std::size_t i = 1; i < N; ++i) others.push_back({placed[i], 0});
  // Its noise is even up to this.
  const double sigma = sim::kPaperNoise / std::numbers::sqrt3;
  for (std::size_t i = 0; i < kCount; ++i) {
    const auto shot = solve(shots[i]);
    const auto bound = cramer_rao_bound(placed[0], others, sigma, emitters[i]);
    if (shot && bound) {
      squares += (shot->position.template cast<double>() - emitters[i]).squaredNorm();
      bounds += bound->trace();
    } else {
      ++refused;
    }
  }
  state.counters["error_over_bound"] = std::sqrt(squares / bounds);
  state.counters["refused"] = refused / kCount;
}

std::array<Vec<double, 2>, 4> four() {
  const auto bar = sim::paper_receivers();
  return {bar[0], bar[1], bar[2], Vec<double, 2>{-0.4, 0.4}};
}

std::array<Vec<double, 2>, 8> eight_in_line() {
  std::array<Vec<double, 2>, 8> line;
  for (std::size_t i = 0; i < 8; ++i) line[i] = {-0.4 + 0.8 * static_cast<double>(i) / 7, 0};
  return line;
}

template <class S>
void three_common(benchmark::State& s) {
  run<S, 2, 3>(s, sim::paper_receivers(), true);
}
template <class S>
void three_late(benchmark::State& s) {
  run<S, 2, 3>(s, sim::paper_receivers(), false);
}
template <class S>
void four_common(benchmark::State& s) {
  run<S, 2, 4>(s, four(), true);
}
template <class S>
void four_late(benchmark::State& s) {
  run<S, 2, 4>(s, four(), false);
}
template <class S>
void eight_common(benchmark::State& s) {
  run<S, 2, 8>(s, ring<2, 8>(), true);
}
template <class S>
void eight_late(benchmark::State& s) {
  run<S, 2, 8>(s, ring<2, 8>(), false);
}
template <class S>
void eight_late_in_line(benchmark::State& s) {
  run<S, 2, 8>(s, eight_in_line(), false);
}
template <class S>
void eight_common_in_space(benchmark::State& s) {
  run<S, 3, 8>(s, ring<3, 8>(), true);
}
template <class S>
void eight_late_in_space(benchmark::State& s) {
  run<S, 3, 8>(s, ring<3, 8>(), false);
}

BENCHMARK(three_common<float>);
BENCHMARK(three_common<double>);
BENCHMARK(three_late<float>);
BENCHMARK(three_late<double>);
BENCHMARK(four_common<float>);
BENCHMARK(four_common<double>);
BENCHMARK(four_late<float>);
BENCHMARK(four_late<double>);
BENCHMARK(eight_common<float>);
BENCHMARK(eight_common<double>);
BENCHMARK(eight_late<float>);
BENCHMARK(eight_late<double>);
BENCHMARK(eight_late_in_line<float>);
BENCHMARK(eight_late_in_line<double>);
BENCHMARK(eight_common_in_space<float>);
BENCHMARK(eight_common_in_space<double>);
BENCHMARK(eight_late_in_space<float>);
BENCHMARK(eight_late_in_space<double>);

}  // namespace
