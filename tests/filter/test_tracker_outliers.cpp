// SPDX-License-Identifier: MIT
#include <cmath>
#include <string>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/filter/tracker.hpp"

#include "filter/flights.hpp"
#include "support/statistics.hpp"

namespace tests::filter_tracker_outliers {

// What a hall does to a tracker: the error stays within twice that of the same run unspoiled.

namespace {

using namespace uwbpos;
using test::Radio;

constexpr double kSigma = 0.1;
constexpr std::int64_t kEnd = 30'000'000;  // [µs]
constexpr double kAcceleration = 1;        // what the course does in a second, about

struct Outcome {
  std::vector<double> errors;  // from two seconds on
  double recovered = 0;        // [s] from the disturbance to an error below 0.5 m for good
  int refused = 0;
  int reopened = 0;
  int clock_jumps = 0;
  AnchorCounters worst{};
  std::uint32_t guilty = 0;
  double rmse() const { return test::root_mean_square(errors); }
};

enum class Spoil { Nothing, Outliers, Liar, Silence, ClockReset, Teleport };

constexpr std::int64_t kDisturbed = 15'000'000;

Outcome follow(Radio radio, Spoil spoil, const std::string& name) {
  sim::Random random{"outliers " + name};
  sim::Random mischief{"mischief " + name};
  const test::Course course{random.uniform(0, 6)};
  TrackerOptions<ConstantVelocity<double, 3>> options;
  options.model.motion.acceleration = kAcceleration;
  Tracker<ConstantVelocity<double, 3>> tracker{options};
  test::hang_anchors(tracker);
  Outcome outcome;
  const Vec<double, 3> away{2, -3, 0};
  for (std::int64_t time = 0; time < kEnd; time += test::kSlot) {
    const bool after = time >= kDisturbed;
    const bool silent = spoil == Spoil::Silence && after && time < kDisturbed + 3'000'000;
    Vec<double, 3> place = course.position(1e-6 * static_cast<double>(time));
    if (spoil == Spoil::Teleport && after) place += away;
    // A radio that is reset counts from zero again.
    const std::int64_t stamp = spoil == Spoil::ClockReset && after ? time - kDisturbed : time;
    const auto spoiled = [&](std::uint32_t id, double value) {
      if (spoil == Spoil::Outliers && mischief.chance(0.1)) value += mischief.uniform(0.5, 20);
      if (spoil == Spoil::Liar && id == 3) value += 2;
      return value;
    };
    if (!silent) {
      test::measure(radio, stamp, place, kSigma, kSigma, random, tracker, spoiled,
                    [&](auto, const auto& told) {
                      if (!told) ++outcome.refused;
                      if (told && told->event == TrackEvent::Reopened) ++outcome.reopened;
                      if (!told && told.error() == Error::ClockJump) ++outcome.clock_jumps;
                    });
    }
    const auto pose = tracker.pose();
    const double error = pose ? (pose->position - place).norm() : 10;
    if (after && error > 0.5) outcome.recovered = 1e-6 * static_cast<double>(time - kDisturbed);
    const bool settling = after && time < kDisturbed + 4'000'000;
    if (time > 2'000'000 && !settling) outcome.errors.push_back(error);
  }
  for (std::uint32_t id = 0; id < test::kHallAnchors; ++id) {
    const AnchorCounters counters = tracker.counters(id);
    if (refused_share(counters) > refused_share(outcome.worst)) {
      outcome.worst = counters;
      outcome.guilty = id;
    }
  }
  return outcome;
}

void compare(const char* what, Radio radio, Spoil spoil) {
  double clean = 0;
  double spoiled = 0;
  double slowest = 0;
  constexpr int kRuns = 5;
  for (int run = 0; run < kRuns; ++run) {
    const std::string name = std::to_string(run);
    const double before = follow(radio, Spoil::Nothing, name).rmse();
    const Outcome outcome = follow(radio, spoil, name);
    CHECK(outcome.rmse() < 2 * before);
    clean += before / kRuns;
    spoiled += outcome.rmse() / kRuns;
    slowest = std::max(slowest, outcome.recovered);
    if (spoil == Spoil::Liar) {
      CHECK(outcome.guilty == 3);
      CHECK(refused_share(outcome.worst) > 0.9f);
    }
    if (spoil == Spoil::ClockReset) CHECK(outcome.clock_jumps >= 1);
    if (spoil == Spoil::Teleport) CHECK(outcome.reopened >= 1);
    // From a stop of everything to a track again: eight stray stamps, then a round of anchors.
    CHECK(outcome.recovered < (spoil == Spoil::Silence ? 3.5 : 1.5));
  }
  MESSAGE(std::string{what} << ": rmse " << clean << " m unspoiled, " << spoiled
                            << " m spoiled; recovered after at most " << slowest << " s");
}

}  // namespace

TEST_CASE("outliers: one measurement in ten is up to 20 m long") {
  compare("ranges, outliers", Radio::Ranges, Spoil::Outliers);
  compare("differences, outliers", Radio::PairDifferences, Spoil::Outliers);
  compare("shared differences, outliers", Radio::SharedDifferences, Spoil::Outliers);
}

TEST_CASE("outliers: one anchor lies by two metres throughout, and is named") {
  compare("ranges, a liar", Radio::Ranges, Spoil::Liar);
  compare("shared differences, a liar", Radio::SharedDifferences, Spoil::Liar);
}

TEST_CASE("outliers: three seconds of nothing") {
  compare("ranges, silence", Radio::Ranges, Spoil::Silence);
  compare("differences, silence", Radio::PairDifferences, Spoil::Silence);
}

TEST_CASE("outliers: the radio's clock is reset") {
  compare("ranges, clock reset", Radio::Ranges, Spoil::ClockReset);
  compare("differences, clock reset", Radio::PairDifferences, Spoil::ClockReset);
}

TEST_CASE("outliers: carried away, the filter that its gate locks out reopens") {
  compare("ranges, carried away", Radio::Ranges, Spoil::Teleport);
  compare("differences, carried away", Radio::PairDifferences, Spoil::Teleport);
}

}  // namespace tests::filter_tracker_outliers
