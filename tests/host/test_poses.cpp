// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include <command_line.hpp>
#include <commands.hpp>
#include <demo_posture.hpp>
#include <doctest/doctest.h>
#include <failure.hpp>
#include <nlohmann/json.hpp>
#include <pose_remarks.hpp>
#include <poses.hpp>
#include <recording.hpp>
#include <replay.hpp>

#include "host/files.hpp"
#include "host/run_command.hpp"
#include "support/data.hpp"

namespace tests::host_poses {

namespace {

using namespace uwbpos;
using namespace uwbpos::host;
using test::Files;
using test::run_with;
using Json = nlohmann::json;

// A body that drives along a circle of 2 m at 0.5 rad/s; tags left and right, and one in front.
constexpr double kTurn = 0.5;
constexpr double kRadius = 2;

Site circle_site() {
  Site site;
  site.anchors = {{1, {0, 0, 2}}, {2, {10, 0, 2.5}}, {3, {10, 8, 2}}, {4, {0, 8, 2.5}}};
  site.tags = {{0, {0, 0.3, 0.1}}, {1, {0, -0.3, 0.1}}, {7, {0.4, 0, -0.2}}};
  std::vector<StampedPose> poses;
  for (double t = 0; t < 14; t += 0.02) {
    const double heading = kTurn * t;
    poses.push_back({t,
                     {5 + kRadius * std::sin(heading), 4 - kRadius * std::cos(heading), 1},
                     {0, 0, std::sin(heading / 2), std::cos(heading / 2)}});
  }
  site.truth = Trajectory{poses};
  return site;
}

// Exact ranges, ten rounds a second; the tags of a round take turns of `stagger` seconds.
std::vector<Reading> exact_readings(const Site& site, double stagger = 0) {
  std::vector<Reading> readings;
  for (int i = 0; i < 120; ++i) {
    double t = 0.1 * i;
    for (const auto& [tag, arm] : site.tags) {
      const auto at = site.truth.point_at(t, arm);
      for (const auto& [id, anchor] : site.anchors) {
        readings.push_back({t, tag, id, (*at - anchor).norm(), {}, {}, 0});
      }
      t += stagger;
    }
  }
  return readings;
}

TEST_CASE("Exact ranges of a turning body give its exact poses, at every height and in space") {
  const Site site = circle_site();
  for (const int dim : {2, 3}) {
    CAPTURE(dim);
    Settings settings;
    settings.dim = dim;
    settings.side = Side::kBelow;
    // The tags' mean height is the body's: their arms' mean is zero.
    if (dim == 2) settings.height = 1;
    const Replay result = replay(settings, site, exact_readings(site));
    REQUIRE(result.body);
    CHECK(result.body->epochs == 120);
    CHECK(result.body->track.size() == 120);
    CHECK(result.body->scored == 120);
    // Truth between its poses is a chord of 20 ms: off by r (ωΔt)²/8, and exact where asked here
    // but for rounding of the time.
    CHECK(result.body->error.max < 1e-4);
    CHECK(result.body->heading_error.max < 1e-4);
    CHECK(result.of_tag.size() == 3);
  }
}

TEST_CASE("Velocities of a circle: the chord's speed forward, none sideways, the turn rate") {
  const Site site = circle_site();
  Settings settings;
  settings.height = 1;
  const Replay result = replay(settings, site, exact_readings(site));
  REQUIRE(result.body);
  const auto twists = twists_of(*result.body, 1);
  CHECK(twists.size() == 110);
  for (const BodyTwist& t : twists) {
    CHECK(t.twist.body_velocity.x() ==
          doctest::Approx(2 * kRadius * std::sin(kTurn / 2)).epsilon(1e-3));
    CHECK(std::abs(t.twist.body_velocity.y()) < 1e-3);
    CHECK(t.twist.turn_rate == doctest::Approx(kTurn).epsilon(1e-3));
  }
  const TwistErrors errors = summarize_twists(twists);
  CHECK(errors.count == 110);
  CHECK(errors.velocity < 1e-3);
  // Poses over a pause of more than twice the span say nothing of the time between.
  Body paused = *result.body;
  for (std::size_t i = 60; i < paused.track.size(); ++i) paused.track[i].t += 30;
  CHECK(twists_of(paused, 1).size() == 100);
}

TEST_CASE("A target is seen from every pose, ahead and behind") {
  const Site site = circle_site();
  Settings settings;
  settings.height = 1;
  const Replay result = replay(settings, site, exact_readings(site));
  REQUIRE(result.body);
  // The circle's centre: always 2 m to the left.
  for (const SeenTarget& s : targets_seen(*result.body, {5, 4})) {
    CHECK(s.target.distance == doctest::Approx(kRadius).epsilon(1e-3));
    CHECK(s.target.bearing == doctest::Approx(std::numbers::pi / 2).epsilon(1e-3));
  }
  const auto far = targets_seen(*result.body, {100, 4});
  CHECK(std::ranges::any_of(far, [](const SeenTarget& s) { return s.target.ahead; }));
  CHECK(std::ranges::any_of(far, [](const SeenTarget& s) { return !s.target.ahead; }));
}

TEST_CASE("No twists, and poses from which a target is not seen, are explained") {
  const Site site = circle_site();
  Settings settings;
  settings.height = 1;
  const Replay result = replay(settings, site, exact_readings(site));
  REQUIRE(result.body);
  const Body& body = *result.body;
  CHECK_FALSE(twist_remark(body, 1));
  const auto says = [](const std::optional<std::string>& said, const char* words) {
    CAPTURE(said.value_or("nothing"));
    return said && said->contains(words);
  };
  CHECK(says(twist_remark(body, 1e9), "asks for poses 1e+09 s apart, and all are within 11.9 s"));
  CHECK(says(twist_remark(body, 1e-9), "1e-09 to 2e-09 s apart, and there are none; the nearest"));
  CHECK(says(twist_remark(Body{}, 1), "takes two poses, and there is none"));

  CHECK_FALSE(target_remark(body, {5, 4}));
  CHECK(says(target_remark(body, {1e308, 1e308}), "120 of 120 poses: the numbers are too large"));
  const Vec<double, 2> on_robot = body.track[7].pose.position.head<2>();
  CHECK(says(target_remark(body, on_robot), " of 120 poses: "));
  CHECK(targets_seen(body, on_robot).size() > 100);
}

TEST_CASE("Tags that take turns within a round are one epoch; tags never heard together are not") {
  const Site site = circle_site();
  Settings settings;
  settings.height = 1;
  Replay result = replay(settings, site, exact_readings(site, 0.01));
  REQUIRE(result.body);
  CHECK(result.body->track.size() == 120);
  CHECK(result.body->error.rmse < 0.02);  // 10 ms at 1 m/s

  auto readings = exact_readings(site);
  std::erase_if(readings, [](const Reading& r) { return r.tag == 7 || (r.t < 5) != (r.tag == 0); });
  result = replay(settings, site, readings);
  CHECK_FALSE(result.body);
  CHECK(result.never_together);
  CHECK(result.all.solved > 0);
}

TEST_CASE("Poses need two tags apart: one tag, or two in one place, are positions as before") {
  Site site = circle_site();
  Settings settings;
  settings.height = 1;
  settings.only_tags = {7};
  CHECK_FALSE(replay(settings, site, exact_readings(site)).body);
  settings.only_tags.clear();
  site.tags = {{0, {0.1, 0, 0.2}}, {1, {0.1, 0, -0.2}}};
  CHECK_FALSE(replay(settings, site, exact_readings(site)).body);
}

TEST_CASE("What keeps a recording from poses, or from fitting them, is said") {
  Recording recording;
  recording.site = circle_site();
  Site& site = recording.site;
  const std::vector<Reading> readings = exact_readings(site);
  Settings settings;
  settings.height = 1;
  const auto says = [&](const std::string& words) {
    const Replay result = replay(settings, site, readings);
    const auto said = pose_remarks(site, result);
    return std::ranges::any_of(said, [&](const auto& s) { return s.contains(words); });
  };
  const Points right = site.tags;
  CHECK(pose_remarks(site, replay(settings, site, readings)).empty());
  // Two arms twice as long as they are.
  site.tags.at(0).head<2>() *= 2;
  site.tags.at(1).head<2>() *= 2;
  CHECK(says("0.60 m apart, by the tags file 1.20 m"));
  CHECK(says("times worse than their sigma"));
  // Millimetres: the longest arm would be half a kilometre.
  site.tags = right;
  for (auto& [tag, arm] : site.tags) arm *= 1000;
  CHECK(says("The lever arm of tag 7 is 447.2 m long, and the anchors are 12.81 m apart at most"));
  site.tags = {{0, {0.1, 0, 0.2}}, {1, {0.1, 0, -0.2}}};
  CHECK(says("one place in plan"));
  site.tags = right;
  settings.only_tags = {7};
  CHECK(says("only tag 7 was heard"));
}

std::vector<std::string> arguments(const char* command, const std::filesystem::path& lias,
                                   const std::filesystem::path& ranges, const char* run,
                                   const std::filesystem::path& out) {
  return {command,
          "--anchors",
          lias / "anchors.csv",
          "--tags",
          lias / "tags.csv",
          "--ranges",
          ranges,
          "--truth",
          lias / run / "truth.tum",
          "--height",
          "0.96",
          "--out",
          out};
}

TEST_CASE("lias/static: calibrated on even poses and solved on odd ones, and the other way round") {
  const auto lias = test::data_or_skip("lias", "cross-validates poses on lias/static");
  if (!lias) return;
  const Files files;
  std::string header;
  std::string halves[2];
  std::ifstream log{*lias / "static" / "ranges.csv"};
  std::getline(log, header);
  for (std::string row; std::getline(log, row);) {
    // One pose every 20 s of file time.
    halves[static_cast<int>(std::stod(row) / 20) % 2] += row + '\n';
  }
  for (int k = 0; k < 2; ++k) files.write(k == 0 ? "0.csv" : "1.csv", header + '\n' + halves[k]);
  for (int k = 0; k < 2; ++k) {
    const auto own = files.path(k == 0 ? "0.csv" : "1.csv");
    const auto other = files.path(k == 0 ? "1.csv" : "0.csv");
    REQUIRE(run_with(arguments("calibrate", *lias, own, "static", files.path("cal"))) == kSuccess);
    auto words = arguments("replay", *lias, other, "static", files.path("out"));
    words.insert(words.end(), {"--bias", files.path("cal/bias.csv")});
    REQUIRE(run_with(words) == kSuccess);
    const Json summary = Json::parse(files.read("out/summary.json"));
    CHECK(summary.at("solved") == summary.at("epochs"));
    CHECK(summary.at("error_m").at("rmse").get<double>() <= 0.047);
    CHECK(summary.at("heading_error_deg").at("rmse").get<double>() <= 9.5);
    // 2° of it is noise; what is left depends on heading, and the report says so.
    CHECK(files.read("out/report.html").find("the way the body looks") != std::string::npos);
  }
}

TEST_CASE("lias/mid: velocities, a target, files and report") {
  const auto lias = test::data_or_skip("lias", "velocities and a target on lias/mid");
  if (!lias) return;
  const Files files;
  auto words = arguments("target", *lias, *lias / "mid" / "ranges.csv", "mid", files.path("out"));
  words.insert(words.end(), {"--x", "2", "--y", "2", "--velocity"});
  REQUIRE(run_with(words) == kSuccess);
  const Json summary = Json::parse(files.read("out/summary.json"));
  // Constant biases cancel between two poses a second apart; 5 cm of noise and √2 do not.
  CHECK(summary.at("velocity").at("velocity_error_mps").get<double>() < 0.06);
  CHECK(summary.at("velocity").at("turn_rate_error_degps").get<double>() < 8);
  const auto lines = [&](const char* file) {
    const std::string text = files.read(file);
    return std::ranges::count(text, '\n');
  };
  CHECK(lines("out/target.csv") == 1201);
  CHECK(lines("out/track.tum") == 1201);
  CHECK(lines("out/twists.csv") > 1100);
  const std::string report = files.read("out/report.html");
  for (const char* title : {"Error of heading over time", "Velocity over time", "Target over time",
                            "rmse of the heading", "<td>body</td>", "uwbpos calibrate finds"}) {
    CHECK(report.find(title) != std::string::npos);
  }
  // A target out of all bounds is an error, a span without poses is not.
  auto absurd = arguments("target", *lias, *lias / "mid" / "ranges.csv", "mid", files.path("out"));
  absurd.insert(absurd.end(), {"--x", "1e308", "--y", "0", "--velocity", "1e-320"});
  CHECK(run_with(absurd) == kBadInput);
  // One tag has no velocity that poses would give.
  words.insert(words.end(), {"--tag", "1"});
  CHECK(run_with(words) == kBadInput);
}

TEST_CASE("The paper's tables and its drive") {
  const HeadingErrors paper = paper_heading_errors(0.02, 0.6);
  CHECK(paper.mean_absolute <= 0.951);
  CHECK(paper.rms <= 1.169);
  CHECK(paper_heading_errors(0.04, 0.6).rms > paper.rms);
  CHECK(paper_heading_errors(0.02, 0.8).rms < paper.rms);
  const auto drive = paper_drive(1);
  REQUIRE(drive.size() > 50);
  CHECK(drive.back().target.distance < 0.1);
  for (const DriveStep& step : drive) CHECK(std::abs(off_line(step.truth.position)) < 0.0826);
  CHECK(off_line({4, 5}) == doctest::Approx(std::numbers::sqrt2 / 2));
}

}  // namespace

}  // namespace tests::host_poses
