// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/filter/bias_network.hpp"
#include "uwbpos/filter/link_features.hpp"
#include "uwbpos/sim/noise.hpp"

#include "../../examples/bias_training/lias/bias_network.hpp"
#include "support/data.hpp"
#include "support/recordings.hpp"
#include "support/statistics.hpp"

namespace tests::filter_bias_network {

namespace {

using namespace uwbpos;

// |x − 2 y| below 3, by hand.
template <class S>
constexpr BiasNetwork<S, 2, 2, 2> kByHand{{-1, -1},
                                          {1, 1},
                                          {0, 0},
                                          {1, 1},
                                          {{{{1, -1}, {-2, 2}}}, {0, 0}},
                                          {{{{1, 0}, {1, 1}}}, {0, -3}},
                                          {{{{1}, {-1}}}, {0}}};

template <class S>
BiasNetwork<S, 5, 7, 6> random_network(sim::Random& random) {
  BiasNetwork<S, 5, 7, 6> network{};
  const auto fill = [&](auto& layer) {
    for (auto& row : layer.weights) {
      for (S& w : row) w = static_cast<S>(random.normal());
    }
    for (S& c : layer.biases) c = static_cast<S>(random.normal());
  };
  for (std::size_t i = 0; i < 5; ++i) {
    network.lowest[i] = -2;
    network.highest[i] = 2;
    network.mean[i] = static_cast<S>(random.normal());
    network.inverse_deviation[i] = static_cast<S>(random.uniform(0.5, 2));
  }
  fill(network.first);
  fill(network.second);
  fill(network.output);
  return network;
}

// The same with sums in order of outputs, in long double.
template <class Layer, class In>
std::vector<long double> plain(const Layer& layer, const In& input, bool rectified) {
  std::vector<long double> sums;
  for (std::size_t k = 0; k < layer.biases.size(); ++k) {
    auto sum = static_cast<long double>(layer.biases[k]);
    for (std::size_t i = 0; i < input.size(); ++i) {
      sum += static_cast<long double>(layer.weights[i][k]) * static_cast<long double>(input[i]);
    }
    sums.push_back(rectified && sum < 0 ? 0 : sum);
  }
  return sums;
}

}  // namespace

TEST_CASE_TEMPLATE("network: the same as written out in long double", S, float, double) {
  sim::Random random{"networks"};
  for (int trial = 0; trial < 200; ++trial) {
    const auto network = random_network<S>(random);
    std::array<S, 5> inputs;
    for (S& x : inputs) x = random.chance(0.3) ? S(0) : static_cast<S>(random.uniform(-2, 2));
    std::array<long double, 5> z;
    for (std::size_t i = 0; i < 5; ++i) {
      z[i] = (static_cast<long double>(inputs[i]) - static_cast<long double>(network.mean[i])) *
             static_cast<long double>(network.inverse_deviation[i]);
    }
    const auto h2 = plain(network.second, plain(network.first, z, true), true);
    const auto expected = static_cast<double>(plain(network.output, h2, false)[0]);
    const auto bias = network(inputs);
    REQUIRE(bias);
    // Some twenty roundings of sums that reach a hundred.
    const double tolerance = 2000 * static_cast<double>(std::numeric_limits<S>::epsilon());
    CHECK(std::abs(static_cast<double>(*bias) - expected) < tolerance);
  }
}

TEST_CASE_TEMPLATE("network: a distance, folded", S, float, double) {
  CHECK(*kByHand<S>({S(1), S(-0.5)}) == S(2));
  CHECK(*kByHand<S>({S(-1), S(1)}) == S(3));
}

TEST_CASE_TEMPLATE("network: inputs beyond training count as the nearest; nothing else passes", S,
                   float, double) {
  CHECK(*kByHand<S>({S(7), S(-0.5)}) == *kByHand<S>({S(1), S(-0.5)}));
  CHECK(*kByHand<S>({S(-1), S(1e30)}) == *kByHand<S>({S(-1), S(1)}));
  for (const S bad : {std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity(),
                      -std::numeric_limits<S>::infinity()}) {
    CHECK(kByHand<S>({bad, S(0)}).error() == Error::NotFinite);
    CHECK(kByHand<S>({S(0), bad}).error() == Error::NotFinite);
  }
  auto huge = kByHand<S>;
  for (auto& row : huge.first.weights) row = {std::numeric_limits<S>::max(), S(1)};
  CHECK(huge({S(1), S(1)}).error() == Error::NumericOverflow);
}

TEST_CASE_TEMPLATE("features: offset, length, directions in map and body, codes", S, float,
                   double) {
  const Vec<S, 3> offset{3, 4, 12};
  const Mat<S, 3> turned = rotation_matrix(quaternion_from_yaw(S(1.5707963267948966)));
  const auto inputs = link_features<4, 2>(offset, turned, 2, 1);
  const std::array<double, 16> expected{
      3,         4,         12, 13, 3.0 / 13, 4.0 / 13, 12.0 / 13, 4.0 / 13,
      -3.0 / 13, 12.0 / 13, 0,  0,  1,        0,        0,         1};
  for (std::size_t i = 0; i < 16; ++i) {
    CHECK(static_cast<double>(inputs[i]) == doctest::Approx(expected[i]).epsilon(1e-6));
  }
  const auto none = link_features<4, 2>(Vec<S, 3>{0, 0, 0}, turned, 9, 9);
  for (const S x : none) CHECK(x == S(0));
}

TEST_CASE("network: a trained one gives what its trainer gave") {
  for (const lias::Check& check : lias::kChecks) {
    const auto bias = lias::kNetwork(check.inputs);
    REQUIRE(bias);
    CHECK(std::abs(*bias - check.bias) < 1e-5f);
  }
}

TEST_CASE("network: trained on static poses it takes most of the bias off a drive") {
  const auto folder = test::data_or_skip("lias", "a network trained on lias/static, on lias/mid");
  if (!folder) return;
  const auto anchors = test::points(*folder / "anchors.csv");
  const auto tags = test::points(*folder / "tags.csv");
  const auto errors_of = [&](const char* run, auto&& each) {
    const test::Truth truth{*folder / run / "truth.tum"};
    for (const test::Row& r : test::rows(*folder / run / "ranges.csv")) {
      if (!truth.covers(r[0])) continue;
      const auto pose = truth.at(r[0]);
      const auto tag = static_cast<int>(r[1]);
      const auto anchor = static_cast<int>(r[2]);
      const Mat<double, 3> attitude = rotation_matrix(quaternion_from_yaw(pose.heading));
      const Vec<double, 3> at = Vec<double, 3>{pose.x, pose.y, pose.z} + attitude * tags.at(tag);
      const Vec<double, 3> offset = anchors.at(anchor) - at;
      each(tag, anchor, offset, attitude, r[3] - offset.norm());
    }
  };
  std::map<std::pair<int, int>, std::vector<double>> of_link;
  errors_of("static", [&](int tag, int anchor, auto&&, auto&&, double error) {
    of_link[{tag, anchor}].push_back(error);
  });
  std::map<std::pair<int, int>, double> medians;
  for (auto& [link, errors] : of_link) medians[link] = test::median(errors);

  double raw = 0;
  double less_median = 0;
  double less_network = 0;
  errors_of("mid", [&](int tag, int anchor, const Vec<double, 3>& offset,
                       const Mat<double, 3>& attitude, double error) {
    // Ids of this recording are their places.
    const auto inputs = link_features<lias::kAnchors.size(), lias::kTags.size()>(
        Vec<float, 3>{offset.cast<float>()}, Mat<float, 3>{attitude.cast<float>()},
        static_cast<std::size_t>(anchor), static_cast<std::size_t>(tag));
    const auto bias = lias::kNetwork(inputs);
    REQUIRE(bias);
    const double of_medians = error - medians.at({tag, anchor});
    const double of_network = error - static_cast<double>(*bias);
    raw += error * error;
    less_median += of_medians * of_medians;
    less_network += of_network * of_network;
  });
  const double by_network = 1 - std::sqrt(less_network / raw);
  const double by_medians = 1 - std::sqrt(less_median / raw);
  MESSAGE("rms range error of lias/mid down by " << 100 * by_network << " %; by per-link medians "
                                                 << 100 * by_medians << " %");
  // Fifteen poses teach little more than constants of each kind of link; what they do teach shows
  // in positions, tests/host/test_link_network.cpp.
  CHECK(by_network > 0.55);
}

}  // namespace tests::filter_bias_network
