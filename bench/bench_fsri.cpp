// SPDX-License-Identifier: MIT
// Cost of one shot of ultrasound: three, four and eight receivers, in the plane and in space, lags
// common to all or whole waves apart; `rms_mm` shows what it buys.
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include <benchmark/benchmark.h>

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
  double squares = 0;
  double solved = 0;
  for (auto _ : state) {
    const auto shot = fsri(receivers, shots[k], {.wavelength = S(sim::kPaperWave)});
    benchmark::DoNotOptimize(shot);
    if (shot) {
      squares += (shot->position.template cast<double>() - emitters[k]).squaredNorm();
      ++solved;
    }
    k = (k + 1) % kCount;
  }
  state.counters["rms_mm"] = 1000 * std::sqrt(squares / solved);
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

void three_common(benchmark::State& s) { run<double, 2, 3>(s, sim::paper_receivers(), true); }
void three_late(benchmark::State& s) { run<double, 2, 3>(s, sim::paper_receivers(), false); }
void three_late_float(benchmark::State& s) { run<float, 2, 3>(s, sim::paper_receivers(), false); }
void four_common(benchmark::State& s) { run<double, 2, 4>(s, four(), true); }
void four_late(benchmark::State& s) { run<double, 2, 4>(s, four(), false); }
void eight_common(benchmark::State& s) { run<double, 2, 8>(s, ring<2, 8>(), true); }
void eight_late(benchmark::State& s) { run<double, 2, 8>(s, ring<2, 8>(), false); }
void eight_late_in_line(benchmark::State& s) { run<double, 2, 8>(s, eight_in_line(), false); }
void eight_common_in_space(benchmark::State& s) { run<double, 3, 8>(s, ring<3, 8>(), true); }
void eight_late_in_space(benchmark::State& s) { run<double, 3, 8>(s, ring<3, 8>(), false); }

BENCHMARK(three_common);
BENCHMARK(three_late);
BENCHMARK(three_late_float);
BENCHMARK(four_common);
BENCHMARK(four_late);
BENCHMARK(eight_common);
BENCHMARK(eight_late);
BENCHMARK(eight_late_in_line);
BENCHMARK(eight_common_in_space);
BENCHMARK(eight_late_in_space);

}  // namespace
