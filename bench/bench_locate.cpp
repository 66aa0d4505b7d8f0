// SPDX-License-Identifier: MIT
// Cost of one position from ranges, for each solver, beside the way it is commonly written: an
// iteration from the anchors' mean with Eigen's dynamic matrices. Ratios are what to read; the
// column `rms_m` shows that the answers are the same.
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Dense>
#include <benchmark/benchmark.h>

#include <uwbpos/accuracy/dop.hpp>
#include <uwbpos/sim/noise.hpp>
#include <uwbpos/solve/locate.hpp>
#include <uwbpos/solve/toa_chan.hpp>
#include <uwbpos/solve/toa_linear.hpp>

namespace {

using namespace uwbpos;

constexpr std::size_t kCount = 1024;

template <class S, int D>
struct Snapshot {
  Vec<S, D> tag;
  std::vector<RangeTo<S, D>> ranges;
};

// Eight anchors (four in the plane) around a hall of 20 m × 15 m, tags anywhere in it, σ = 0.1 m.
template <class S, int D>
std::vector<Snapshot<S, D>> snapshots(bool flat = false) {
  sim::Random random{"bench locate"};
  std::vector<Snapshot<S, D>> all(kCount);
  for (auto& snapshot : all) {
    const double tag[3] = {random.uniform(0, 20), random.uniform(0, 15), random.uniform(0, 2)};
    for (int k = 0; k < D; ++k) snapshot.tag[k] = static_cast<S>(tag[k]);
    for (int i = 0; i < (D == 2 ? 4 : 8); ++i) {
      const double height = flat || (i & 4) != 0 ? 3 : 0.5;
      const double place[3] = {((i & 1) ^ (i >> 1 & 1)) != 0 ? 20.0 : 0.0,
                               (i & 2) != 0 ? 15.0 : 0.0, height};
      RangeTo<S, D> r{};
      for (int k = 0; k < D; ++k)
        r.anchor[k] = static_cast<S>(place[k] + random.normal(0, flat && k == 2 ? 0 : 0.3));
      r.range = (snapshot.tag - r.anchor).norm() + static_cast<S>(random.normal(0, 0.1));
      if (r.range < 0) r.range = 0;
      r.sigma = S(0.1);
      snapshot.ranges.push_back(r);
    }
  }
  return all;
}

template <class S, int D, class Solve>
void run(benchmark::State& state, const std::vector<Snapshot<S, D>>& all, const Solve& solve) {
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(solve(all[i++ % kCount].ranges));
  double squares = 0;
  std::size_t solved = 0;
  for (const auto& snapshot : all) {
    if (const auto fix = solve(snapshot.ranges)) {
      squares += static_cast<double>((fix->position - snapshot.tag).squaredNorm());
      ++solved;
    }
  }
  state.counters["rms_m"] = std::sqrt(squares / static_cast<double>(solved));
  state.counters["refused"] = static_cast<double>(kCount - solved);
  state.SetItemsProcessed(state.iterations());
}

// The common way: from the mean of the anchors until the step is small, everything allocated.
template <class S, int D>
Result<Fix<S, D>> textbook(const std::vector<RangeTo<S, D>>& ranges) {
  using Matrix = Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<S, Eigen::Dynamic, 1>;
  const auto n = static_cast<Eigen::Index>(ranges.size());
  Vector position = Vector::Zero(D);
  for (const auto& r : ranges) position += r.anchor / static_cast<S>(n);
  position[D - 1] -= S(1);  // off the plane, or the first step is singular
  Matrix jacobian(n, D);
  Vector residual(n);
  for (int iteration = 0; iteration < 30; ++iteration) {
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto& r = ranges[static_cast<std::size_t>(i)];
      const Vector offset = position - r.anchor;
      const S predicted = offset.norm();
      jacobian.row(i) = offset.transpose() / (predicted * r.sigma);
      residual[i] = (r.range - predicted) / r.sigma;
    }
    const Vector step =
        (jacobian.transpose() * jacobian).ldlt().solve(jacobian.transpose() * residual);
    position += step;
    if (step.norm() < S(1e-4)) break;
  }
  Fix<S, D> fix;
  fix.position = position;
  fix.covariance = (jacobian.transpose() * jacobian).inverse();
  fix.chi_squared = residual.squaredNorm();
  fix.degrees_of_freedom = static_cast<int>(n) - D;
  return fix;
}

template <class S, int D>
void textbook_gauss_newton(benchmark::State& state) {
  run(state, snapshots<S, D>(), [](const auto& r) { return textbook<S, D>(r); });
}
BENCHMARK(textbook_gauss_newton<double, 2>);
BENCHMARK(textbook_gauss_newton<double, 3>);

template <class S, int D>
void locate_spanned(benchmark::State& state) {
  run(state, snapshots<S, D>(), [](const auto& r) { return locate(r); });
}
BENCHMARK(locate_spanned<float, 2>);
BENCHMARK(locate_spanned<double, 2>);
BENCHMARK(locate_spanned<float, 3>);
BENCHMARK(locate_spanned<double, 3>);

template <class S>
void locate_ceiling(benchmark::State& state) {
  run(state, snapshots<S, 3>(true), [](const auto& r) { return locate(r, {.side = {0, 0, -1}}); });
}
BENCHMARK(locate_ceiling<float>);
BENCHMARK(locate_ceiling<double>);

template <class S>
void least_squares(benchmark::State& state) {
  run(state, snapshots<S, 3>(), [](const auto& r) { return toa_least_squares(r); });
}
BENCHMARK(least_squares<float>);
BENCHMARK(least_squares<double>);

template <class S>
void chan(benchmark::State& state) {
  run(state, snapshots<S, 3>(), [](const auto& r) { return toa_chan(r); });
}
BENCHMARK(chan<float>);
BENCHMARK(chan<double>);

template <class S>
void linear(benchmark::State& state) {
  run(state, snapshots<S, 3>(), [](const auto& r) { return toa_linear(r); });
}
BENCHMARK(linear<float>);
BENCHMARK(linear<double>);

template <class S>
void closed_form(benchmark::State& state) {
  const auto all = snapshots<S, 3>();
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(toa_closed_form(all[i++ % kCount].ranges));
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(closed_form<float>);
BENCHMARK(closed_form<double>);

template <class S>
void dilution(benchmark::State& state) {
  std::vector<std::vector<Vec<S, 3>>> anchors;
  const auto all = snapshots<S, 3>();
  for (const auto& snapshot : all) {
    anchors.emplace_back();
    for (const auto& r : snapshot.ranges) anchors.back().push_back(r.anchor);
  }
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(range_dop(anchors[i % kCount], all[i % kCount].tag));
    ++i;
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(dilution<float>);
BENCHMARK(dilution<double>);

}  // namespace
