// SPDX-License-Identifier: MIT
#include "exchanges.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <tuple>
#include <utility>

#include "uwbpos/ranging/ds_twr.hpp"
#include "uwbpos/ranging/ss_twr.hpp"
#include "uwbpos/time/clock.hpp"

#include "failure.hpp"

namespace uwbpos::host {
namespace {

constexpr unsigned kFewestBits = 24;
constexpr unsigned kMostBits = 40;

// The stamps of an exchange of two messages, and, if there was a third, of all three.
using Stamps = std::pair<SsTwrStamps, std::optional<DsTwrStamps>>;

// The exchange as stamps of 40-bit counters: the first reading of each device as it stands, the
// others by their signed differences of `Bits` bits from it.
template <unsigned Bits>
Stamps extend(const Exchange& e) {
  const auto after = [](DeviceTime<> from, std::uint64_t earlier, std::uint64_t later) {
    return from + (DeviceTime<Bits>{later} - DeviceTime<Bits>{earlier});
  };
  const DeviceTime<> poll_tx{e.poll_tx};
  const DeviceTime<> poll_rx{e.poll_rx};
  const DeviceTime<> resp_tx = after(poll_rx, e.poll_rx, e.resp_tx);
  const DeviceTime<> resp_rx = after(poll_tx, e.poll_tx, e.resp_rx);
  Stamps result{{poll_tx, poll_rx, resp_tx, resp_rx}, std::nullopt};
  if (e.final) {
    result.second = DsTwrStamps{poll_tx,
                                poll_rx,
                                resp_tx,
                                resp_rx,
                                after(resp_rx, e.resp_rx, e.final->first),
                                after(resp_tx, e.resp_tx, e.final->second)};
  }
  return result;
}

// Ranges from a log whose counters have `Bits` bits.
template <unsigned Bits>
class Ranger {
 public:
  Ranger(const Settings& settings, const std::optional<RangeBias<double>>& power_bias,
         Ranging& result)
      : power_bias_{power_bias}, result_{result} {
    options_.max_range = settings.max_range;
  }

  void add(const Exchange& e) {
    const auto [ss, ds] = extend<Bits>(e);
    std::optional<double> offset = e.clock_offset;
    std::optional<Error> untracked;
    TwrOptions<double> options = options_;
    if (!ds && !offset) {
      auto& tracker = trackers_[{e.tag, e.anchor}];
      const auto rate = tracker.update(DeviceTime<Bits>{e.poll_tx}, DeviceTime<Bits>{e.poll_rx},
                                       microseconds(e.t));
      if (rate) {
        offset = rate->value;
        options.sigma_clock_offset = std::sqrt(rate->variance);
      } else {
        untracked = rate.error();
      }
    }
    if (untracked) return refuse(*untracked);
    options.clock_offset = offset.value_or(0);
    Result<Measured<double>> range = ds ? ds_twr_range(*ds, options) : ss_twr_range(ss, options);
    if (!range) return refuse(range.error());
    ++(ds               ? result_.double_sided
       : e.clock_offset ? result_.single_sided_logged
                        : result_.single_sided_tracked);
    if (e.power && power_bias_) range->value -= power_bias_->at(*e.power).value_or(0);
    result_.readings.push_back(
        {e.t, e.tag, e.anchor, range->value, std::sqrt(range->variance), e.power, e.line});
    if (e.true_range) {
      const Result<Measured<double>> uncorrected = ss_twr_range(ss, options_);
      result_.scored.push_back({e.t, e.tag, e.anchor, *e.true_range, range->value, e.logged_range,
                                uncorrected ? std::optional{uncorrected->value} : std::nullopt});
    }
  }

 private:
  // Since the log's first exchange; the tracker only takes differences.
  std::int64_t microseconds(double t) {
    if (!start_) start_ = t;
    constexpr double longest = 1e12;  // [s], 30000 years
    return std::llround(std::clamp(t - *start_, -longest, longest) * 1e6);
  }

  void refuse(Error error) { ++result_.refused[std::string{reason_name(error)}]; }

