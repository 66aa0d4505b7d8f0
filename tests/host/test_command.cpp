// SPDX-License-Identifier: MIT
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <command_line.hpp>
#include <doctest/doctest.h>
#include <nlohmann/json.hpp>
#include <report.hpp>

#include "../support/data.hpp"
#include "files.hpp"
#include "run_command.hpp"

namespace tests::host_command {

namespace {

using namespace uwbpos::host;
using uwbpos::test::Files;
using uwbpos::test::run_with;
using Json = nlohmann::json;

constexpr const char* kAnchors = "anchor_id,x_m,y_m,z_m\n1,0,0,2\n2,8,0,2\n3,8,6,2\n4,0,6,2\n";
// A tag at (3, 2), a metre below the anchors, twice.
constexpr const char* kRanges =
    "t_s,anchor_id,range_m\n0,1,3.7417\n0,2,5.4772\n0,3,6.4807\n0,4,5.0990\n"
    "1,1,3.7417\n1,2,5.4772\n1,3,6.4807\n1,4,5.0990\n";

Json summary_of(const Files& files) { return Json::parse(files.read("out/summary.json")); }

TEST_CASE("A position from two files, and what programs read of it") {
  const Files files;
  REQUIRE(run_with({"replay", "--anchors", files.write("a.csv", kAnchors), "--ranges",
                    files.write("r.csv", kRanges), "--height", "1", "--out", files.path("out")}) ==
          kSuccess);
  const Json summary = summary_of(files);
  CHECK(summary.at("epochs").get<double>() == 2);
  CHECK(summary.at("solved").get<double>() == 2);
  CHECK(summary.at("rejected").empty());
  CHECK(summary.at("solves_per_second").get<double>() > 0);
  CHECK_FALSE(summary.contains("error_m"));
  std::istringstream track{files.read("out/track.tum")};
  std::string comment;
  std::getline(track, comment);
  CHECK(comment.starts_with("#"));
  double t = 0;
  double x = 0;
  double y = 0;
  double z = 0;
  track >> t >> x >> y >> z;
  REQUIRE(track);
  // The ranges are rounded to 0.1 mm.
  CHECK(x == doctest::Approx(3).epsilon(1e-3));
  CHECK(y == doctest::Approx(2).epsilon(1e-3));
  CHECK(z == 1);
}

TEST_CASE("With truth, summary.json has the errors; with several tags, each tag's too") {
  const Files files;
  std::string two_tags = "t_s,tag_id,anchor_id,range_m\n";
  for (const char* tag : {"4", "9"}) {
    for (const char* cells : {"1,3.7417", "2,5.4772", "3,6.4807", "4,5.0990"}) {
      two_tags += std::string{"0.5,"} + tag + "," + cells + "\n";
    }
  }
  REQUIRE(run_with({"replay", "--anchors", files.write("a.csv", kAnchors), "--ranges",
                    files.write("r.csv", two_tags), "--truth",
                    files.write("t.tum", "0 3 1.9 1 0 0 0 1\n1 3 1.9 1 0 0 0 1\n"), "--height", "1",
                    "--out", files.path("out")}) == kSuccess);
  const Json summary = summary_of(files);
  for (const char* key : {"rmse", "mean", "median", "p95", "max", "rmse_xy"}) {
    CAPTURE(key);
    CHECK(summary.at("error_m").at(key).get<double>() == doctest::Approx(0.1).epsilon(0.01));
    CHECK(summary.at("tags").at("9").at("error_m").at(key).get<double>() ==
          doctest::Approx(0.1).epsilon(0.01));
  }
  CHECK(summary.at("tags").size() == 2);
  CHECK(std::filesystem::exists(files.path("out/track_tag_4.tum")));
}

TEST_CASE("Exit code 2 for wrong usage") {
  const Files files;
  const std::string anchors = files.write("a.csv", kAnchors);
  const std::string ranges = files.write("r.csv", kRanges);
  CHECK(run_with({}) == kBadUsage);
  CHECK(run_with({"fly"}) == kBadUsage);
  CHECK(run_with({"replay"}) == kBadUsage);
  CHECK(run_with({"replay", "--anchors", anchors}) == kBadUsage);
  CHECK(run_with({"replay", "--ranges", ranges}) == kBadUsage);
  CHECK(run_with({"replay", "--anchors", anchors, "--ranges", ranges, "--twr", ranges}) ==
        kBadUsage);
  for (const char* wrong : {"4", "x", ""}) {
    CHECK(run_with({"replay", "--anchors", anchors, "--ranges", ranges, "--dim", wrong}) ==
          kBadUsage);
  }
  CHECK(run_with({"replay", "--anchors", anchors, "--ranges", ranges, "--height", "nan"}) ==
        kBadUsage);
  CHECK(run_with({"replay", "--anchors", anchors, "--ranges", ranges, "--sigma", "0"}) ==
        kBadUsage);
  CHECK(run_with({"replay", "--anchors", anchors, "--ranges", ranges, "--epoch-window", "-1"}) ==
        kBadUsage);
  CHECK(run_with({"calibrate", "--anchors", anchors, "--ranges", ranges}) == kBadUsage);
  CHECK(run_with({"simulate", "--radio", "crystal-set"}) == kBadUsage);
  CHECK(run_with({"replay", "--help"}) == kSuccess);
  CHECK(run_with({"--version"}) == kSuccess);
}

TEST_CASE("Exit code 1 for bad input, nothing to solve, or nowhere to write") {
  const Files files;
  const std::string anchors = files.write("a.csv", kAnchors);
  const std::string ranges = files.write("r.csv", kRanges);
  const std::string out = files.path("out");
  const auto replay_of = [&](const std::string& content) {
    return run_with({"replay", "--anchors", anchors, "--ranges", files.write("x.csv", content),
                     "--height", "1", "--out", out});
  };
  CHECK(replay_of("") == kBadInput);
  CHECK(replay_of("t_s,anchor_id,range_m\n") == kBadInput);
  CHECK(replay_of("t_s,anchor,range_m\n0,1,2\n") == kBadInput);
  CHECK(replay_of("t_s,anchor_id,range_m\n0,1,2\n") == kBadInput);   // one range
  CHECK(replay_of("t_s,anchor_id,range_m\n0,77,2\n") == kBadInput);  // unknown anchor
  CHECK(replay_of("t_s,anchor_id,range_m\n0,1,\n") == kBadInput);    // no reading
  CHECK(run_with({"replay", "--anchors", files.path("none"), "--ranges", ranges, "--out", out}) ==
        kBadInput);
  CHECK(run_with({"replay", "--anchors", anchors, "--ranges", files.path(""), "--out", out}) ==
        kBadInput);
  // A file where a directory should be made.
  CHECK(run_with({"replay", "--anchors", anchors, "--ranges", ranges, "--out", ranges}) ==
        kBadInput);
  CHECK(run_with({"replay", "--anchors", anchors, "--ranges", ranges, "--out",
                  (files.path("r.csv") / "deeper").string()}) == kBadInput);
  // No range within the truth's span.
  CHECK(run_with({"calibrate", "--anchors", anchors, "--ranges", ranges, "--truth",
                  files.write("t.tum", "100 0 0 0 0 0 0 1\n"), "--out", out}) == kBadInput);
}

TEST_CASE("A malformed row is skipped and counted, and with --strict ends the run") {
  const Files files;
  const std::string anchors = files.write("a.csv", kAnchors);
  const std::string ranges = files.write("r.csv", std::string{kRanges} + "1,2,oops\n2,99,4\n");
  const std::vector<std::string> arguments = {"replay",   "--anchors", anchors,
                                              "--ranges", ranges,      "--height",
                                              "1",        "--out",     files.path("out")};
  CHECK(run_with(arguments) == kSuccess);
  const Json summary = summary_of(files);
  CHECK(summary.at("solved").get<double>() == 2);
  CHECK(summary.at("input").at("malformed_rows").at(ranges).get<int>() == 1);
  CHECK(summary.at("unknown_anchors").at("99").get<double>() == 1);
  auto strict = arguments;
  strict.push_back("--strict");
  CHECK(run_with(strict) == kBadInput);
}

TEST_CASE("--tag leaves the other tags out") {
  const Files files;
  std::string ranges = "t_s,tag_id,anchor_id,range_m\n";
  for (const char* tag : {"1", "2", "3"}) {
    for (const char* anchor : {"1", "2", "3"}) {
      ranges += std::string{"0,"} + tag + "," + anchor + ",5\n";
    }
  }
  REQUIRE(run_with({"replay", "--anchors", files.write("a.csv", kAnchors), "--ranges",
                    files.write("r.csv", ranges), "--tag", "3", "--tag", "1", "--out",
                    files.path("out")}) == kSuccess);
  CHECK(summary_of(files).at("tags").size() == 2);
}

TEST_CASE(
    "A simulated run, written, replayed from raw stamps and from ranges, ends near its truth") {
  const Files files;
  const std::string out = files.path("");
  const std::vector<std::string> arguments = {
      "simulate", "--out",   out, "--seed", "5", "--tag-count", "2", "--loss",
      "0.02",     "--speed", "2", "--rate", "5"};
  REQUIRE(run_with(arguments) == kSuccess);
  const std::string first = files.read("twr.csv");
  REQUIRE(run_with(arguments) == kSuccess);
  CHECK(files.read("twr.csv") == first);

  for (const char* log : {"twr", "ranges"}) {
    CAPTURE(log);
    REQUIRE(run_with({"replay", "--anchors", files.path("anchors.csv"), "--tags",
                      files.path("tags.csv"), std::string{"--"} + log,
                      files.path(std::string{log} + ".csv"), "--truth", files.path("truth.tum"),
                      "--height", "1", "--out", files.path("out")}) == kSuccess);
    const Json summary = summary_of(files);
    CHECK(summary.at("solved").get<double>() > 0.99 * summary.at("epochs").get<double>());
    // 2.8 cm of noise a range, eight anchors around: 2 cm; the tag moves 3 cm within an epoch.
    CHECK(summary.at("error_m").at("rmse").get<double>() < 0.05);
  }
  REQUIRE(run_with({"calibrate", "--anchors", files.path("anchors.csv"), "--tags",
                    files.path("tags.csv"), "--twr", files.path("twr.csv"), "--truth",
                    files.path("truth.tum"), "--out", files.path("out")}) == kSuccess);
  REQUIRE(
      run_with({"replay", "--anchors", files.path("anchors.csv"), "--tags", files.path("tags.csv"),
                "--twr", files.path("twr.csv"), "--truth", files.path("truth.tum"), "--height", "1",
                "--bias", files.path("out/bias.csv"), "--out", files.path("out")}) == kSuccess);
  CHECK(summary_of(files).at("error_m").at("rmse").get<double>() < 0.05);
}

TEST_CASE("Without gnuplot everything is written, and the report says what is missing") {
  const Files files;
  const char* path = std::getenv("PATH");
  const std::string before = path != nullptr ? path : "";
  setenv("PATH", files.path("").c_str(), 1);
  const int code =
      run_with({"replay", "--anchors", files.write("a.csv", kAnchors), "--ranges",
                files.write("r.csv", kRanges), "--height", "1", "--out", files.path("out")});
  setenv("PATH", before.c_str(), 1);
  CHECK(code == kSuccess);
  CHECK(summary_of(files).at("solved").get<double>() == 2);
  const std::string report = files.read("out/report.html");
  CHECK(report.find("gnuplot could not be run") != std::string::npos);
  CHECK(report.find("<svg") == std::string::npos);
  CHECK(report.find("Which anchor is the worst") != std::string::npos);
}

TEST_CASE("The report is one file that asks for nothing from anywhere") {
  const Files files;
  REQUIRE(run_with({"replay", "--anchors", files.write("a.csv", kAnchors), "--ranges",
                    files.write("r<&>.csv", kRanges), "--height", "1", "--out",
                    files.path("out")}) == kSuccess);
  const std::string report = files.read("out/report.html");
  CHECK(report.find("r&lt;&amp;&gt;.csv") != std::string::npos);
  CHECK(report.find("<script") == std::string::npos);
  CHECK(report.find("<link") == std::string::npos);
  CHECK(report.find("src=") == std::string::npos);
  CHECK(report.find("url(") == std::string::npos);
  CHECK(report.find("prefers-color-scheme: dark") != std::string::npos);
  CHECK(report.find("@media print") != std::string::npos);
  CHECK(report.find("name=\"viewport\"") != std::string::npos);
  // Every colour of a plot is one of the page's.
  CHECK(report.find("rgb(") == std::string::npos);
  CHECK(escaped("a < b & `c \"d\"`") == "a &lt; b &amp; <code>c &quot;d&quot;</code>");
}

TEST_CASE("lias: a drive to 0.165 m as measured, to 0.062 m once calibrated standing still") {
  const auto lias = uwbpos::test::data_or_skip("lias", "calibrates and replays lias");
  if (!lias) return;
  const Files files;
  const auto arguments = [&](const char* command, const char* run) {
    return std::vector<std::string>{command,
                                    "--anchors",
                                    *lias / "anchors.csv",
                                    "--tags",
                                    *lias / "tags.csv",
                                    "--ranges",
                                    *lias / run / "ranges.csv",
                                    "--truth",
                                    *lias / run / "truth.tum",
                                    "--height",
                                    "0.96",
                                    "--out",
                                    files.path("out")};
  };
  REQUIRE(run_with(arguments("replay", "mid")) == kSuccess);
  Json summary = summary_of(files);
  // The body's, and beside them each tag's own.
  CHECK(summary.at("epochs").get<double>() == 1200);
  CHECK(summary.at("solved").get<double>() == 1200);
  const auto pooled = [&] {
    double squares = 0;
    for (const auto& [tag, of_tag] : summary.at("tags").items()) {
      const double rmse = of_tag.at("error_m").at("rmse_xy").template get<double>();
      CHECK(of_tag.at("epochs").template get<double>() == 1200);
      squares += rmse * rmse / 3;
    }
    return std::sqrt(squares);
  };
  CHECK(summary.at("tags").size() == 3);
  CHECK(pooled() <= 0.165);
  REQUIRE(run_with(arguments("calibrate", "static")) == kSuccess);
  auto calibrated = arguments("replay", "mid");
  calibrated.insert(calibrated.end(), {"--bias", files.path("out/bias.csv")});
  REQUIRE(run_with(calibrated) == kSuccess);
  summary = summary_of(files);
  CHECK(pooled() <= 0.062);
  CHECK(summary.at("error_m").at("rmse").get<double>() <= 0.042);
  CHECK(summary.at("heading_error_deg").at("rmse").get<double>() <= 5.2);
}

TEST_CASE("hanyang: raw 32-bit stamps alone beat the module's own ranges") {
  const auto hanyang = uwbpos::test::data_or_skip("hanyang", "ranges of hanyang's static logs");
  if (!hanyang) return;
  struct Case {
    const char* log;
    double median;  // of the module's own ranges, as required of ours
  };
  for (const Case& c : {Case{"static_los.csv", 0.20}, Case{"static_nlos.csv", 0.26}}) {
    CAPTURE(c.log);
    const Files files;
    REQUIRE(run_with({"replay", "--twr", *hanyang / c.log, "--out", files.path("out")}) ==
            kSuccess);
    const Json ranges = summary_of(files).at("ranges");
    CHECK(ranges.at("counter_bits").get<double>() == 32);
    const Json error = ranges.at("error_m");
    CHECK(error.at("count").get<double>() > 0.97 * ranges.at("exchanges").get<double>());
    CHECK(error.at("median").get<double>() <= c.median);
    CHECK(error.at("median").get<double>() <= error.at("logged").at("median").get<double>());
    // Pooled over all distances the spread holds what differs between places, not the noise: see
    // tests/ranging/test_hanyang.cpp.
    CHECK(error.at("spread_at_one_distance").get<double>() <=
          error.at("logged").at("spread_at_one_distance").get<double>());
    CHECK(error.at("beyond_0.6_m").get<double>() < 0.01);
    // 0.34 m mean as the recording's authors have it.
    CHECK(error.at("uncorrected").at("mean").get<double>() == doctest::Approx(0.337).epsilon(0.02));
  }
}

}  // namespace

}  // namespace tests::host_command
