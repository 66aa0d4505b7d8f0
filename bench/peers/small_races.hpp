// SPDX-License-Identifier: MIT
// Races of two: closed form, filter update and network beside the plain way to write them.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include <uwbpos/filter/kalman.hpp>
#include <uwbpos/sim/noise.hpp>
#include <uwbpos/solve/toa_least_squares.hpp>
#include <uwbpos/solve/toa_three_anchors.hpp>

#include "../networks.hpp"
#include "timing.hpp"

namespace peers {

struct SmallRace {
  Times times;
  bool agree;
};

inline SmallRace on_axes() {
  struct Input {
    double d1, d2, d3, x2, y3;
  };
  uwbpos::sim::Random random{"axes"};
  std::vector<Input> all(1024);
  for (Input& in : all) {
    const Eigen::Vector2d tag{random.uniform(0, 20), random.uniform(0, 15)};
    in = {tag.norm(), (tag - Eigen::Vector2d{20, 0}).norm(), (tag - Eigen::Vector2d{0, 15}).norm(),
          20, 15};
  }
  const auto bare = [](const Input& in) {
    return Eigen::Vector2d{(in.d1 * in.d1 - in.d2 * in.d2 + in.x2 * in.x2) / (2 * in.x2),
                           (in.d1 * in.d1 - in.d3 * in.d3 + in.y3 * in.y3) / (2 * in.y3)};
  };
  bool agree = true;
  for (const Input& in : all) {
    const auto found = uwbpos::toa_on_axes(in.d1, in.d2, in.d3, in.x2, in.y3);
    agree = agree && found && (*found - bare(in)).norm() < 1e-12 * 100;
  }
  const auto first = [&all] {
    for (const Input& in : all) keep(uwbpos::toa_on_axes(in.d1, in.d2, in.d3, in.x2, in.y3));
  };
  const auto second = [&all, bare] {
    for (const Input& in : all) keep(bare(in));
  };
  return {race({{all.size(), first}, {all.size(), second}}, 201), agree};
}

// Three anchors: two differences of squares, a system of two by two (000-15).
inline SmallRace anywhere() {
  using Range = uwbpos::RangeTo<double, 2>;
  uwbpos::sim::Random random{"anywhere"};
  std::vector<std::array<Range, 3>> all(1024);
  for (auto& ranges : all) {
    const Eigen::Vector2d tag{random.uniform(0, 20), random.uniform(0, 15)};
    const Eigen::Vector2d places[3] = {{0, 0}, {20, 1}, {2, 15}};
    for (std::size_t i = 0; i < 3; ++i) {
      ranges[i] = {places[i], (tag - places[i]).norm(), 0.1};
    }
  }
  const auto bare = [](const std::array<Range, 3>& r) {
    const Eigen::Vector2d a = r[1].anchor - r[0].anchor;
    const Eigen::Vector2d b = r[2].anchor - r[0].anchor;
    const double square = r[0].range * r[0].range;
    const double u = (square - r[1].range * r[1].range + a[0] * a[0] + a[1] * a[1]) / 2;
    const double v = (square - r[2].range * r[2].range + b[0] * b[0] + b[1] * b[1]) / 2;
    const double inverse = 1 / (a[0] * b[1] - a[1] * b[0]);
    return Eigen::Vector2d{r[0].anchor[0] + (u * b[1] - v * a[1]) * inverse,
                           r[0].anchor[1] + (a[0] * v - b[0] * u) * inverse};
  };
  bool agree = true;
  for (const auto& ranges : all) {
    const auto found = uwbpos::toa_three_anchors(ranges);
    agree = agree && found && (*found - bare(ranges)).norm() < 1e-10;
  }
  const auto first = [&all] {
    for (const auto& ranges : all) keep(uwbpos::toa_three_anchors(ranges));
  };
  const auto second = [&all, bare] {
    for (const auto& ranges : all) keep(bare(ranges));
  };
  return {race({{all.size(), first}, {all.size(), second}}, 101), agree};
}

template <class S>
SmallRace filter_update() {
  constexpr int N = 9;
  constexpr std::size_t kUpdates = 1024;
  using Matrix = Eigen::Matrix<S, N, N>;
  using Vector = Eigen::Matrix<S, N, 1>;
  struct Measurement {
    Eigen::Matrix<S, 3, 1> row;
    S innovation;
  };
  uwbpos::sim::Random random{"update"};
  std::vector<Measurement> all(kUpdates);
  for (auto& m : all) {
    const Eigen::Vector3d v{random.normal(), random.normal(), random.normal()};
    m.row = (v / v.norm()).cast<S>();
    m.innovation = static_cast<S>(random.normal(0, 0.1));
  }
  // Some correlation, as a filter has it: A Aᵀ of a random A.
  Matrix a;
  for (int i = 0; i < N * N; ++i) a(i % N, i / N) = static_cast<S>(random.normal());
  const Matrix initial = a * a.transpose() + Matrix::Identity();
  const S noise = S(1);
  const auto covariance = uwbpos::FactoredCovariance<S, N>::from_matrix(initial);
  const auto sparse = [&] {
    uwbpos::KalmanFilter<S, N> filter{Vector::Zero(), *covariance};
    for (const auto& m : all) keep(filter.update(m.innovation, m.row, noise));
    return filter;
  };
  const auto dense = [&] {
    std::pair<Vector, Matrix> filter{Vector::Zero(), initial};
    auto& [x, p] = filter;
    for (const auto& m : all) {
      Eigen::Matrix<S, 1, N> h = Eigen::Matrix<S, 1, N>::Zero();
      h.template head<3>() = m.row.transpose();
      const Vector ph = p * h.transpose();
      const S s = (h * ph)(0) + noise;
      const Vector k = ph / s;
      const Matrix left = Matrix::Identity() - k * h;
      x += k * m.innovation;
      p = (left * p * left.transpose() + k * noise * k.transpose()).eval();
      keep(p);
      keep(x);
    }
    return filter;
  };
  if (!covariance) return {};
  const auto ours = sparse();
  const auto theirs = dense();
  const S tolerance = std::is_same_v<S, float> ? S(1e-2) : S(1e-9);
  const bool agree = (ours.state - theirs.first).norm() < tolerance &&
                     (ours.covariance.matrix() - theirs.second).norm() < tolerance * initial.norm();
  return {race({{kUpdates, [&] { keep(sparse()); }}, {kUpdates, [&] { keep(dense()); }}}), agree};
}

template <class S>
SmallRace bias_network() {
  const auto net = benches::random_network<S>();
  const benches::EigenNetwork<S> plain{net};
  uwbpos::sim::Random random{"inputs"};
  std::vector<std::array<S, benches::kInputs>> all(256);
  for (auto& inputs : all) inputs = benches::random_inputs<S>(random);
  bool agree = true;
  for (const auto& in : all) {
    const auto found = net(in);
    agree = agree && found && std::abs(*found - plain(in)) < S(1e-4);
  }
  const auto first = [&] {
    for (const auto& in : all) keep(net(in));
  };
  const auto second = [&] {
    for (const auto& in : all) keep(plain(in));
  };
  return {race({{all.size(), first}, {all.size(), second}}, 101), agree};
}

// Nanoseconds an anchor of `toa_least_squares` with 4 … 64 anchors around a hall.
inline std::vector<std::pair<int, double>> by_anchors() {
  constexpr std::size_t kEpochs = 64;
  const int counts[] = {4, 8, 16, 32, 64};
  std::vector<std::vector<std::vector<uwbpos::RangeTo<double, 3>>>> sets;
  uwbpos::sim::Random random{"anchors"};
  for (const int n : counts) {
    auto& epochs = sets.emplace_back(kEpochs);
    for (auto& ranges : epochs) {
      const Eigen::Vector3d tag{random.uniform(1, 19), random.uniform(1, 14),
                                random.uniform(0.5, 2)};
      for (int i = 0; i < n; ++i) {
        const double angle = 6.283 * i / n;
        const Eigen::Vector3d anchor{10 + 14 * std::cos(angle), 7.5 + 11 * std::sin(angle),
                                     i % 2 == 0 ? 0.3 : 4.0};
        ranges.push_back({anchor, (tag - anchor).norm() + random.normal(0, 0.1), 0.1});
      }
    }
  }
  std::vector<Contender> contenders;
  for (const auto& epochs : sets) {
    contenders.push_back({kEpochs, [&epochs] {
                            for (const auto& r : epochs) keep(uwbpos::toa_least_squares(r));
                          }});
  }
  const Times times = race(contenders, 101);
  std::vector<std::pair<int, double>> result;
  for (std::size_t i = 0; i < std::size(counts); ++i) {
    result.emplace_back(counts[i], times.nanoseconds[i] / counts[i]);
  }
  return result;
}

}  // namespace peers
