// SPDX-License-Identifier: MIT
#include <algorithm>
#include <string>

#include <demo_tdoa.hpp>
#include <doctest/doctest.h>

namespace tests::host_demo_tdoa {
namespace {

using namespace uwbpos;
using namespace uwbpos::host;

TEST_CASE("The demo's building: at the bound, honest, and no step at a border") {
  const BuildingWalk walk = walk_through_building(4);
  CHECK(walk.blinks > 500);
  CHECK(walk.located == walk.blinks);
  CHECK(walk.track.size() == walk.located);
  CHECK(walk.truth.size() == walk.located);
  CHECK(walk.anchors.size() == 24);
  CHECK(walk.chan_refused < walk.compared / 10);
  // Some seven hundred solutions of three coordinates, unequal: a pooled ratio scatters by 0.06.
  CHECK(walk.likelihood_ratio < 1.2);
  CHECK(walk.likelihood_ratio > 0.8);
  CHECK(walk.chan_ratio > walk.likelihood_ratio);
  // Errors of the transforms last: far fewer independent ones than blinks.
  CHECK(walk.nees > 2);
  CHECK(walk.nees < 4);
  CHECK(walk.borders > 4);
  CHECK(walk.worst_step < 3);
  CHECK(walk.worst_step > 0);
  if (const auto svg = building_svg(walk)) {
    CHECK(svg->find("</svg>") != std::string::npos);
    CHECK(svg->find("anchors") != std::string::npos);
  }
}

}  // namespace
}  // namespace tests::host_demo_tdoa
