// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <doctest/doctest.h>

#include "uwbpos/filter/gate.hpp"
#include "uwbpos/sim/noise.hpp"

#include "support/statistics.hpp"

namespace tests::filter_gate {

using namespace uwbpos;

TEST_CASE_TEMPLATE("gate: reach grows with time as speed and acceleration let it", S, float,
                   double) {
  GateOptions<S> options;
  options.max_speed = S(2);
  options.max_acceleration = S(4);
  options.sigmas = S(3);
  // 2 · 0.5 + 4 · 0.25 / 2 = 1.5 m, and three times the root of 0.01 + 0.03.
  const Reach<S> reach{S(0.5), S(0.03)};
  CHECK_FALSE(check_reach(options, reach, S(2.09), S(1), S(0.01)));
  CHECK(check_reach(options, reach, S(2.11), S(1), S(0.01)) == Error::Unreachable);
  CHECK(check_reach(options, reach, S(-2.11), S(1), S(0.01)) == Error::Unreachable);
  // A difference may change twice as fast: 3 m, and three times the root of 0.01 + 4 · 0.03.
  CHECK_FALSE(check_reach(options, reach, S(4.08), S(2), S(0.01)));
  CHECK(check_reach(options, reach, S(4.09), S(2), S(0.01)) == Error::Unreachable);
}

TEST_CASE_TEMPLATE("gate: statistics let through what their quantile says", S, float, double) {
  GateOptions<S> options;
  options.sigmas = S(2);  // 2.275 %
  sim::Random random{"gate"};
  for (const int dimension : {1, 2, 3}) {
    constexpr int kTrials = 40'000;
    int refused = 0;
    for (int i = 0; i < kTrials; ++i) {
      double square = 0;
      for (int k = 0; k < dimension; ++k) square += std::pow(random.normal(), 2);
      if (check_statistics(options, static_cast<S>(square), dimension)) ++refused;
    }
    // ± 4 standard deviations of a count, and 6 % of the quantile, which is 15 % of the share.
    CHECK(std::abs(refused - 0.02275 * kTrials) <
          4 * std::sqrt(0.022 * kTrials) + 0.0034 * kTrials);
  }
}

TEST_CASE_TEMPLATE("gate: NaN and infinity never pass", S, float, double) {
  const GateOptions<S> options;
  for (const S bad : {std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity()}) {
    CHECK(check_reach(options, Reach<S>{S(1), S(1)}, bad, S(1), S(1)) == Error::NotFinite);
    CHECK(check_reach(options, Reach<S>{S(1), S(1)}, S(-bad), S(1), S(1)) == Error::NotFinite);
    CHECK(check_statistics(options, bad, 1) == Error::NotFinite);
  }
  const S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(check_reach(options, Reach<S>{S(1), nan}, S(0), S(1), S(1)) == Error::Unreachable);
  GateOptions<S> broken;
  CHECK(is_valid(broken));
  broken.max_speed = nan;
  CHECK_FALSE(is_valid(broken));
  broken = {};
  broken.sigmas = S(0);
  CHECK_FALSE(is_valid(broken));
}

TEST_CASE("gate: counters by reason") {
  GateCounters counters;
  counters.count_used();
  counters.count(Error::OutlierRejected);
  counters.count(Error::OutlierRejected);
  counters.count(Error::Unreachable);
  CHECK(counters.used() == 1);
  CHECK(counters.refused(Error::OutlierRejected) == 2);
  CHECK(counters.refused(Error::Unreachable) == 1);
  CHECK(counters.refused(Error::TooOld) == 0);
}

TEST_CASE("gate: a filter that is locked out is told from one that meets outliers") {
  LockOutWatch watch;
  watch.reset(0);
  std::int64_t time = 0;
  constexpr std::int64_t patience = 500'000;
  // Four in ten are refused, never four in a row for long.
  for (int i = 0; i < 1000; ++i) {
    time += 10'000;
    watch.add(i % 5 != 1 && i % 5 != 3, time);
    CHECK_FALSE(watch.suspicious(time, patience));
  }
  // Three in four: soon.
  int until = 0;
  while (!watch.suspicious(time, patience)) {
    time += 10'000;
    watch.add(++until % 4 == 0, time);
  }
  CHECK(until <= 16);
  // A slow radio, all refused: after its patience, and four of them.
  watch.reset(time);
  const std::int64_t begin = time;
  while (!watch.suspicious(time, patience)) {
    time += 150'000;
    watch.add(false, time);
  }
  CHECK(time - begin == 600'000);
  CHECK(watch.last_used() == begin);
}

}  // namespace tests::filter_gate
