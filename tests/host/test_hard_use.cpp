// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <csv.hpp>
#include <doctest/doctest.h>
#include <exchanges.hpp>
#include <failure.hpp>
#include <formats.hpp>
#include <nlohmann/json.hpp>

#include "uwbpos/sim/noise.hpp"

#include "files.hpp"
#include "run_command.hpp"

namespace tests::host_hard_use {

// What arrives in files; the table is docs/hard_use.md.

namespace {

using namespace uwbpos::host;
using uwbpos::test::Files;
using uwbpos::test::run_with;
using Json = nlohmann::json;

constexpr const char* kAnchors =
    "anchor_id,x_m,y_m,z_m\n0,0,0,2\n1,8,0,2\n2,8,6,2\n3,0,6,2\n4,4,0,2.5\n5,4,6,2.5\n";
constexpr double kPlaces[6][3] = {{0, 0, 2}, {8, 0, 2},   {8, 6, 2},
                                  {0, 6, 2}, {4, 0, 2.5}, {4, 6, 2.5}};

// Rows of ranges of a tag that drives a circle, 1 m above the floor, an anchor every 20 ms.
// `change` sees each range and may change it.
template <class Change>
std::vector<std::string> rows_of_circle(int count, const Change& change) {
  uwbpos::sim::Random random{"circle"};
  std::vector<std::string> rows;
  for (int i = 0; i < count; ++i) {
    const double t = 0.02 * i;
    const int anchor = i % 6;
    const double x = 4 + 2 * std::cos(0.4 * t) - kPlaces[anchor][0];
    const double y = 3 + 2 * std::sin(0.4 * t) - kPlaces[anchor][1];
    const double z = 1 - kPlaces[anchor][2];
    const double range = std::sqrt(x * x + y * y + z * z) + random.normal(0, 0.05);
    std::ostringstream row;
    row << t << ',' << anchor << ',' << change(t, anchor, range) << '\n';
    rows.push_back(row.str());
  }
  return rows;
}

std::string truth_of_circle(double seconds) {
  std::ostringstream truth;
  for (double t = 0; t < seconds; t += 0.05) {
    truth << t << ' ' << 4 + 2 * std::cos(0.4 * t) << ' ' << 3 + 2 * std::sin(0.4 * t)
          << " 1 0 0 0 1\n";
  }
  return truth.str();
}

std::string joined(const std::vector<std::string>& rows) {
  std::string text = "t_s,anchor_id,range_m\n";
  for (const std::string& row : rows) text += row;
  return text;
}

// summary.json of `replay --filter`.
Json filtered(const Files& files, const std::vector<std::string>& rows) {
  REQUIRE(run_with({"replay", "--anchors", files.write("a.csv", kAnchors), "--ranges",
                    files.write("r.csv", joined(rows)), "--truth",
                    files.write("t.tum", truth_of_circle(0.02 * static_cast<double>(rows.size()))),
                    "--height", "1", "--filter", "--out", files.path("out")}) == kSuccess);
  return Json::parse(files.read("out/summary.json"));
}

double unchanged(double, int, double range) { return range; }

}  // namespace

TEST_CASE("hard use: a log cut off after any byte gives the rows before the cut") {
  const std::string whole = joined(rows_of_circle(30, unchanged));
  const std::size_t header = whole.find('\n') + 1;
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    CAPTURE(size);
    const Files files;
    Problems problems{false, true};
    const std::string cut = whole.substr(0, size);
    const auto file = files.write("ranges.csv", cut);
    if (size < header - 1) {
      CHECK_THROWS_AS(static_cast<void>(read_ranges(file, problems)), Failure);
      continue;
    }
    const auto log = read_ranges(file, problems);
    const auto complete = static_cast<std::size_t>(
        std::count(cut.begin() + static_cast<std::ptrdiff_t>(header - 1), cut.end(), '\n'));
    // A row that the cut goes through is malformed, or looks whole: a number with fewer digits.
    CHECK(log.rows.size() + 1 >= complete);
    CHECK(log.rows.size() <= complete);
    CHECK(problems.total() <= 1);
  }
}

