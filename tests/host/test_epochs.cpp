// SPDX-License-Identifier: MIT
#include <algorithm>
#include <vector>

#include <doctest/doctest.h>
#include <epochs.hpp>

namespace tests::host_epochs {

namespace {

using namespace uwbpos::host;

Reading reading(double t, Id tag, Id anchor) { return {t, tag, anchor, 1, {}, {}, 0}; }

std::vector<std::size_t> sizes(const Epochs& epochs) {
  std::vector<std::size_t> result;
  for (const Epoch& epoch : epochs.epochs) result.push_back(epoch.readings.size());
  return result;
}

// `rounds` rounds of `anchors` anchors, `spacing` apart, every `period`; those in `lost` are left
// out, counted over all.
std::vector<Reading> rounds_of(int rounds, int anchors, double period, double spacing,
                               const std::vector<int>& lost = {}) {
  std::vector<Reading> readings;
  int count = 0;
  for (int round = 0; round < rounds; ++round) {
    for (int anchor = 0; anchor < anchors; ++anchor, ++count) {
      if (std::ranges::find(lost, count) != lost.end()) continue;
      readings.push_back(
          reading(1e9 + round * period + anchor * spacing, 0, static_cast<Id>(anchor)));
    }
  }
  return readings;
}

TEST_CASE("A window from the command line groups by time alone") {
  const std::vector<Reading> readings = {reading(0, 0, 1), reading(0.02, 0, 1), reading(0.05, 0, 2),
                                         reading(0.051, 0, 3), reading(0.2, 0, 1)};
  const EpochRule rule = epoch_rule(readings, 0.05);
  CHECK(sizes(group_epochs(readings, rule)) == std::vector<std::size_t>{3, 1, 1});
}

TEST_CASE("Times since 1970 in decimals do not fall out of their window by rounding") {
  const std::vector<Reading> readings = {reading(1723714077.1, 0, 1), reading(1723714077.15, 0, 2)};
  CHECK(group_epochs(readings, epoch_rule(readings, 0.05)).epochs.size() == 1);
}

TEST_CASE("Rounds that share a time stamp are epochs, however irregular they come") {
  std::vector<Reading> readings;
  for (const double t : {10.0, 10.05, 10.07, 10.12, 10.8}) {
    for (Id anchor = 0; anchor < 4; ++anchor) readings.push_back(reading(t, 0, anchor));
  }
  const Epochs epochs = group_epochs(readings, epoch_rule(readings, {}));
  CHECK(sizes(epochs) == std::vector<std::size_t>(5, 4));
  CHECK(epochs.epochs[4].t == 10.8);
}

TEST_CASE("Rounds spread over a part of their period are epochs, readings lost or not") {
  // 4 anchors 3 ms apart every 100 ms; 8 anchors one after the other all the time.
  CHECK(sizes(group_epochs(rounds_of(3, 4, 0.1, 0.003),
                           epoch_rule(rounds_of(3, 4, 0.1, 0.003), {}))) ==
        std::vector<std::size_t>{4, 4, 4});
  const auto lossy = rounds_of(5, 4, 0.1, 0.003, {0, 7, 13});
  CHECK(sizes(group_epochs(lossy, epoch_rule(lossy, {}))) ==
        std::vector<std::size_t>{3, 3, 4, 3, 4});
  const auto steady = rounds_of(10, 4, 0.4, 0.1);
  CHECK(sizes(group_epochs(steady, epoch_rule(steady, {}))) == std::vector<std::size_t>(10, 4));
}

TEST_CASE("Tags are grouped apart, and epochs come in the order of their first readings") {
  const std::vector<Reading> readings = {reading(0, 5, 1), reading(0.001, 3, 1),
                                         reading(0.002, 5, 2), reading(0.003, 3, 2)};
  const Epochs epochs = group_epochs(readings, epoch_rule(readings, 0.1));
  REQUIRE(epochs.epochs.size() == 2);
  CHECK(epochs.epochs[0].tag == 5);
  CHECK(epochs.epochs[1].tag == 3);
  CHECK(epochs.epochs[0].t == doctest::Approx(0.001).epsilon(1e-12));
}

TEST_CASE("The same link and time twice is a duplicate, dropped and counted") {
  const std::vector<Reading> readings = {reading(0, 0, 1), reading(0, 0, 2), reading(0, 0, 1),
                                         reading(0, 0, 3)};
  const Epochs epochs = group_epochs(readings, epoch_rule(readings, {}));
  CHECK(epochs.duplicates == 1);
  CHECK(sizes(epochs) == std::vector<std::size_t>{3});
}

TEST_CASE("A log that holds every row twice has the epochs of one that holds it once") {
  std::vector<Reading> once;
  for (int i = 0; i < 40; ++i) {
    once.push_back(reading(0.1 * i, 0, 1));
    once.push_back(reading(0.1 * i, 0, 2));
    if (i % 3 != 0) once.push_back(reading(0.1 * i, 0, 3));
  }
  std::vector<Reading> twice;
  for (const Reading& r : once) twice.insert(twice.end(), 2, r);
  const EpochRule rule = epoch_rule(twice, {});
  CHECK(rule.window == epoch_rule(once, {}).window);
  CHECK(rule.window == 0);
  CHECK(sizes(group_epochs(twice, rule)) == sizes(group_epochs(once, rule)));
}

TEST_CASE("No epoch has more readings than a solver takes") {
  std::vector<Reading> readings;
  for (int i = 0; i < 100; ++i) readings.push_back(reading(0.001 * i, 0, static_cast<Id>(i)));
  CHECK(sizes(group_epochs(readings, epoch_rule(readings, 10.0))) ==
        std::vector<std::size_t>{64, 36});
}

}  // namespace

}  // namespace tests::host_epochs
