// SPDX-License-Identifier: MIT
#include <cmath>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/ranging/ds_twr.hpp"
#include "uwbpos/ranging/ss_twr.hpp"
#include "uwbpos/ranging/tdoa_downlink.hpp"
#include "uwbpos/sim/noise.hpp"
#include "uwbpos/time/clock_sync.hpp"
#include "uwbpos/time/rate_tracker.hpp"

#include "properties/scene.hpp"
#include "support/statistics.hpp"

namespace tests::properties_ranging {

using namespace uwbpos;
using test::Exchange;
using test::Verdict;

/// The six stamps of a double-sided exchange, `extra` ticks of noise on each.
DsTwrStamps stamps_of(const Exchange& e, const std::array<std::int64_t, 6>& extra) {
  const double a = 1 + e.rates[0] * 1e-7;
  const double b = 1 + e.rates[1] * 1e-7;
  const double reply_b = 1000.0 * e.replies[0];
  const double reply_a = 1000.0 * e.replies[1];
  const double flight = e.flight;
  // Each on its own clock.
  const double at[6] = {0,
                        b * flight,
                        b * (flight + reply_b),
                        a * (2 * flight + reply_b),
                        a * (2 * flight + reply_b + reply_a),
                        b * (3 * flight + reply_b + reply_a)};
  constexpr std::int64_t kHalfSecond = 31'948'800'000;
  std::array<DeviceTime<>, 6> t;
  for (std::size_t i = 0; i < 6; ++i) {
    const bool on_a = i == 0 || i == 3 || i == 4;
    const bool odd = static_cast<int>(i) + 1 == e.odd;
    t[i] = DeviceTime<>{e.now[on_a ? 0 : 1]} +
           (std::llround(at[i]) + extra[i] + (odd ? kHalfSecond : 0));
  }
  return {t[0], t[1], t[2], t[3], t[4], t[5]};
}

DsTwrStamps stamps_of(const Exchange& e) {
  std::array<std::int64_t, 6> extra;
  for (std::size_t i = 0; i < 6; ++i) extra[i] = e.noise[i];
  return stamps_of(e, extra);
}

SsTwrStamps first_half(const DsTwrStamps& t) {
  return {t.poll_tx, t.poll_rx, t.resp_tx, t.resp_rx};
}

/// A's clock moved on by `a` ticks and B's by `b`.
DsTwrStamps moved(const DsTwrStamps& t, std::int64_t a, std::int64_t b) {
  return {t.poll_tx + a, t.poll_rx + b,  t.resp_tx + b,
          t.resp_rx + a, t.final_tx + a, t.final_rx + b};
}

/// The exchange that B began: round trips and replies change places.
DsTwrStamps other_way_round(const DsTwrStamps& t) {
  const std::int64_t round_a = t.resp_rx - t.poll_tx;
  const std::int64_t reply_a = t.final_tx - t.resp_rx;
  const std::int64_t round_b = t.final_rx - t.resp_tx;
  const std::int64_t reply_b = t.resp_tx - t.poll_rx;
  const DeviceTime<> a = t.poll_tx;
  const DeviceTime<> b = t.poll_rx;
  return {a, b, b + reply_a, a + round_b, a + (round_b + reply_b), b + (reply_a + round_a)};
}

/// Equal but for factors that are powers of two, so to the bit; or one error.
template <class S>
bool same(const Result<Measured<S>>& x, const Result<Measured<S>>& y, S lengths = 1, S noise = 1) {
  if (!x || !y) return !x && !y && x.error() == y.error();
  return y->value == x->value * lengths &&
         y->variance == x->variance * lengths * lengths * noise * noise;
}

/// The laws of one way of ranging, `range(stamps, options)`.
template <class S, class Range>
Verdict keeps(const Exchange& e, const Range& range) {
  const DsTwrStamps t = stamps_of(e);
  TwrOptions<S> options;
  // A tick is 15.65 ps; noise of up to 20 of them is 0.3 ns.
  const S tick = kTickSeconds<S>;
  options.antenna_delay_a = tick * static_cast<S>(e.delay);
  options.antenna_delay_b = tick * static_cast<S>(e.replies[0] % 1000);
  options.clock_offset = S(1e-7) * static_cast<S>(e.rates[1] - e.rates[0]);
  const auto plain = range(t, options);
  const auto a = static_cast<std::int64_t>(e.now[1] / 2);
  const auto b = -static_cast<std::int64_t>(e.now[0] / 2);
  if (!same(plain, range(moved(t, a, b), options))) return {.fault = "clocks that stand elsewhere"};

  TwrOptions<S> exchanged = options;
  std::swap(exchanged.antenna_delay_a, exchanged.antenna_delay_b);
  if (!same(plain, range(t, exchanged))) return {.fault = "antenna delays exchanged"};

  const S scale = std::ldexp(S(1), -std::abs(e.octaves));
  TwrOptions<S> slower = options;
  slower.propagation_speed *= scale;
  slower.max_range *= scale;
  if (!same(plain, range(t, slower), scale)) return {.fault = "lengths scaled"};

  const S noise = std::ldexp(S(1), std::abs(e.octaves));
  TwrOptions<S> noisier = options;
  noisier.sigma_timestamp *= noise;
  const auto unsure = range(t, noisier);
  if (plain && !same<S>(plain, unsure, 1, noise)) return {.fault = "sigma scaled"};
  return {};
}

TEST_CASE_TEMPLATE("ranging: where clocks stand means nothing, lengths and sigmas scale", S, float,
                   double) {
  const auto single = [](const DsTwrStamps& t, const TwrOptions<S>& o) {
    return ss_twr_range<S>(first_half(t), o);
  };
  const auto asymmetric = [](const DsTwrStamps& t, const TwrOptions<S>& o) {
    return ds_twr_range<S>(t, o);
  };
  const auto symmetric = [](const DsTwrStamps& t, const TwrOptions<S>& o) {
    return ds_twr_range_symmetric<S>(t, o);
  };
  test::check("ss_twr_range", [&](const Exchange& e) { return keeps<S>(e, single); });
  test::check("ds_twr_range", [&](const Exchange& e) { return keeps<S>(e, asymmetric); });
  test::check("ds_twr_range_symmetric", [&](const Exchange& e) { return keeps<S>(e, symmetric); });
}

TEST_CASE_TEMPLATE("double-sided ranging is the same whoever begins", S, float, double) {
  test::check("whoever begins", [](const Exchange& e) -> Verdict {
    const DsTwrStamps t = stamps_of(e);
    const DsTwrStamps other = other_way_round(t);
    const auto here = ds_twr_range<S>(t);
    const auto there = ds_twr_range<S>(other);
    if (!here || !there) {
      // Of several faults the one that is looked for first depends on who began.
      if (here.has_value() == there.has_value()) return {};
      return {.fault = "an answer one way only"};
    }
    // Numerator and sum are the same integers; the share f of (3) is 1 − f.
    if (here->value != there->value) return {.fault = "another range"};
    if (std::abs(here->variance - there->variance) >
        8 * std::numeric_limits<S>::epsilon() * here->variance) {
      return {.fault = "another variance"};
    }
    const auto sum = ds_twr_range_symmetric<S>(t);
    if (sum && !same(sum, ds_twr_range_symmetric<S>(other))) return {.fault = "symmetric"};
    return {};
  });
}

TEST_CASE_TEMPLATE("the errors of ranges have unit variance in their own sigma", S, float, double) {
  double squares[2] = {0, 0};
  double count = 0;
  test::check("unit variance", [&](const Exchange& given) -> Verdict {
    Exchange e = given;
    e.odd = 0;
    e.rates = {0, 0};
    sim::Random random{e.now[0]};
    TwrOptions<S> options;
    options.sigma_timestamp = S(1e-9);  // 64 ticks, of which rounding is none
    for (int draw = 0; draw < 50; ++draw) {
      std::array<std::int64_t, 6> extra{};
      for (const std::size_t received : {1U, 3U, 5U}) {
        extra[received] = std::llround(random.normal(0, 1e-9 / kTickSeconds<double>));
      }
      const DsTwrStamps t = stamps_of(e, extra);
      const double truth =
          e.flight * kTickSeconds<double> * static_cast<double>(options.propagation_speed);
      const Result<Measured<S>> all[2] = {ds_twr_range<S>(t, options),
                                          ss_twr_range<S>(first_half(t), options)};
      for (int k = 0; k < 2; ++k) {
        if (!all[k]) return {.fault = std::string{describe(all[k].error())}};
        const double error = static_cast<double>(all[k]->value) - truth;
        squares[k] += error * error / static_cast<double>(all[k]->variance);
      }
      ++count;
    }
    return {};
  });
  for (const double sum : squares) {
    CHECK(
        test::mean_nees_interval(1, static_cast<std::size_t>(count), 0.9999).contains(sum / count));
  }
}

TEST_CASE_TEMPLATE("downlink differences: where clocks stand means nothing, lengths scale", S,
                   float, double) {
  test::check("tdoa_downlink_difference", [](const Exchange& e) -> Verdict {
    const DsTwrStamps t = stamps_of(e);
    const Measured<S> rate{S(1e-7) * static_cast<S>(e.rates[1] - e.rates[0]), S(1e-18)};
    const S flight = kTickSeconds<S> * static_cast<S>(e.flight);
    const auto from = [&](const DsTwrStamps& s, const TdoaDownlinkOptions<S>& o) {
      return tdoa_downlink_difference<S>({s.poll_tx, s.resp_rx, s.poll_rx, s.resp_tx}, rate, flight,
                                         o);
    };
    TdoaDownlinkOptions<S> options;
    const auto plain = from(t, options);
    const auto a = static_cast<std::int64_t>(e.now[1] / 2);
    if (!same(plain, from(moved(t, a, -a / 3), options))) return {.fault = "clocks elsewhere"};
    const S scale = std::ldexp(S(1), -std::abs(e.octaves));
    options.propagation_speed *= scale;
    options.max_difference *= scale;
    if (!same(plain, from(t, options), scale)) return {.fault = "lengths scaled"};
    return {};
  });
}

TEST_CASE_TEMPLATE("clocks that are followed: where counters and host time stand means nothing", S,
                   float, double) {
  test::check("RateTracker and ClockSync", [](const Exchange& e) -> Verdict {
    RateTracker<S, 32> here;
    RateTracker<S, 32> there;
    ClockSync<S> sync_here;
    ClockSync<S> sync_there;
    // Thirty stamps 50 ms apart, with the exchange's rates and noise; one jumps where it is odd.
    const auto elsewhere = static_cast<std::int64_t>(e.now[0]);
    const std::int64_t late = 1'000'000'000LL * (e.flight % 100);
    for (int k = 0; k < 30; ++k) {
      const double time = 3'194'880'000.0 * (k + 1);
      const std::int64_t jump = e.odd > 0 && k > 14 + e.odd ? 100'000 : 0;
      const std::int64_t noise = e.noise[static_cast<std::size_t>(k % 6)];
      const std::int64_t a = std::llround(time * (1 + e.rates[0] * 1e-7)) + noise;
      const std::int64_t b = std::llround(time * (1 + e.rates[1] * 1e-7)) - noise + jump;
      const std::int64_t host = 50'000 * (k + 1);
      const auto bits = [](std::int64_t ticks) { return static_cast<std::uint64_t>(ticks); };
      const auto one = here.update(DeviceTime<32>{bits(a)}, DeviceTime<32>{bits(b)}, host);
      const auto two = there.update(DeviceTime<32>{bits(a + elsewhere)},
                                    DeviceTime<32>{bits(b - elsewhere / 7)}, host + late);
      if (!same(one, two)) return {.fault = "rate, at stamp " + std::to_string(k)};
      const auto first = sync_here.update(DeviceTime<>{bits(a)}, DeviceTime<>{bits(b)}, S(0), host);
      const auto second =
          sync_there.update(DeviceTime<>{bits(a + elsewhere)},
                            DeviceTime<>{bits(b - elsewhere / 7)}, S(0), host + late);
      if (first.has_value() != second.has_value() || (!first && first.error() != second.error())) {
        return {.fault = "synchronisation, at stamp " + std::to_string(k)};
      }
      const auto blink = DeviceTime<>{bits(b + 1'000'000)};
      const auto moved_blink = DeviceTime<>{bits(b - elsewhere / 7 + 1'000'000)};
      const auto p = sync_here.to_control(blink, host);
      const auto q = sync_there.to_control(moved_blink, host + late);
      if (p.has_value() != q.has_value()) return {.fault = "control time"};
      if (p && (q->ticks - p->ticks != DeviceTime<>{bits(elsewhere)} - DeviceTime<>{0} ||
                q->fraction != p->fraction || q->variance != p->variance)) {
        return {.fault = "control time, at stamp " + std::to_string(k)};
      }
    }
    return {};
  });
}

}  // namespace tests::properties_ranging
