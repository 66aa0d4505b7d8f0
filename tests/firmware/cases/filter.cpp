// SPDX-License-Identifier: MIT
// The filter's two steps and the network.
#include "uwbpos/filter/kalman.hpp"
#include "uwbpos/filter/link_features.hpp"

#include "../../examples/bias_training/lias/bias_network.hpp"
#include "bench.hpp"

namespace firmware::filter {

using namespace uwbpos;

namespace {

constexpr int kStates = 6;

struct Measurement {
  Vec<float, 3> row;
  float innovation, noise;
};

KalmanFilter<float, kStates>& filter() {
  static KalmanFilter<float, kStates> instance{
      Vec<float, kStates>::Zero(),
      FactoredCovariance<float, kStates>{Vec<float, kStates>::Constant(4)}};
  return instance;
}

struct Told {
  Vec<float, kStates> state;
  Vec<float, kStates> diagonal;
  Result<float> variance;
};

// One scalar measurement of the position of a moving point.
struct Update {
  static constexpr int kRounds = 40;
  static constexpr bool kStateful = true;
  using Input = Measurement;
  using Output = Result<float>;
  static Output run(const Input& in) { return filter().update<3>(in.innovation, in.row, in.noise); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    Vec<double, 3> row{random.normal(), random.normal(), random.normal()};
    row /= row.norm();
    in = {row.cast<float>(), to_float(random.normal(0, 0.1)), 0.01f};
  }
#endif
};

// 5 ms of it, and then all of the filter as the updates have left it.
struct Predict {
  static constexpr int kRounds = 20;
  static constexpr bool kStateful = true;
  using Input = float;
  using Output = Told;
  static Output run(const Input& t) {
    Mat<float, kStates> f = Mat<float, kStates>::Identity();
    Mat<float, kStates> g = Mat<float, kStates>::Zero();
    Vec<float, kStates> q;
    for (int k = 0; k < 3; ++k) {
      f(k, 3 + k) = t;
      g(k, k) = t / 2;
      g(3 + k, k) = 1;
      g(k, 3 + k) = 1;
      q[k] = t;
      q[3 + k] = t * t * t / 12;
    }
    filter().predict<kStates>(f, g, q);
    return {filter().state, filter().covariance.diagonal(), 0.0f};
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random&, int) { in = 0.005f; }
#endif
};

struct Link {
  Vec<float, 3> offset;
  Mat<float, 3> attitude;
  std::uint32_t anchor, tag;
};

// How a link lies, and what its bias is: 21-50-50-1, weights in flash.
struct Network {
  static constexpr int kRounds = 10;
  using Input = Link;
  using Output = Result<float>;
  static Output run(const Input& in) {
    return lias::kNetwork(link_features<8, 3>(in.offset, in.attitude, in.anchor, in.tag));
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int round) {
    in.offset = {to_float(random.uniform(-5, 5)), to_float(random.uniform(-4, 4)), 0.084f};
    const double angle = random.uniform(-3, 3);
    in.attitude.setIdentity();
    in.attitude(0, 0) = in.attitude(1, 1) = to_float(std::cos(angle));
    in.attitude(1, 0) = to_float(std::sin(angle));
    in.attitude(0, 1) = -in.attitude(1, 0);
    in.anchor = static_cast<std::uint32_t>(round % 8);
    in.tag = static_cast<std::uint32_t>(round % 3);
  }
#endif
};

}  // namespace

#define FILTER_CASES(X)        \
  X(kalman_update_6_3, Update) \
  X(kalman_predict_6, Predict) \
  X(bias_network_21_50_50, Network)
FIRMWARE_UNIT(FILTER_CASES)

}  // namespace firmware::filter