  TwrOptions<double> options_{};
  const std::optional<RangeBias<double>>& power_bias_;
  Ranging& result_;
  std::optional<double> start_;
  std::map<std::pair<Id, Id>, RateTracker<double, Bits>> trackers_;
};

template <unsigned Bits>
void range_all(const std::vector<Exchange>& exchanges, const Settings& settings,
               const std::optional<RangeBias<double>>& power_bias, Ranging& result) {
  Ranger<Bits> ranger{settings, power_bias, result};
  for (const Exchange& exchange : exchanges) ranger.add(exchange);
}

// Calls range_all<bits>, one instantiation per width of counter.
template <unsigned... Offsets>
void range_all_with(unsigned bits, std::integer_sequence<unsigned, Offsets...>,
                    const std::vector<Exchange>& exchanges, const Settings& settings,
                    const std::optional<RangeBias<double>>& power_bias, Ranging& result) {
  static_cast<void>(
      ((bits == kFewestBits + Offsets &&
        (range_all<kFewestBits + Offsets>(exchanges, settings, power_bias, result), true)) ||
       ...));
}

}  // namespace

unsigned find_counter_bits(const std::vector<Exchange>& exchanges) {
  std::uint64_t any = 0;
  for (const Exchange& e : exchanges) {
    any |= e.poll_tx | e.poll_rx | e.resp_tx | e.resp_rx;
    if (e.final) any |= e.final->first | e.final->second;
  }
  constexpr unsigned short_counter = 32;
  return any >> short_counter == 0 ? short_counter : kMostBits;
}

Ranging ranges_from_exchanges(const std::vector<Exchange>& exchanges, const Settings& settings,
                              const std::optional<RangeBias<double>>& power_bias) {
  Ranging result;
  result.exchanges = exchanges.size();
  result.counter_bits =
      settings.counter_bits != 0 ? settings.counter_bits : find_counter_bits(exchanges);
  range_all_with(result.counter_bits,
                 std::make_integer_sequence<unsigned, kMostBits - kFewestBits + 1>{}, exchanges,
                 settings, power_bias, result);
  return result;
}

namespace {

// Mean of the robust spreads of groups of five errors or more.
template <class Groups>
std::optional<double> mean_spread(const Groups& groups) {
  constexpr std::size_t enough = 5;
  std::vector<double> spreads;
  std::size_t grouped = 0;
  std::size_t count = 0;
  for (const auto& [key, errors] : groups) {
    count += errors.size();
    if (errors.size() < enough) continue;
    grouped += errors.size();
    spreads.push_back(robust_spread(errors));
  }
  if (spreads.empty() || 2 * grouped < count) return std::nullopt;  // the tag moved
  return mean(spreads);
}

}  // namespace

RangeScore score_ranges(const std::vector<ScoredRange>& ranges) {
  std::vector<double> ours;
  std::vector<double> logged;
  std::vector<double> uncorrected;
  std::map<std::tuple<Id, Id, double>, std::vector<double>> at_distance;
  std::map<std::tuple<Id, Id, double>, std::vector<double>> logged_at_distance;
  for (const ScoredRange& range : ranges) {
    const std::tuple place{range.tag, range.anchor, range.truth};
    ours.push_back(range.range - range.truth);
    at_distance[place].push_back(ours.back());
    if (range.logged) {
      logged.push_back(*range.logged - range.truth);
      logged_at_distance[place].push_back(logged.back());
    }
    if (range.uncorrected) uncorrected.push_back(*range.uncorrected - range.truth);
  }
  RangeScore score;
  score.ours = summarize(std::move(ours), kRangeOutlier);
  score.spread_at_one_distance = mean_spread(at_distance);
  score.logged_spread_at_one_distance = mean_spread(logged_at_distance);
  if (!logged.empty()) score.logged = summarize(std::move(logged), kRangeOutlier);
  if (!uncorrected.empty()) score.uncorrected = summarize(std::move(uncorrected), kRangeOutlier);
  return score;
}

}  // namespace uwbpos::host
