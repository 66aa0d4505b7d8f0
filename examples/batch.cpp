// SPDX-License-Identifier: MIT
// A server's hour: half a million epochs of tags in one hall, solved several to a register, by one
// thread and by as many as there are cores. Compile with -mavx2 -mfma, or -march=native, for eight
// floats a register; the baseline of x86-64 has four.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <thread>
#include <vector>

#include <uwbpos/sim/noise.hpp>
#include <uwbpos/solve/batch.hpp>

namespace {

using S = float;
using Fixes = std::vector<uwbpos::Result<uwbpos::Fix<S, 3>>>;
using HallPoint = uwbpos::Vec<S, 3>;

// Solves in parts, one a thread; a part has the ranges to each anchor side by side.
struct Part {
  std::vector<S> ranges;
  std::vector<HallPoint> tags;
  Fixes fixes;
};

double solve(std::vector<Part>& parts, const std::vector<HallPoint>& anchors,
             const std::vector<S>& sigmas, std::size_t threads) {
  const auto begin = std::chrono::steady_clock::now();
  {
    std::vector<std::jthread> workers;
    for (std::size_t t = 0; t < threads; ++t) {
      workers.emplace_back([&, t] {
        for (std::size_t p = t; p < parts.size(); p += threads) {
          Part& part = parts[p];
          const uwbpos::RangeBatch<S, 3> batch{anchors, sigmas, part.ranges};
          if (!uwbpos::locate(batch, std::span{part.fixes})) std::puts("spans do not fit");
        }
      });
    }
  }
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace

int main() {
  constexpr std::size_t kParts = 128;
  constexpr std::size_t kEpochs = 4096;
  constexpr S kSigma = S(0.1);
  const std::vector<HallPoint> anchors{{0, 0, S(0.3)},  {20, 0, 4},      {20, 15, S(0.3)},
                                       {0, 15, 4},      {10, 0, S(2)},   {0, 8, 1},
                                       {20, 7, S(3.5)}, {10, 15, S(2.5)}};
  const std::vector<S> sigmas(anchors.size(), kSigma);
  std::vector<Part> parts(kParts);
  uwbpos::sim::Random random{"batch"};
  for (Part& part : parts) {
    part.ranges.resize(anchors.size() * kEpochs);
    part.fixes.assign(kEpochs, std::unexpected(uwbpos::Error::TooFewMeasurements));
    for (std::size_t e = 0; e < kEpochs; ++e) {
      const HallPoint tag{S(random.uniform(1, 19)), S(random.uniform(1, 14)),
                          S(random.uniform(0.5, 2))};
      part.tags.push_back(tag);
      for (std::size_t i = 0; i < anchors.size(); ++i) {
        part.ranges[i * kEpochs + e] =
            uwbpos::norm<S, 3>(tag - anchors[i]) + S(random.normal(0, double(kSigma)));
      }
    }
  }

  const std::size_t cores = std::max(1U, std::thread::hardware_concurrency());
  std::printf("%zu epochs of %zu ranges, %zu floats a register\n", kParts * kEpochs, anchors.size(),
              uwbpos::kLanes<S>);
  solve(parts, anchors, sigmas, cores);  // warm
  double alone = 0;
  for (std::size_t threads = 1; threads <= cores; threads *= 2) {
    const double spent = solve(parts, anchors, sigmas, threads);
    if (threads == 1) alone = spent;
    std::printf("%3zu threads: %.3g million fixes a second, %.2f times one thread's\n", threads,
                kParts * kEpochs / spent / 1e6, alone / spent);
  }

  double square = 0;
  double expected = 0;
  std::size_t solved = 0;
  for (const Part& part : parts) {
    for (std::size_t e = 0; e < kEpochs; ++e) {
      if (!part.fixes[e]) continue;
      ++solved;
      square += double((part.fixes[e]->position - part.tags[e]).squaredNorm());
      expected += double(part.fixes[e]->covariance.trace());
    }
  }
  std::printf("%zu solved, rms error %.3f m, by their covariances %.3f m\n", solved,
              std::sqrt(square / double(solved)), std::sqrt(expected / double(solved)));
  // What is left has a mirror image that explains the ranges about as well, and says so.
  return solved > kParts * kEpochs / 100 * 99 ? 0 : 1;
}
