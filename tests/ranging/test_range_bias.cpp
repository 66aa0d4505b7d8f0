// SPDX-License-Identifier: MIT
#include <array>
#include <limits>
#include <span>

#include <doctest/doctest.h>

#include <uwbpos/ranging/range_bias.hpp>

namespace tests::ranging_range_bias {

namespace {

using namespace uwbpos;

template <class S>
constexpr std::array<RangeBiasPoint<S>, 4> kTable{
    {{S(-95), S(0.25)}, {S(-90), S(0.15)}, {S(-80), S(-0.05)}, {S(-60), S(-0.1)}}};

template <class S>
RangeBias<S> table() {
  return RangeBias<S>::make(kTable<S>).value();
}

TEST_CASE_TEMPLATE("The table's own points come out as they are", S, float, double) {
  for (const auto& point : kTable<S>) CHECK(table<S>().at(point.power_dbm).value() == point.bias);
}

TEST_CASE_TEMPLATE("Between points the bias is linear", S, float, double) {
  const double tolerance = 10.0 * static_cast<double>(std::numeric_limits<S>::epsilon());
  const auto at = [](double power) {
    return static_cast<double>(table<S>().at(static_cast<S>(power)).value());
  };
  CHECK(at(-92.5) == doctest::Approx(0.2).epsilon(tolerance));
  CHECK(at(-87.5) == doctest::Approx(0.1).epsilon(tolerance));
  CHECK(at(-70) == doctest::Approx(-0.075).epsilon(tolerance));
  CHECK(at(-65) == doctest::Approx(-0.0875).epsilon(tolerance));
}

TEST_CASE_TEMPLATE("Beyond the ends the end values hold", S, float, double) {
  CHECK(table<S>().at(S(-150)).value() == S(0.25));
  CHECK(table<S>().at(S(0)).value() == S(-0.1));
  const std::array<RangeBiasPoint<S>, 1> one{{{S(-80), S(0.07)}}};
  const auto constant = RangeBias<S>::make(one).value();
  CHECK(constant.at(S(-100)).value() == S(0.07));
  CHECK(constant.at(S(-80)).value() == S(0.07));
  CHECK(constant.at(S(-60)).value() == S(0.07));
}

TEST_CASE_TEMPLATE("The bias is estimate minus truth and is subtracted", S, float, double) {
  const Measured<S> range{S(10.25), S(0.01)};
  const auto corrected = correct_range_bias(range, S(-95), table<S>());
  REQUIRE(corrected);
  CHECK(corrected->value == S(10));
  CHECK(corrected->variance == S(0.01));
}

TEST_CASE_TEMPLATE("Tables that are empty or do not increase are refused", S, float, double) {
  using Points = std::span<const RangeBiasPoint<S>>;
  CHECK(RangeBias<S>::make(Points{}).error() == Error::InvalidTable);
  auto points = kTable<S>;
  points[2].power_dbm = points[1].power_dbm;
  CHECK(RangeBias<S>::make(points).error() == Error::InvalidTable);
  points[2].power_dbm = points[1].power_dbm - 1;
  CHECK(RangeBias<S>::make(points).error() == Error::InvalidTable);
}

TEST_CASE_TEMPLATE("NaN and infinity are refused in table, power and range", S, float, double) {
  for (const S bad : {std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity(),
                      -std::numeric_limits<S>::infinity()}) {
    auto points = kTable<S>;
    points[0].power_dbm = bad;
    CHECK(RangeBias<S>::make(points).error() == Error::NotFinite);
    points = kTable<S>;
    points[3].bias = bad;
    CHECK(RangeBias<S>::make(points).error() == Error::NotFinite);
    CHECK(table<S>().at(bad).error() == Error::NotFinite);
    CHECK(correct_range_bias<S>({bad, 1}, S(-80), table<S>()).error() == Error::NotFinite);
    CHECK(correct_range_bias<S>({1, bad}, S(-80), table<S>()).error() == Error::NotFinite);
    CHECK(correct_range_bias<S>({1, 1}, bad, table<S>()).error() == Error::NotFinite);
  }
}

TEST_CASE_TEMPLATE("Steps and corrections too large for the scalar are refused", S, float, double) {
  constexpr S kHuge = std::numeric_limits<S>::max();
  auto points = kTable<S>;
  points[0].power_dbm = -kHuge;
  points[3].power_dbm = kHuge;
  CHECK(RangeBias<S>::make(points));
  points[1].power_dbm = kHuge / 2;
  points[2].power_dbm = kHuge;
  CHECK(RangeBias<S>::make(points).error() == Error::NotFinite);
  points = kTable<S>;
  points[1].bias = -kHuge;
  points[2].bias = kHuge;
  CHECK(RangeBias<S>::make(points).error() == Error::NotFinite);
  const std::array<RangeBiasPoint<S>, 1> one{{{S(-80), -kHuge}}};
  const auto extreme = RangeBias<S>::make(one).value();
  CHECK(correct_range_bias<S>({kHuge, 1}, S(-80), extreme).error() == Error::NotFinite);
}

}  // namespace

}  // namespace tests::ranging_range_bias
