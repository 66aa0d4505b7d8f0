// SPDX-License-Identifier: MIT
#include <array>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include <calibrate.hpp>
#include <doctest/doctest.h>
#include <failure.hpp>
#include <link_network.hpp>
#include <network_bias.hpp>
#include <nlohmann/json.hpp>
#include <recording.hpp>
#include <replay.hpp>
#include <tdoa.hpp>

#include "host/files.hpp"
#include "support/data.hpp"

namespace tests::host_link_network {

namespace {

using namespace uwbpos;
using namespace uwbpos::host;
using test::Files;

constexpr const char* kTrained = "examples/bias_training/lias/bias_network.json";

// A run of lias through `replay`.
Settings settings_of(const std::filesystem::path& lias, const char* run) {
  Settings settings;
  settings.anchors = lias / "anchors.csv";
  settings.tags = lias / "tags.csv";
  settings.ranges = lias / run / "ranges.csv";
  settings.truth = lias / run / "truth.tum";
  settings.height = 0.96;
  return settings;
}

}  // namespace

TEST_CASE("A trained network is read, holds its own checks, and knows its links alone") {
  const LinkNetwork network{kTrained};
  const Mat<double, 3> level = Mat<double, 3>::Identity();
  const auto bias = network.bias(0, 3, {2, -1, 0.1}, level);
  REQUIRE(bias);
  CHECK(*bias > 0);  // those of the recording are 0.09 to 0.31 m
  CHECK(*bias < 0.5);
  CHECK_FALSE(network.bias(0, 99, {2, -1, 0.1}, level));
  CHECK_FALSE(network.bias(7, 3, {2, -1, 0.1}, level));
}

TEST_CASE("What is no network is refused with the file's name and what is wrong") {
  const Files files;
  const auto refuses = [&](const std::string& text, const char* because) {
    files.write("n.json", text);
    try {
      const LinkNetwork network{files.path("n.json")};
      FAIL("not refused: " << because);
    } catch (const Failure& failure) {
      CHECK(std::string{failure.what()}.find("n.json") != std::string::npos);
      CHECK(std::string{failure.what()}.find(because) != std::string::npos);
    }
  };
  CHECK_THROWS_AS(LinkNetwork{files.path("none.json")}, Failure);
  refuses("", "parse");
  refuses("[]", "type");
  refuses("{}", "anchors");
  std::ifstream trained{kTrained};
  const nlohmann::json good = nlohmann::json::parse(trained);
  const auto spoiled = [&](const char* key, const nlohmann::json& value) {
    nlohmann::json bad = good;
    bad[nlohmann::json::json_pointer{key}] = value;
    return bad.dump();
  };
  refuses(spoiled("/checks/0/bias_m", 1.0), "wrote down");
  refuses(spoiled("/anchors", {0, 0, 1, 2, 3, 4, 5, 6}), "different anchors");
  refuses(spoiled("/anchors", {0, 1}), "inputs");
  for (const nlohmann::json& id :
       {nlohmann::json(7.777e103), nlohmann::json(1.5), nlohmann::json(-1),
        nlohmann::json(4294967296), nlohmann::json(true), nlohmann::json("1")}) {
    refuses(spoiled("/anchors/0", id), "32 bits");
    refuses(spoiled("/tags/0", id), "32 bits");
  }
  refuses(spoiled("/lowest/0", 1e9), "lowest");
  refuses(spoiled("/layers", nlohmann::json::array()), "three layers");
  refuses(spoiled("/layers/0/weights/0", {1.0}), "row of weights");
}

TEST_CASE("With a network the positions of a drive are better than with constants") {
  const auto folder = test::data_or_skip("lias", "poses of lias/mid less a network's biases");
  if (!folder) return;
  Settings settings = settings_of(*folder, "mid");
  settings.bias_network = kTrained;
  Problems problems{true};
  const Recording recording = read_recording(settings, problems);
  const Replay result = replay(settings, recording.site, recording.readings);
  REQUIRE(result.body);
  CHECK(result.body->track.size() == 1200);
  // Constants: 0.041 m and 5.10°. Fifteen poses do not teach the headings of a drive.
  CHECK(result.body->error.rmse < 0.030);
  CHECK(radians_to_degrees(result.body->heading_error.rmse) < 5.2);

  settings.height.reset();
  settings.dim = 2;
  CHECK_THROWS_AS(static_cast<void>(replay(settings, recording.site, recording.readings)), Failure);
}

TEST_CASE("Headings of poses that neither saw: a network's below those of medians") {
  const auto folder = test::data_or_skip("lias", "lias/static, half of its poses for the other");
  if (!folder) return;
  const Settings settings = settings_of(*folder, "static");
  Problems problems{true};
  const Recording recording = read_recording(settings, problems);
  for (const int half : {0, 1}) {
    // One pose every 20 s; each in every fourth of its readings.
    std::vector<Reading> learned;
    std::vector<Reading> unseen;
    for (const Reading& r : recording.readings) {
      const bool of_half = std::lround(std::floor(r.t / 20)) % 2 == half;
      if (of_half) learned.push_back(r);
      if (!of_half && std::lround(20 * r.t) % 4 == 0) unseen.push_back(r);
    }
    Site site = recording.site;
    for (const LinkBias& link : calibrate(compare_with_truth(settings, site, learned))) {
      site.bias.of_link[{link.tag, link.anchor}] = link.bias;
    }
    const Replay by_medians = replay(settings, site, unseen);
    site.bias = {};
    site.network = std::make_shared<const LinkNetwork>(
        half == 0 ? "examples/bias_training/lias/even_poses.json"
                  : "examples/bias_training/lias/odd_poses.json");
    const Replay by_network = replay(settings, site, unseen);
    REQUIRE(by_medians.body);
    REQUIRE(by_network.body);
    CHECK(by_network.body->track.size() == by_medians.body->track.size());
    const double theirs = radians_to_degrees(by_medians.body->heading_error.rmse);
    const double ours = radians_to_degrees(by_network.body->heading_error.rmse);
    MESSAGE("heading of unseen poses: " << ours << " deg, by medians " << theirs << " deg");
    CHECK(ours < theirs);
    CHECK(by_network.body->error.rmse < by_medians.body->error.rmse);
  }
}

TEST_CASE("With attitudes a network corrects the ranges and differences of one tag") {
  const Files files;
  // Tells 0.4 m of anchor 3 and nothing of others: its code is input 13.
  nlohmann::json network;
  constexpr std::size_t inputs = 10 + 6 + 1;
  std::vector<std::vector<double>> first(inputs, std::vector<double>{0});
  first[13] = {1};
  network["anchors"] = {0, 1, 2, 3, 4, 5};
  network["tags"] = {0};
  network["lowest"] = std::vector<double>(inputs, -100);
  network["highest"] = std::vector<double>(inputs, 100);
  network["mean"] = std::vector<double>(inputs, 0);
  network["inverse_deviation"] = std::vector<double>(inputs, 1);
  const auto layer = [](std::vector<std::vector<double>> weights) {
    return nlohmann::json{{"weights", std::move(weights)}, {"biases", {0.0}}};
  };
  network["layers"] = nlohmann::json::array({layer(first), layer({{1}}), layer({{0.4}})});
  network["checks"] = nlohmann::json::array();
  Site site;
  site.network = std::make_shared<const LinkNetwork>(files.write("network.json", network.dump()));
  const std::array<Vec3, 6> places{Vec3{0, 0, 0}, Vec3{10, 0, 3}, Vec3{10, 8, 0},
                                   Vec3{0, 8, 3}, Vec3{5, 0, 3},  Vec3{5, 8, 0}};
  for (Id id = 0; id < places.size(); ++id) site.anchors[id] = places[id];
  site.attitude = Trajectory{{{0, Vec3::Zero(), {}}, {10, Vec3::Zero(), {}}}};
  std::vector<StampedPose> truth;
  std::vector<Reading> readings;
  std::vector<Difference> differences;
  for (int k = 0; k < 10; ++k) {
    const double t = 0.5 * k;
    const Vec3 at{2 + 0.5 * t, 3 + 0.2 * t, 1.2};
    truth.push_back({t, at, {}});
    const auto measured = [&](Id id) { return (at - places[id]).norm() + (id == 3 ? 0.4 : 0.0); };
    for (Id id = 0; id < places.size(); ++id) {
      readings.push_back({t, 0, id, measured(id), 0.1, std::nullopt});
      if (id > 0) differences.push_back({t, 0, 0, id, measured(id) - measured(0), 0.15});
    }
  }
  site.truth = Trajectory{truth};
  Settings settings;
  settings.dim = 3;
  settings.prior = Vec3{3, 3, 1};
  const Replay of_ranges = replay_with_network(settings, site, readings);
  const Replay of_differences = replay_with_network(settings, site, differences);
  for (const Replay* result : {&of_ranges, &of_differences}) {
    CHECK(result->all.solved == 10);
    CHECK(result->without_bias == 0);
    CHECK(result->all.error.rmse < 1e-6);  // the bias does not depend on the position
  }

  CHECK_THROWS_AS(static_cast<void>(replay_differences(settings, site, differences)), Failure);
  site.anchors[9] = {5, 4, 3};
  readings.push_back({4.9, 0, 9, 3.0, 0.1, std::nullopt});
  CHECK(replay_with_network(settings, site, readings).without_bias == 1);
  settings.dim = 2;
  CHECK_THROWS_AS(static_cast<void>(replay_with_network(settings, site, readings)), Failure);
}

}  // namespace tests::host_link_network