TEST_CASE("hard use: binary files end the run with a message, or give nothing") {
  uwbpos::sim::Random random{"binary"};
  std::string noise(200'000, '\0');
  for (char& c : noise) c = static_cast<char>(random.integer(0, 255));
  const std::string gzip = std::string{"\x1f\x8b\x08\0\0\0\0\0\0\x03", 10} + noise.substr(0, 500);
  const std::string columns = "t_s,anchor_id,range_m\n";
  const std::string cases[] = {noise, gzip, std::string(300'000, '\0'),
                               "\x7f"
                               "ELF" +
                                   noise,
                               "PK\x03\x04" + noise};
  for (const std::string& bytes : cases) {
    for (const bool with_header : {false, true}) {
      CAPTURE(with_header);
      const Files files;
      const auto anchors = files.write("a.csv", kAnchors);
      const auto log = files.write("r.csv", with_header ? columns + bytes : bytes);
      CHECK(run_with({"replay", "--anchors", anchors, "--ranges", log, "--height", "1", "--out",
                      files.path("out")}) == kBadInput);
      CHECK(run_with({"replay", "--anchors", log, "--ranges", log, "--out", files.path("out")}) ==
            kBadInput);
      CHECK(run_with({"replay", "--anchors", anchors, "--twr", log, "--out", files.path("out")}) ==
            kBadInput);
      Problems problems{false, true};
      CHECK_THROWS_AS(static_cast<void>(read_trajectory(log, problems)), Failure);
    }
  }
}

TEST_CASE("hard use: a line without end is skipped, and what stands behind it is read") {
  const Files files;
  Problems problems{false, true};
  for (const std::size_t length : {kLongestLine - 5, kLongestLine, kLongestLine + 1,
                                   kLongestLine + 2, std::size_t{3'000'000}}) {
    CAPTURE(length);
    const auto file = files.write(
        "r.csv", "t_s,anchor_id,range_m\n1,2,3\n" + std::string(length, '7') + "\n4,5,6\n");
    const auto log = read_ranges(file, problems);
    REQUIRE(log.rows.size() == 2);
    CHECK(log.rows[1].range == 6);
    CHECK(log.counts.rows == 3);
  }
  CHECK(problems.total() == 5);
  const auto truth = read_trajectory(
      files.write("t.tum", "1 0 0 0 0 0 0 1" + std::string(200'000, ' ') + "9\n2 0 0 0 0 0 0 1\n"),
      problems);
  CHECK(truth.poses().size() == 1);
}

TEST_CASE("hard use: denormal cells are numbers, beyond them they are malformed") {
  const Files files;
  Problems problems{false, true};
  const auto log = read_ranges(
      files.write("r.csv", "t_s,anchor_id,range_m,sigma_m\n1e-310,1,4e-320,1e-310\n2,1,3,\n"),
      problems);
  REQUIRE(log.rows.size() == 2);
  CHECK(log.rows[0].range == 4e-320);
  CHECK(problems.total() == 0);
  const auto zero = read_ranges(
      files.write("z.csv", "t_s,anchor_id,range_m,sigma_m\n1,1,4,0\n1,2,4,-1\n1,3,4,1e-999\n"),
      problems);
  CHECK(zero.rows.empty());
  CHECK(problems.total() == 3);
  // A round of them: no position from such a sigma, and its name.
  std::string rows = "t_s,anchor_id,range_m,sigma_m\n";
  for (int anchor = 0; anchor < 6; ++anchor) {
    rows += "0," + std::to_string(anchor) + ",4,1e-310\n1," + std::to_string(anchor) + ",4,\n";
  }
  REQUIRE(run_with({"replay", "--anchors", files.write("a.csv", kAnchors), "--ranges",
                    files.write("r.csv", rows), "--out", files.path("out")}) == kSuccess);
  const Json summary = Json::parse(files.read("out/summary.json"));
  CHECK(summary.at("rejected").at("non_positive_sigma") == 1);
  CHECK(summary.at("solved") == 1);
}

TEST_CASE("hard use: a log with every row twice is replayed as with every row once") {
  const Files once;
  const Files twice;
  const auto rows = rows_of_circle(1000, unchanged);
  std::vector<std::string> doubled;
  for (const std::string& row : rows) doubled.insert(doubled.end(), {row, row});
  const Json a = filtered(once, rows);
  const Json b = filtered(twice, doubled);
  CHECK(b.at("filter").at("refused").at("time_not_increasing").get<int>() > 900);
  CHECK(b.at("filter").at("used") == a.at("filter").at("used"));
  // Twice as many rows may begin a track an epoch earlier; from there on it is the same.
  const std::string track = once.read("out/track.tum");
  const std::string rest = track.substr(track.find('\n') + 1);
  CHECK(rest.size() > 190 * 40);
  CHECK(twice.read("out/track.tum").ends_with(rest));
}

TEST_CASE("hard use: spikes of 30 to 250 m are refused by the filter, and counted") {
  const Files files;
  uwbpos::sim::Random random{"spikes"};
  int spikes = 0;
  const Json summary = filtered(files, rows_of_circle(2000, [&](double t, int, double range) {
                                  if (t < 2 || !random.chance(0.1)) return range;
                                  ++spikes;
                                  return range + random.uniform(30, 250);
                                }));
  CHECK(summary.at("filter").at("refused").at("unreachable").get<int>() >= spikes);
  CHECK(summary.at("error_m").at("rmse").get<double>() < 0.1);
}

TEST_CASE("hard use: an anchor stuck at one range is named by the filter") {
  const Files files;
  double held = 0;
  const Json summary =
      filtered(files, rows_of_circle(2500, [&](double t, int anchor, double range) {
                 if (anchor != 2) return range;
                 if (t < 5) held = range;
                 return held;
               }));
  CHECK(summary.at("error_m").at("rmse").get<double>() < 0.2);
  CHECK(files.read("out/report.html").find("Anchor 2 is guilty") != std::string::npos);
}

TEST_CASE("hard use: behind twenty silent seconds epochs are lost until a first fix") {
  const Files files;
  auto rows = rows_of_circle(2000, unchanged);
  rows.erase(rows.begin() + 500, rows.begin() + 1500);
  rows.resize(1000);
  REQUIRE(run_with({"replay", "--anchors", files.write("a.csv", kAnchors), "--ranges",
                    files.write("r.csv", joined(rows)), "--truth",
                    files.write("t.tum", truth_of_circle(40)), "--height", "1", "--filter", "--out",
                    files.path("out")}) == kSuccess);
  const Json summary = Json::parse(files.read("out/summary.json"));
  const int lost = summary.at("rejected").at("track_lost").get<int>();
  CHECK(lost >= 1);
  CHECK(lost < 10);
  CHECK(summary.at("filter").at("refused").at("gap_too_long") == 7);
  const int jumps = summary.at("filter").at("refused").at("clock_jump");
  CHECK(jumps >= 1);
  CHECK(jumps < 10);
  CHECK(summary.at("error_m").at("rmse").get<double>() < 0.1);
}

TEST_CASE("hard use: a reply longer than its round trip is refused and counted") {
  Exchange e{};
  e.t = 1;
  e.anchor = 1;
  e.poll_tx = 1'000;
  e.poll_rx = 500'000;
  e.resp_tx = e.poll_rx + 63'897'600;
  e.resp_rx = e.poll_tx + 63'800'000;
  e.clock_offset = 0;
  const Ranging result = ranges_from_exchanges({e}, {}, {});
  CHECK(result.readings.empty());
  CHECK(result.refused == Counts{{"reply_exceeds_round_trip", 1}});
}

}  // namespace tests::host_hard_use
