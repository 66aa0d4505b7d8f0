// SPDX-License-Identifier: MIT
// Cost of one scalar update and one step of time beside the textbook's dense Joseph form, and of a
// whole measurement through a tracker. `ten_million_updates` is no race: its counters tell how far
// a float filter has drifted from a double one, in standard deviations of nine states, after 10⁷
// updates.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Dense>
#include <benchmark/benchmark.h>

#include <uwbpos/filter/kalman.hpp>
#include <uwbpos/filter/motion/constant_velocity.hpp>
#include <uwbpos/filter/motion/inertial.hpp>
#include <uwbpos/filter/motion/planar_body.hpp>
#include <uwbpos/filter/motion/planar_robot.hpp>
#include <uwbpos/filter/tracker.hpp>
#include <uwbpos/sim/noise.hpp>

namespace {

using namespace uwbpos;

// Position, velocity, acceleration in space, moved by the jerk of 5 ms.
template <class S>
struct Nine {
  Mat<S, 9> f = Mat<S, 9>::Identity();
  Eigen::Matrix<S, 9, 3> g = Eigen::Matrix<S, 9, 3>::Zero();
  Vec<S, 3> q = Vec<S, 3>::Constant(S(0.005));
  Nine() {
    for (int k = 0; k < 3; ++k) {
      f(k, 3 + k) = f(3 + k, 6 + k) = S(0.005);
      f(k, 6 + k) = S(0.0000125);
      g(6 + k, k) = S(1);
    }
  }
};

template <class S, int D>
Vec<S, D> direction(sim::Random& random) {
  Vec<double, D> v;
  for (int k = 0; k < D; ++k) v[k] = random.normal();
  return (v / v.norm()).template cast<S>();
}

// Directions from which something is measured.
template <class S, int M>
std::vector<Vec<S, M>> rows() {
  sim::Random random{"rows"};
  std::vector<Vec<S, M>> all(256);
  for (auto& row : all) row = direction<S, M>(random);
  return all;
}

template <class S, int N>
void dense_joseph(benchmark::State& state) {
  const auto all = rows<S, 3>();
  Mat<S, N> p = Mat<S, N>::Identity();
  Vec<S, N> x = Vec<S, N>::Zero();
  Eigen::Matrix<S, 1, N> h = Eigen::Matrix<S, 1, N>::Zero();
  const S r = S(1);
  std::size_t i = 0;
  for (auto _ : state) {
    h.template leftCols<3>() = all[i++ % all.size()].transpose();
    const Vec<S, N> ph = p * h.transpose();
    const S s = (h * ph)(0) + r;
    const Vec<S, N> k = ph / s;
    const Mat<S, N> a = Mat<S, N>::Identity() - k * h;
    x += k * S(0.01);
    p = (a * p * a.transpose() + k * r * k.transpose()).eval();
    benchmark::DoNotOptimize(p);
    benchmark::DoNotOptimize(x);
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(dense_joseph<float, 6>);
BENCHMARK(dense_joseph<double, 6>);
BENCHMARK(dense_joseph<float, 9>);
BENCHMARK(dense_joseph<double, 9>);

template <class S, int N, int M>
void sparse_update(benchmark::State& state) {
  const auto all = rows<S, M>();
  KalmanFilter<S, N> filter{Vec<S, N>::Zero(), FactoredCovariance<S, N>{Vec<S, N>::Ones()}};
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(filter.update(S(0.01), all[i++ % all.size()], S(1)));
    benchmark::DoNotOptimize(filter);
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(sparse_update<float, 6, 3>);
BENCHMARK(sparse_update<double, 6, 3>);
BENCHMARK(sparse_update<float, 9, 3>);
BENCHMARK(sparse_update<double, 9, 3>);
BENCHMARK(sparse_update<float, 15, 6>);
BENCHMARK(sparse_update<double, 15, 6>);

template <class Motion>
void step_of_time(benchmark::State& state) {
  using S = typename Motion::Scalar;
  Track<Motion, 0> track;
  track.covariance = FactoredCovariance<S, Motion::kDof>{Vec<S, Motion::kDof>::Constant(S(0.01))};
  const TrackModel<Motion> model;
  for (auto _ : state) {
    advance(track, model, track.time + 5'000);
    benchmark::DoNotOptimize(track);
  }
  state.SetItemsProcessed(state.iterations());
}
#define OF_EACH_MOTION(name)                    \
  BENCHMARK(name<ConstantVelocity<float, 2>>);  \
  BENCHMARK(name<ConstantVelocity<double, 2>>); \
  BENCHMARK(name<ConstantVelocity<float, 3>>);  \
  BENCHMARK(name<ConstantVelocity<double, 3>>); \
  BENCHMARK(name<PlanarRobot<float>>);          \
  BENCHMARK(name<PlanarRobot<double>>);         \
  BENCHMARK(name<PlanarBody<float>>);           \
  BENCHMARK(name<PlanarBody<double>>);          \
  BENCHMARK(name<Inertial<float>>);             \
  BENCHMARK(name<Inertial<double>>)
OF_EACH_MOTION(step_of_time);

// A range every 5 ms from eight anchors, all of a tracker's work.
template <class Motion>
void tracked_range(benchmark::State& state) {
  using S = typename Motion::Scalar;
  TrackerOptions<Motion> options;
  options.heading = Measured<S>{S(0), S(0.01)};
  Tracker<Motion> tracker{options};
  Vec<S, 3> anchors[8];
  for (int i = 0; i < 8; ++i) {
    anchors[i] = {S(10 * std::cos(0.785 * i)), S(10 * std::sin(0.785 * i)), S(i % 2 == 0 ? 3 : 0)};
    static_cast<void>(tracker.add_anchor(static_cast<std::uint32_t>(i), anchors[i]));
  }
  Vec<S, 3> place{S(1), S(2), Motion::kDimension == 3 ? S(1) : S(0)};
  std::int64_t time = 0;
  std::uint32_t id = 0;
  sim::Random random{"tracked"};
  for (auto _ : state) {
    const S range = (place - anchors[id]).norm() + static_cast<S>(random.normal(0, 0.1));
    benchmark::DoNotOptimize(tracker.update(TimedRange<S>{time, id, range}));
    time += 5'000;
    id = (id + 1) % 8;
  }
  state.counters["bytes"] = sizeof(tracker);
  state.counters["used"] = tracker.counters().used() / static_cast<double>(state.iterations());
  state.SetItemsProcessed(state.iterations());
}
OF_EACH_MOTION(tracked_range);

void ten_million_updates(benchmark::State& state) {
  for (auto _ : state) {
    const Nine<float> single;
    const Nine<double> precise;
    KalmanFilter<float, 9> a{Vec<float, 9>::Zero(),
                             FactoredCovariance<float, 9>{Vec<float, 9>::Constant(4)}};
    KalmanFilter<double, 9> b{Vec<double, 9>::Zero(),
                              FactoredCovariance<double, 9>{Vec<double, 9>::Constant(4)}};
    sim::Random random{"ten million"};
    double state_off = 0;
    double sigma_off = 0;
    double least = 1;
    for (int i = 0; i < 10'000'000; ++i) {
      const Vec<double, 3> row = direction<double, 3>(random);
      const double noise = i % 7 == 0 ? 1e-6 : 1e-2;
      const double z = random.normal(0, 0.1);
      a.predict(single.f, single.g, single.q);
      b.predict(precise.f, precise.g, precise.q);
      const Vec<float, 3> row_f = row.cast<float>();
      static_cast<void>(b.update(z - row.dot(b.state.head<3>()), row, noise));
      static_cast<void>(a.update(static_cast<float>(z) - row_f.dot(a.state.head<3>()), row_f,
                                 static_cast<float>(noise)));
      if (i % 1000 != 0) continue;
      for (int k = 0; k < 9; ++k) {
        const double sigma = std::sqrt(b.covariance(k, k));
        const double sigma_f = std::sqrt(static_cast<double>(a.covariance(k, k)));
        state_off =
            std::max(state_off, std::abs(static_cast<double>(a.state[k]) - b.state[k]) / sigma);
        sigma_off = std::max(sigma_off, std::abs(sigma_f / sigma - 1));
        least = std::min(least, static_cast<double>(a.covariance.diagonal()[k]));
      }
    }
    state.counters["state_off_sigmas"] = state_off;
    state.counters["sigma_off"] = sigma_off;
    state.counters["least_d"] = least;
  }
}
BENCHMARK(ten_million_updates)->Iterations(1)->Unit(benchmark::kSecond);

}  // namespace
