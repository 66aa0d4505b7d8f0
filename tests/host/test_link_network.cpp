// SPDX-License-Identifier: MIT
#include <fstream>
#include <string>

#include <doctest/doctest.h>
#include <failure.hpp>
#include <link_network.hpp>
#include <nlohmann/json.hpp>
#include <recording.hpp>
#include <replay.hpp>

#include "host/files.hpp"
#include "support/data.hpp"

namespace tests::host_link_network {

namespace {

using namespace uwbpos;
using namespace uwbpos::host;
using test::Files;

constexpr const char* kTrained = "examples/bias_training/lias/bias_network.json";

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
  refuses(spoiled("/lowest/0", 1e9), "lowest");
  refuses(spoiled("/layers", nlohmann::json::array()), "three layers");
  refuses(spoiled("/layers/0/weights/0", {1.0}), "row of weights");
}

TEST_CASE("With a network the poses of a drive are better than with constants") {
  const auto folder = test::data_or_skip("lias", "poses of lias/mid less a network's biases");
  if (!folder) return;
  Settings settings;
  settings.anchors = *folder / "anchors.csv";
  settings.tags = *folder / "tags.csv";
  settings.ranges = *folder / "mid/ranges.csv";
  settings.truth = *folder / "mid/truth.tum";
  settings.bias_network = kTrained;
  settings.height = 0.96;
  Problems problems{true};
  const Recording recording = read_recording(settings, problems);
  const Replay result = replay(settings, recording.site, recording.readings);
  REQUIRE(result.body);
  CHECK(result.body->track.size() == 1200);
  // Constants: 0.041 m and 5.1°.
  CHECK(result.body->error.rmse < 0.030);
  CHECK(radians_to_degrees(result.body->heading_error.rmse) < 5.1);

  settings.height.reset();
  settings.dim = 2;
  CHECK_THROWS_AS(static_cast<void>(replay(settings, recording.site, recording.readings)), Failure);
}

}  // namespace tests::host_link_network
