// SPDX-License-Identifier: MIT
#include <cmath>

#include <demo_ultrasonic.hpp>
#include <doctest/doctest.h>
#include <failure.hpp>
#include <ultrasonic.hpp>

#include "uwbpos/ranging/ultrasonic.hpp"

#include "files.hpp"

namespace tests::host_ultrasonic {

namespace {

using namespace uwbpos;
using namespace uwbpos::host;

constexpr const char* kBar = "anchor_id,x_m,y_m,z_m\n3,0.2375,0,1.1\n1,-0.256,0,1.1\n2,0,0,1.1\n";

// The first and the third row of the paper's table; then a shot of two receivers, an impossible
// one, a receiver that nobody knows, a count within no time, and a row that cannot be read.
constexpr const char* kShots =
    "receiver_id,t_s,count\n1,0,11566\n2,0,9763\n3,0,8275\n1,1,10727\n2,1,9900\n3,1,9629\n"
    "1,2,10727\n2,2,9900\n1,3,5000\n2,3,9000\n3,3,1000\n9,3,1\n1,4,0\n2,5,x\n";

UltrasonicSettings settings_of(const test::Files& files) {
  UltrasonicSettings settings;
  settings.common.anchors = files.path("anchors.csv");
  settings.common.out = files.path("out");
  settings.shots = files.path("ultrasonic.csv");
  return settings;
}

TEST_CASE("Ultrasonic shots become a track; what cannot be solved is counted by its reason") {
  const test::Files files;
  files.write("anchors.csv", kBar);
  files.write("ultrasonic.csv", kShots);
  Problems problems{false, true};
  const UltrasonicSettings settings = settings_of(files);
  Site site;
  site.anchors = read_anchors(settings.common.anchors, problems);
  const auto log = read_ultrasonic(settings.shots, problems);
  CHECK(problems.total() == 1);
  CHECK(log.counts.rows == 14);
  const UltrasonicReplay found = replay_ultrasonic(settings, site, log.rows);
  REQUIRE(found.shots.size() == 2);
  CHECK(found.replay.dim == 2);
  // The print's last decimal.
  CHECK((found.replay.track[0].position - Vec3{0.867, 0.712, 0}).norm() < 0.001);
  CHECK((found.replay.track[1].position - Vec3{0.263, 1.080, 0}).norm() < 0.001);
  CHECK(found.shots[0].repair == std::vector<int>{0, 0, 0});
  CHECK(found.shots[1].repair == std::vector<int>{-1, 0, 0});
  CHECK(std::abs(found.shots[1].lag - 0.029617) < 6e-5);
  CHECK(found.repaired() == 1);
  CHECK(found.replay.all.epochs == 4);
  CHECK(total(found.replay.all.rejected) == 2);
  CHECK(found.replay.all.rejected.at("too_few_measurements") == 1);
  CHECK(found.replay.unknown_anchors.at(9) == 1);
  CHECK(total(found.replay.refused_readings) == 1);
  const std::string summary = ultrasonic_summary(found, problems);
  for (const char* key : {"\"epochs\": 4", "\"solved\": 2", "\"too_few_measurements\": 1",
                          "\"repaired\": 1", "\"(-1, 0, 0)\": 1", "\"lag_m\"", "\"dim\": 2"}) {
    CAPTURE(key);
    CHECK(summary.find(key) != std::string::npos);
  }
}

TEST_CASE("Ultrasonic shots: side, height, temperature of the log and of the command") {
  const test::Files files;
  files.write("anchors.csv", kBar);
  files.write("ultrasonic.csv",
              "t_s,receiver_id,count,temperature_c\n0,1,11566,24\n0,2,9763,\n"
              "0,3,8275,\n");
  Problems problems{false, true};
  UltrasonicSettings settings = settings_of(files);
  settings.temperature = -20;  // the log knows better
  settings.common.side = Side::kBelow;
  settings.common.height = 0.4;
  Site site;
  site.anchors = read_anchors(settings.common.anchors, problems);
  auto log = read_ultrasonic(settings.shots, problems);
  const UltrasonicReplay found = replay_ultrasonic(settings, site, log.rows);
  REQUIRE(found.shots.size() == 1);
  CHECK((found.replay.track[0].position - Vec3{0.867, -0.712, 0.4}).norm() < 0.001);
  log.rows[0].temperature = 300;
  const UltrasonicReplay hot = replay_ultrasonic(settings, site, log.rows);
  CHECK(hot.replay.refused_readings.at("temperature_out_of_range") == 1);
}

TEST_CASE("The demo's simulated shots replay within millimetres, and its report is written") {
  const test::Files files;
  write_ultrasonic_simulation(files.path("run"));
  UltrasonicSettings settings;
  settings.common.anchors = files.path("run/anchors.csv");
  settings.common.truth = files.path("run/truth.tum");
  settings.common.out = files.path("run");
  settings.shots = files.path("run/ultrasonic.csv");
  CHECK(run_ultrasonic(settings) == 0);
  const std::string summary = files.read("run/summary.json");
  CHECK(summary.find("\"solved\": 90") != std::string::npos);
  CHECK(summary.find("\"error_m\"") != std::string::npos);
  CHECK(files.read("run/report.html").find("</html>") != std::string::npos);
  CHECK(files.read("run/track.tum").size() > 3000);
  const std::string table = paper_table_text();
  CHECK(table.find("2.9649 (2.9671)  -1 0 0") != std::string::npos);
}

TEST_CASE("Ultrasonic: nothing to solve ends the run") {
  const test::Files files;
  files.write("anchors.csv", kBar);
  files.write("ultrasonic.csv", "t_s,receiver_id,count\n0,1,11566\n");
  CHECK_THROWS_AS(run_ultrasonic(settings_of(files)), Failure);
  files.write("ultrasonic.csv", "t_s,receiver_id\n0,1\n");
  CHECK_THROWS_AS(run_ultrasonic(settings_of(files)), Failure);
}

}  // namespace

}  // namespace tests::host_ultrasonic
