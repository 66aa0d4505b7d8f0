// SPDX-License-Identifier: MIT
#include <cmath>
#include <numbers>
#include <string>

#include <doctest/doctest.h>
#include <failure.hpp>
#include <fmt/format.h>
#include <recording.hpp>
#include <tdoa.hpp>

#include <uwbpos/sim/noise.hpp>

#include "files.hpp"

namespace tests::host_subnets {

namespace {

using namespace uwbpos::host;
using uwbpos::test::Files;

// Two subnets side by side, 18 m square and 20 m apart, the second turned by 40 degrees; a walk
// from one to the other.
struct TwoHalls {
  Files files;
  double sigma;

  explicit TwoHalls(double sigma_of_arrival = 0) : sigma{sigma_of_arrival} {
    uwbpos::sim::Random random{"two halls"};
    std::string anchors = "anchor_id,subnet_id,x_m,y_m,z_m\n";
    std::string given = "subnet_id,control_anchor_id,x_m,y_m,z_m,yaw_deg\n";
    std::string shared = "subnet_id,anchor_id,x_m,y_m,z_m\n";
    std::string tdoa = "t_s,anchor_id_a,anchor_id_b,difference_m,sigma_m\n";
    std::string truth;
    const double yaw[] = {0, 40};
    const Vec3 corners[] = {{0, 0, 0}, {18, 0, -1}, {18, 18, 0}, {0, 18, -1}, {9, -1, 0}};
    for (int k = 0; k < 2; ++k) {
      given += fmt::format("{},{},{},0,3,{}\n", k + 1, 10 * k, 20 * k, yaw[k]);
      const double c = std::cos(yaw[k] * std::numbers::pi / 180);
      const double s = std::sin(yaw[k] * std::numbers::pi / 180);
      for (int i = 0; i < 5; ++i) {
        const Vec3& p = corners[i];
        anchors += fmt::format("{},{},{:.12f},{:.12f},{}\n", 10 * k + i, k + 1,
                               c * p.x() + s * p.y(), c * p.y() - s * p.x(), p.z());
        shared +=
            fmt::format("{},{},{},{},{}\n", k + 1, 10 * k + i, p.x() + 20 * k, p.y(), p.z() + 3);
      }
    }
    for (int n = 0; n <= 200; ++n) {
      const double t = 0.1 * n;
      const Vec3 tag{5 + 1.4 * t, 6 + 0.2 * t, 1};
      truth += fmt::format("{} {} {} 1 0 0 0 1\n", t, tag.x(), tag.y());
      for (int k = 0; k < 2; ++k) {
        if (k == 0 ? tag.x() > 22 : tag.x() < 17) continue;
        double first = 0;
        for (int i = 0; i < 5; ++i) {
          const Vec3 anchor = corners[i] + Vec3{20.0 * k, 0, 3};
          const double arrival = (tag - anchor).norm() + random.normal(0, sigma);
          if (i == 0) {
            first = arrival;
            continue;
          }
          tdoa += fmt::format("{},{},{},{:.12f},{}\n", t, 10 * k, 10 * k + i, arrival - first,
                              std::max(sigma, 0.01) * std::numbers::sqrt2);
        }
      }
    }
    files.write("a.csv", anchors);
    files.write("given.csv", given);
    files.write("shared.csv", shared);
    files.write("d.csv", tdoa);
    files.write("t.tum", truth);
  }

  [[nodiscard]] Settings settings(const char* subnets) const {
    Settings settings;
    settings.anchors = files.path("a.csv");
    settings.tdoa = files.path("d.csv");
    settings.truth = files.path("t.tum");
    settings.subnets = files.path(subnets);
    settings.height = 1;
    return settings;
  }
};

Replay replayed(const Settings& settings) {
  Problems problems{true};
  const Recording recording = read_recording(settings, problems);
  return replay_differences(settings, recording.site, recording.differences);
}

TEST_CASE("Subnets are solved in their own frames and meet in the map, exactly") {
  const TwoHalls halls;
  for (const char* form : {"given.csv", "shared.csv"}) {
    CAPTURE(form);
    const Replay result = replayed(halls.settings(form));
    CHECK(result.all.epochs == 201);
    CHECK(result.all.solved == 201);
    CHECK(result.fused == 36);  // 17 m <= x <= 22 m at 0.14 m an epoch
    // Files hold 1e-12 m; descents end within 1e-4 of σ = 1 cm.
    CHECK(result.all.error.max < 1e-5);
  }
}

TEST_CASE("A walk from one subnet to the next does not jump") {
  const TwoHalls halls{0.05};
  const Replay result = replayed(halls.settings("given.csv"));
  REQUIRE(result.all.solved == 201);
  double before = 0;
  for (const Position& p : result.track) {
    const double error = (p.position - *p.truth).head<2>().norm();
    // σ is 0.05 … 0.08 m an axis inside the anchors: five of them; a step is two errors.
    CHECK(error < 0.4);
    CHECK(std::abs(error - before) < 0.4);
    before = error;
  }
}

TEST_CASE("Differences across subnets are refused, and files that make no subnets") {
  const TwoHalls halls;
  halls.files.write("d.csv", halls.files.read("d.csv") + "20,0,11,1,0.1\n");
  CHECK(replayed(halls.settings("given.csv")).refused_readings == Counts{{"across_subnets", 1}});
  const auto refuses = [&](const char* text) {
    halls.files.write("s.csv", text);
    CHECK_THROWS_AS(replayed(halls.settings("s.csv")), Failure);
  };
  refuses("subnet_id,x_m,y_m,z_m,yaw_deg\n");
  refuses("subnet_id,x_m,y_m,z_m,yaw_deg\n7,0,0,0,0\n");
  refuses("subnet_id,x_m,y_m,z_m,anchor_id\n1,0,0,3,0\n");
  refuses("subnet_id,x_m,y_m,z_m,anchor_id\n1,0,0,3,99\n");
  refuses("subnet_id,x_m,y_m,z_m,anchor_id,yaw_deg\n1,0,0,3,1,20\n");
}

}  // namespace

}  // namespace tests::host_subnets
