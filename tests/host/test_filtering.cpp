// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <command_line.hpp>
#include <commands.hpp>
#include <diagnosis.hpp>
#include <doctest/doctest.h>
#include <failure.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <recording.hpp>
#include <replay.hpp>

#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/sim/flight.hpp"
#include "uwbpos/sim/noise.hpp"

#include "host/files.hpp"
#include "host/run_command.hpp"
#include "support/data.hpp"

namespace tests::host_filtering {

namespace {

using namespace uwbpos;
using namespace uwbpos::host;
using test::Files;
using test::run_with;
using Json = nlohmann::json;

// A drone in a room of eight anchors: two seconds at rest, then a course of its own.
class Drone {
 public:
  explicit Drone(const std::string& name, double seconds) : random_{name} {
    for (Id id = 0; id < 8; ++id) {
      recording_.site.anchors[id] = {id % 4 == 0 || id % 4 == 3 ? 0.0 : 7.0, id % 4 < 2 ? 0.0 : 6.0,
                                     id < 4 ? 0.2 : 2.9};
    }
    std::vector<StampedPose> truth;
    for (double t = 0; t < seconds; t += 0.01) {
      const Quaternion<double> q = orientation(t);
      truth.push_back({t, position(t), {q[1], q[2], q[3], q[0]}});
    }
    recording_.site.truth = Trajectory{truth};
    for (double t = 0; t < seconds; t += 0.01) {
      const Quaternion<double> back = conjugate(orientation(t));
      const Quaternion<double> turn = multiply<double>(back, orientation(t + 1e-4));
      const Vec3 force = rotate<double>(back, acceleration(t) + Vec3{0, 0, 9.80665});
      InertialReading sample{t, {}, {}};
      for (int k = 0; k < 3; ++k) {
        sample.gyro[k] = 2e4 * turn[1 + k] + 0.01 + random_.normal(0, 0.02);
        sample.accelerometer[k] = force[k] + 0.05 + random_.normal(0, 0.2);
      }
      samples_.push_back(sample);
    }
  }

  // Fifty a second; anchor `liar` lies by two metres.
  void measure(bool differences, int liar = -1) {
    const double end = recording_.site.truth.poses().back().t;
    int i = 0;
    for (double t = 0.003; t < end; t += 0.02, ++i) {
      const Id a = static_cast<Id>(i % 8);
      const Id b = static_cast<Id>((i + 1 + random_.integer(0, 6)) % 8);
      const auto range = [&](Id id) {
        return (position(t) - recording_.site.anchors.at(id)).norm() +
               (static_cast<int>(id) == liar ? 2 : 0);
      };
      const double outlier = random_.chance(0.05) ? random_.uniform(0.5, 4) : 0;
      if (differences) {
        recording_.differences.push_back(
            {t, 0, a, b, range(b) - range(a) + random_.normal(0, 0.14) + outlier, {}, 0});
      } else {
        recording_.readings.push_back(
            {t, 0, a, range(a) + random_.normal(0, 0.1) + outlier, {}, {}, 0});
      }
    }
  }

  [[nodiscard]] Replay filtered(bool with_unit) {
    recording_.samples = with_unit ? samples_ : std::vector<InertialReading>{};
    Settings settings;
    settings.dim = 3;
    settings.filter = true;
    return replay_filtered(settings, recording_);
  }

  std::vector<InertialReading>& samples() { return samples_; }
  Recording& recording() { return recording_; }

 private:
  static constexpr double kRest = 2;
  [[nodiscard]] static double gone(double t) { return std::max(t - kRest, 0.0); }
  // The course begins at rest: s³/(1 + s²)… grows like s.
  [[nodiscard]] static double along(double t) {
    const double s = gone(t);
    return s * s * s / (1 + s * s);
  }
  [[nodiscard]] static Vec3 position(double t) {
    const double s = along(t);
    return {3.5 + 2 * std::sin(0.8 * s), 3 + 1.6 * std::sin(1.1 * s), 1 + 0.4 * std::sin(0.9 * s)};
  }
  [[nodiscard]] static Vec3 acceleration(double t) {
    constexpr double h = 1e-3;
    return (position(t + h) - 2 * position(t) + position(t - h)) / (h * h);
  }
  // Leans into its acceleration; looks 2 rad away from x and turns.
  [[nodiscard]] static Quaternion<double> orientation(double t) {
    return sim::leaning(acceleration(t), 2 + 0.5 * std::sin(0.3 * gone(t)));
  }

  sim::Random random_;
  Recording recording_;
  std::vector<InertialReading> samples_;
};

std::vector<std::string> words_of_lias(const std::filesystem::path& lias, const char* command,
                                       const char* part, const std::string& out) {
  return {command,
          "--anchors",
          (lias / "anchors.csv").string(),
          "--tags",
          (lias / "tags.csv").string(),
          "--ranges",
          (lias / part / "ranges.csv").string(),
          "--truth",
          (lias / part / "truth.tum").string(),
          "--out",
          out};
}

}  // namespace

TEST_CASE("filtering: a drone's inertial unit helps, by ranges and by differences, yaw unknown") {
  for (const bool differences : {false, true}) {
    CAPTURE(differences);
    Drone drone{"a drone to be filtered", 20};
    drone.measure(differences);
    const Replay without = drone.filtered(false);
    const Replay with = drone.filtered(true);
    CHECK(without.all.solved + 3 >= without.all.epochs);
    REQUIRE(with.body);
    CHECK(with.body->track.size() + 3 >= with.body->epochs);
    MESSAGE("rmse " << without.all.error.rmse << " m without, " << with.body->error.rmse
                    << " m with the unit; heading "
                    << radians_to_degrees(with.body->heading_error.rmse) << " deg");
    CHECK(with.body->error.rmse < without.all.error.rmse);
    CHECK(without.all.error.rmse < 0.25);
    // Known where it is scored: half of the flight or more, to a few degrees.
    CHECK(2 * with.body->heading_error.count > with.body->track.size());
    CHECK(radians_to_degrees(with.body->heading_error.rmse) < 10);
    CHECK(guilty_anchors(*with.filtering).empty());
  }
}

TEST_CASE("filtering: a unit whose readings are wrong is left out, and that is said") {
  Drone drone{"a drone with a bad unit", 20};
  drone.measure(false);
  const double without = drone.filtered(false).all.error.rmse;
  for (InertialReading& s : drone.samples()) s.gyro *= 57.3;  // in degrees
  const Replay with = drone.filtered(true);
  REQUIRE(with.body);
  CHECK(with.body->error.rmse < 1.5 * without);
  CHECK(with.filtering->inertial_epochs * 2 < with.body->track.size());
  Recording nothing;
  std::string said;
  for (const std::string& sentence : remarks(nothing, with, Problems{})) said += sentence;
  CHECK(said.find("contradicts the radio") != std::string::npos);

  // An accelerometer in units of g is known by gravity, before anything is followed.
  for (InertialReading& s : drone.samples()) s.accelerometer /= 9.80665;
  const Replay unused = drone.filtered(true);
  CHECK(unused.filtering->unused_unit.find("gravity") != std::string::npos);
  CHECK(unused.all.error.rmse == without);
}

TEST_CASE("filtering: an anchor that lies by two metres throughout is named") {
  for (const bool differences : {false, true}) {
    CAPTURE(differences);
    Drone drone{"a drone and a liar", 20};
    drone.measure(differences, 5);
    const Replay result = drone.filtered(false);
    REQUIRE(result.filtering);
    CHECK(guilty_anchors(*result.filtering) == std::vector<Id>{5});
    CHECK(result.all.error.median < 0.25);
    const auto said = diagnose(result, anchor_qualities(result));
    REQUIRE_FALSE(said.empty());
    CHECK(said.front().find("Anchor 5 is guilty") == 0);
  }
}

namespace {

// Sanitizers make all of it ten times as slow; for what they look at, a part will do.
#ifdef __SANITIZE_ADDRESS__
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

// What befalls a log.
enum class Harm { kNone, kOutliers, kLiar, kSilence, kClockReset, kClockStep };
constexpr Id kLiarId = 3;
constexpr std::array<Harm, 5> kHarms{Harm::kOutliers, Harm::kLiar, Harm::kSilence,
                                     Harm::kClockReset, Harm::kClockStep};

// The rows of a log (ranges or differences, by `differences`), harmed, as a file's text.
template <class Rows>
std::string harmed_log(Rows rows, Harm harm) {
  constexpr bool differences = std::is_same_v<typename Rows::value_type, Difference>;
  sim::Random random{"harm to a log"};
  const double middle = (rows.front().t + rows.back().t) / 2;
  std::string text = differences ? "t_s,tag_id,anchor_id_a,anchor_id_b,difference_m\n"
                                 : "t_s,tag_id,anchor_id,range_m\n";
  for (auto& row : rows) {
    double off = 0;
    const bool hit = random.chance(0.1);
    const double by = random.uniform(0.5, 20);
    if (harm == Harm::kOutliers && hit) off = by;
    if (harm == Harm::kSilence && row.t >= middle && row.t < middle + 3) continue;
    if (harm == Harm::kClockReset && row.t >= middle) row.t -= middle;
    if (harm == Harm::kClockStep && row.t >= middle) row.t -= 0.5;
    if constexpr (differences) {
      if (harm == Harm::kLiar) {
        off = 2.0 * (row.anchor_b == kLiarId ? 1 : 0) - 2.0 * (row.anchor_a == kLiarId ? 1 : 0);
      }
      text += fmt::format("{:.4f},{},{},{},{:.4f}\n", row.t, row.tag, row.anchor_a, row.anchor_b,
                          row.difference + off);
    } else {
      if (harm == Harm::kLiar && row.anchor == kLiarId) off = 2;
      text += fmt::format("{:.4f},{},{},{:.4f}\n", row.t, row.tag, row.anchor, row.range + off);
    }
  }
  return text;
}

// Position error after a harm, once recovered, from `words` but for the log.
double harmed_rmse(const Files& files, std::vector<std::string> words, const char* option,
                   const std::string& log, Harm harm) {
  words.insert(words.end(), {option, files.write("harmed.csv", log).string(), "--filter", "--out",
                             files.path("harmed").string()});
  REQUIRE(run_with(words) == kSuccess);
  const Json summary = Json::parse(files.read("harmed/summary.json"));
  const Json& filter = summary.at("filter");
  // Who lies must be known first.
  CHECK(filter.at("first_pose_after_s").get<double>() < (harm == Harm::kLiar ? 2 : 1));
  const Json liar = Json::array({kLiarId});
  CHECK(filter.at("guilty_anchors") == (harm == Harm::kLiar ? liar : Json::array()));
  if (harm == Harm::kSilence || harm == Harm::kClockReset || harm == Harm::kClockStep) {
    REQUIRE(filter.at("interruptions").size() >= 1);
    const char* const cause =
        harm == Harm::kSilence ? "nothing was received" : "clock was set back";
    const double without = harm == Harm::kSilence ? 2.9 : 0.0;
    const auto& told = filter.at("interruptions");
    CHECK(std::any_of(told.begin(), told.end(), [&](const Json& what) {
      return what.at("cause").get<std::string>().find(cause) != std::string::npos &&
             what.at("without_s").get<double>() >= without;
    }));
    CHECK(filter.at("slowest_recovery_s").get<double>() < 4);
    CHECK(filter.at("slowest_recovery_by_truth_s").get<double>() < 4);
    CHECK(files.read("harmed/report.html").find("Interruptions and recovery") != std::string::npos);
  }
  return filter.at("settled_rmse_m").get<double>();
}

std::string tum(const Trajectory& trajectory) {
  std::string text;
  for (const StampedPose& p : trajectory.poses()) {
    text += fmt::format("{:.4f} {:.5f} {:.5f} {:.5f} {:.7f} {:.7f} {:.7f} {:.7f}\n", p.t,
                        p.position.x(), p.position.y(), p.position.z(), p.rotation.x, p.rotation.y,
                        p.rotation.z, p.rotation.w);
  }
  return text;
}

}  // namespace

TEST_CASE("filtering: outliers, a liar, silence, a clock set back: within twice of the clean run") {
  const Files files;
  Drone drone{"a drone and what befalls its log", 30};
  drone.measure(false);
  drone.measure(true);
  const Recording& recording = drone.recording();
  std::string anchors = "anchor_id,x_m,y_m,z_m\n";
  for (const auto& [id, p] : recording.site.anchors) {
    anchors += fmt::format("{},{},{},{}\n", id, p.x(), p.y(), p.z());
  }
  std::string imu = "t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,acc_x_mps2,acc_y_mps2,acc_z_mps2\n";
  for (const InertialReading& s : drone.samples()) {
    imu += fmt::format("{:.4f},{:.6f},{:.6f},{:.6f},{:.5f},{:.5f},{:.5f}\n", s.t, s.gyro.x(),
                       s.gyro.y(), s.gyro.z(), s.accelerometer.x(), s.accelerometer.y(),
                       s.accelerometer.z());
  }
  const std::string anchors_file = files.write("anchors.csv", anchors).string();
  const std::string truth_file = files.write("truth.tum", tum(recording.site.truth)).string();
  const std::string imu_file = files.write("imu.csv", imu).string();
  for (const bool differences : {false, true}) {
    for (const bool unit : {false, true}) {
      if (kSanitized && differences != unit) continue;
      std::vector<std::string> words{"replay",   "--anchors", anchors_file, "--truth",
                                     truth_file, "--dim",     "3"};
      if (unit) words.insert(words.end(), {"--imu", imu_file});
      const auto rmse = [&](Harm harm) {
        return harmed_rmse(files, words, differences ? "--tdoa" : "--ranges",
                           differences ? harmed_log(recording.differences, harm)
                                       : harmed_log(recording.readings, harm),
                           harm);
      };
      const double clean = rmse(Harm::kNone);
      for (const Harm harm : kHarms) {
        CAPTURE(differences);
        CAPTURE(unit);
        CAPTURE(static_cast<int>(harm));
        const double harmed = rmse(harm);
        MESSAGE("rmse " << clean << " m clean, " << harmed << " m harmed");
        CHECK(harmed < 2 * clean);
      }
    }
  }
}

namespace {

// Simulated differences, one of whose anchors may lie, as `replay --filter` follows them.
class LiedAbout {
 public:
  LiedAbout(const Files& files, std::vector<std::string> how) : files_{files} {
    const std::vector<std::string> what{"simulate", "--tdoa", "--out", files.path("logs").string()};
    how.insert(how.begin(), what.begin(), what.end());
    REQUIRE(run_with(how) == kSuccess);
    Problems problems;
    rows = read_tdoa(log("tdoa.csv"), problems).rows;
    REQUIRE_FALSE(rows.empty());
  }

  // summary.json where `liar` is off by `lie`.
  [[nodiscard]] Json summary(Id liar, double lie) const {
    std::string text = "t_s,tag_id,anchor_id_a,anchor_id_b,difference_m\n";
    for (const Difference& row : rows) {
      const double off = (row.anchor_b == liar ? lie : 0) - (row.anchor_a == liar ? lie : 0);
      text += fmt::format("{:.4f},{},{},{},{:.4f}\n", row.t, row.tag, row.anchor_a, row.anchor_b,
                          row.difference + off);
    }
    REQUIRE(run_with({"replay", "--filter", "--anchors", log("anchors.csv").string(), "--truth",
                      log("truth.tum").string(), "--height", "1", "--tdoa",
                      files_.write("lies.csv", text).string(), "--out",
                      files_.path("lies").string()}) == kSuccess);
    return Json::parse(files_.read("lies/summary.json"));
  }

  std::vector<Difference> rows;

 private:
  [[nodiscard]] std::filesystem::path log(const char* name) const {
    return files_.path("logs") / name;
  }

  const Files& files_;
};

}  // namespace

TEST_CASE("filtering: of differences that share a reference, any anchor that lies is found") {
  const Files files;
  const LiedAbout logs{files, {"--second-height", "0.3"}};
  REQUIRE(logs.rows.front().anchor_a == 1);
  const auto rmse = [](const Json& of) {
    return of.at("filter").at("settled_rmse_m").get<double>();
  };
  const Json clean = logs.summary(0, 0);
  CHECK(clean.at("filter").at("guilty_anchors").empty());
  for (const auto& [liar, lie] :
       {std::pair{Id{1}, 2.0}, std::pair{Id{1}, -2.0}, std::pair{Id{4}, 2.0}}) {
    CAPTURE(liar);
    CAPTURE(lie);
    const Json lied = logs.summary(liar, lie);
    CHECK(lied.at("filter").at("guilty_anchors") == Json::array({liar}));
    MESSAGE("rmse " << rmse(clean) << " m clean, " << rmse(lied) << " m with a liar");
    CHECK(rmse(lied) < 2 * rmse(clean));
    if (kSanitized) break;
  }
}

TEST_CASE("filtering: of random pairs, no pose is told before it is known which anchor lies") {
  // Ten a second: a handful of them fits a wrong place.
  const Files files;
  for (const auto& [seed, liar] : {std::pair{"11", Id{8}}, std::pair{"22", Id{4}},
                                   std::pair{"23", Id{1}}, std::pair{"26", Id{1}}}) {
    CAPTURE(seed);
    const LiedAbout logs{files, {"--pairs", "--seed", seed}};
    const Json clean = logs.summary(0, 0);
    CHECK(clean.at("filter").at("guilty_anchors").empty());
    const Json lied = logs.summary(liar, -2);
    CHECK(lied.at("filter").at("guilty_anchors") == Json::array({liar}));
    const double clean_rmse = clean.at("error_m").at("rmse").get<double>();
    const double lied_rmse = lied.at("error_m").at("rmse").get<double>();
    MESSAGE("rmse " << clean_rmse << " m clean, " << lied_rmse << " m with a liar");
    CHECK(lied_rmse < 2 * clean_rmse);
    if (kSanitized) break;
  }
}

TEST_CASE("filtering: the same harm to a recorded trolley") {
  const auto lias = test::data_or_skip("lias", "lias/mid harmed, through replay --filter");
  if (!lias) return;
  const Files files;
  auto calibrate = words_of_lias(*lias, "calibrate", "static", files.path("cal").string());
  REQUIRE(run_with(calibrate) == kSuccess);
  const std::vector<std::string> words{"replay",
                                       "--anchors",
                                       (*lias / "anchors.csv").string(),
                                       "--tags",
                                       (*lias / "tags.csv").string(),
                                       "--truth",
                                       (*lias / "mid/truth.tum").string(),
                                       "--bias",
                                       files.path("cal/bias.csv").string(),
                                       "--height",
                                       "0.96"};
  Problems problems;
  auto rows = read_ranges(*lias / "mid/ranges.csv", problems).rows;
  if (kSanitized) rows.resize(rows.size() / 5);
  const auto rmse = [&](Harm harm) {
    return harmed_rmse(files, words, "--ranges", harmed_log(rows, harm), harm);
  };
  const double clean = rmse(Harm::kNone);
  for (const Harm harm : kHarms) {
    CAPTURE(static_cast<int>(harm));
    const double harmed = rmse(harm);
    MESSAGE("rmse " << clean << " m clean, " << harmed << " m harmed");
    if (!kSanitized) CHECK(harmed < 2 * clean);
  }
}

TEST_CASE("filtering: rows out of order, or tag by tag, are no clock that was set back") {
  const Files files;
  const auto resets = [&](const std::vector<std::pair<double, int>>& rows) {
    std::string text = "t_s,tag_id,anchor_id,range_m\n";
    int i = 0;
    for (const auto& [t, tag] : rows) {
      text += fmt::format("{},{},{},{:.3f}\n", t, tag, i % 4, 5 + 0.001 * i);
      ++i;
    }
    Problems problems;
    return read_ranges(files.write("r.csv", text), problems).counts.clock_resets;
  };
  std::vector<std::pair<double, int>> rows;
  for (int i = 0; i < 400; ++i) rows.emplace_back(0.05 * i, 0);
  CHECK(resets(rows).empty());
  auto late = rows;
  std::rotate(late.begin() + 50, late.begin() + 51, late.begin() + 150);
  CHECK(resets(late).empty());
  auto by_tag = rows;
  for (const auto& [t, tag] : rows) by_tag.emplace_back(t, 1);
  CHECK(resets(by_tag).empty());
  auto parts = rows;
  std::rotate(parts.begin(), parts.begin() + 200, parts.end());
  CHECK(resets(parts).empty());
  auto set_back = rows;
  for (std::size_t k = 200; k < set_back.size(); ++k) set_back[k].first -= 9.98;
  const auto found = resets(set_back);
  REQUIRE(found.size() == 1);
  CHECK(found.front().t == doctest::Approx(10));
  CHECK(found.front().back == doctest::Approx(9.98));
  // By little; by less than eight rows; to before the log began, and not to where a part ends that
  // was put in the wrong order.
  const auto by = [&](double back) {
    auto stepped = rows;
    for (std::size_t k = 200; k < stepped.size(); ++k) stepped[k].first -= back;
    return resets(stepped);
  };
  for (const double back : {0.43, 0.5, 1.22, 1.7e9, 300.0, 24.0, 17.0, -1.7e9}) {
    CAPTURE(back);
    const auto stepped_back = by(back);
    REQUIRE(stepped_back.size() == 1);
    CHECK(stepped_back.front().back == doctest::Approx(back));
  }
  for (const double back : {0.02, 0.3, 20.0, -500.0}) CHECK(by(back).empty());
  // Rows that come late, in batches by anchor as of gateways, in a hole, one stamp of another time.
  const auto in_order_of = [&](const auto& key) {
    std::string text = "t_s,tag_id,anchor_id,range_m\n";
    std::vector<std::size_t> order(rows.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
    std::ranges::stable_sort(order, {}, key);
    for (const std::size_t k : order) {
      text +=
          fmt::format("{},0,{},{:.3f}\n", rows[k].first, k % 4, 5 + 0.001 * static_cast<double>(k));
    }
    Problems problems;
    return read_ranges(files.write("r.csv", text), problems).counts.clock_resets;
  };
  for (const std::size_t batch : {20, 40, 100}) {
    CAPTURE(batch);
    CHECK(in_order_of([&](std::size_t k) { return 10 * (k / batch) + k % 2; }).empty());
    CHECK(in_order_of([&](std::size_t k) { return 10 * (k / batch) + k % 4; }).empty());
  }
  CHECK(in_order_of([](std::size_t k) { return k + k * 149 % 10; }).empty());
  auto hole = rows;
  std::rotate(hole.begin() + 150, hole.begin() + 180, hole.begin() + 250);
  CHECK(resets(hole).empty());
  for (const double wrong : {30.0, 1e9}) {
    auto astray = rows;
    astray[150].first = wrong;
    CHECK(resets(astray).empty());
  }
  auto shuffled = rows;
  for (std::size_t k = 0; k < rows.size(); ++k) shuffled[k] = rows[k * 149 % rows.size()];
  CHECK(resets(shuffled).empty());
  // With rows a little out of order, and of two tags one after the other.
  auto disordered = rows;
  for (std::size_t k = 200; k < rows.size(); ++k) disordered[k].first -= 5;
  for (std::size_t k = 0; k + 3 < rows.size(); k += 4) std::swap(disordered[k], disordered[k + 3]);
  REQUIRE(resets(disordered).size() == 1);
  CHECK(resets(disordered).front().back == doctest::Approx(5).epsilon(0.05));
  auto two = rows;
  for (std::size_t k = 200; k < two.size(); ++k) two[k].first -= 5;
  const auto first_tag = two;
  for (const auto& [t, tag] : first_tag) two.emplace_back(t, 1);
  const auto of_both = resets(two);
  REQUIRE(of_both.size() == 1);  // told of by either
  CHECK(of_both[0].back == doctest::Approx(5));
  CHECK(of_both[0].t == doctest::Approx(10));
  // To where times are those of rows before, which say something else.
  auto onto = rows;
  for (std::size_t k = 200; k < onto.size(); ++k) onto[k].first = rows[k - 200].first;
  CHECK(resets(onto).size() == 1);
}

TEST_CASE("filtering: logs of one clock that was set back go on together") {
  Drone drone{"a drone whose clock is set back", 16};
  drone.measure(false);
  const Recording& recording = drone.recording();
  const Files files;
  std::string anchors = "anchor_id,x_m,y_m,z_m\n";
  for (const auto& [id, p] : recording.site.anchors) {
    anchors += fmt::format("{},{},{},{}\n", id, p.x(), p.y(), p.z());
  }
  // At 8 s, after two seconds without the radio.
  const auto set = [](double t) { return t < 8 ? t : t - 1000; };
  std::string ranges = "t_s,anchor_id,range_m\n";
  for (const Reading& r : recording.readings) {
    if (r.t < 6 || r.t >= 8)
      ranges += fmt::format("{:.4f},{},{:.4f}\n", set(r.t), r.anchor, r.range);
  }
  std::string imu = "t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,acc_x_mps2,acc_y_mps2,acc_z_mps2\n";
  for (const InertialReading& s : drone.samples()) {
    imu += fmt::format("{:.4f},{:.6f},{:.6f},{:.6f},{:.5f},{:.5f},{:.5f}\n", set(s.t), s.gyro.x(),
                       s.gyro.y(), s.gyro.z(), s.accelerometer.x(), s.accelerometer.y(),
                       s.accelerometer.z());
  }
  REQUIRE(run_with({"replay", "--filter", "--dim", "3", "--anchors",
                    files.write("anchors.csv", anchors).string(), "--truth",
                    files.write("truth.tum", tum(recording.site.truth)).string(), "--ranges",
                    files.write("ranges.csv", ranges).string(), "--imu",
                    files.write("imu.csv", imu).string(), "--out", files.path("out").string()}) ==
          kSuccess);
  const Json summary = Json::parse(files.read("out/summary.json"));
  CHECK(summary.at("filter").at("settled_rmse_m").get<double>() < 0.15);
  CHECK(files.read("out/report.html").find("set back by 1000 s") != std::string::npos);
}

TEST_CASE("filtering: an accelerometer upside down, or without gravity, is refused by name") {
  Drone drone{"a drone whose z axis points down", 6};
  drone.measure(false);
  const double without = drone.filtered(false).all.error.rmse;
  const auto said = [&](const auto& change) {
    const auto good = drone.samples();
    for (InertialReading& s : drone.samples()) change(s);
    const Replay result = drone.filtered(true);
    drone.samples() = good;
    CHECK(result.all.error.rmse == without);
    return result.filtering->unused_unit;
  };
  CHECK(said([](InertialReading& s) { s.accelerometer *= -1; }).find("z axis points down") !=
        std::string::npos);
  CHECK(said([](InertialReading& s) {
          s.accelerometer = {s.accelerometer.z(), s.accelerometer.y(), -s.accelerometer.x()};
        }).find("along x") != std::string::npos);
  CHECK(said([](InertialReading& s) {
          s.accelerometer.z() -= 9.80665;
        }).find("gravity was taken off") != std::string::npos);
  CHECK(drone.filtered(true).filtering->unused_unit.empty());
}

TEST_CASE("filtering: a unit of another time is not used; one that begins late is, from then on") {
  Drone drone{"a drone whose unit is late", 16};
  drone.measure(false);
  const double without = drone.filtered(false).all.error.rmse;
  const auto good = drone.samples();
  for (InertialReading& s : drone.samples()) s.t += 1e6;
  const Replay never = drone.filtered(true);
  CHECK(never.filtering->unused_unit.find("time of the measurements") != std::string::npos);
  CHECK(never.all.error.rmse == without);

  drone.samples() = good;
  std::erase_if(drone.samples(), [](const InertialReading& s) { return s.t < 4; });
  const Replay late = drone.filtered(true);
  REQUIRE(late.body);
  MESSAGE("rmse " << without << " m without, " << late.body->error.rmse << " m with a late unit");
  CHECK(late.body->error.rmse < 1.1 * without);
  CHECK(late.filtering->inertial_epochs * 2 > late.body->track.size());
}

TEST_CASE("filtering: one row from a broken clock does not cost the others") {
  Drone drone{"a drone and a broken stamp", 6};
  drone.measure(false);
  const Replay whole = drone.filtered(false);
  for (const double t : {-1e9, -1e300, 1e300}) {
    auto& readings = drone.recording().readings;
    const auto kept = readings;
    readings.push_back({t, 0, 3, 4.0, {}, {}, 0});
    std::ranges::stable_sort(readings, {}, &Reading::t);
    const Replay result = drone.filtered(false);
    CHECK(result.all.solved + 1 >= whole.all.solved);
    CHECK(result.all.error.rmse == doctest::Approx(whole.all.error.rmse).epsilon(0.05));
    CHECK(result.refused_readings.at("numeric_overflow") == 1);
    readings = kept;
  }
}

TEST_CASE(
    "filtering: several tags in space without a unit are followed one by one, which is said") {
  Drone drone{"a drone with two tags", 6};
  drone.measure(false);
  auto& readings = drone.recording().readings;
  const auto first = readings;
  for (Reading r : first) {
    r.tag = 1;
    readings.push_back(r);
  }
  std::ranges::stable_sort(readings, {}, &Reading::t);
  const auto words = [&] {
    const Replay result = drone.filtered(false);
    CHECK_FALSE(result.body);
    std::string all;
    for (const std::string& s : remarks(drone.recording(), result, Problems{})) all += s;
    return all;
  };
  CHECK(words().find("no tags file") != std::string::npos);
  drone.recording().site.tags = {{0, Vec3{0.2, 0, 0}}, {1, Vec3{-0.2, 0, 0}}};
  CHECK(words().find("without an inertial unit the attitude") != std::string::npos);
}

TEST_CASE("filtering: a trolley with three tags, with constants and with a network") {
  const auto lias = test::data_or_skip("lias", "lias/mid through replay --filter");
  if (!lias) return;
  const Files files;
  auto calibrate = words_of_lias(*lias, "calibrate", "static", files.path("cal").string());
  REQUIRE(run_with(calibrate) == kSuccess);
  auto words = words_of_lias(*lias, "replay", "mid", files.path("out").string());
  words.insert(words.end(), {"--height", "0.96", "--filter"});
  auto network = words;
  words.insert(words.end(), {"--bias", files.path("cal/bias.csv").string()});
  REQUIRE(run_with(words) == kSuccess);
  const Json constants = Json::parse(files.read("out/summary.json"));
  CHECK(constants.at("solved") == 1200);
  CHECK(constants.at("error_m").at("rmse").get<double>() <= 0.035);
  CHECK(constants.at("heading_error_deg").at("rmse").get<double>() <= 3.6);
  // What several tags tell of their links' biases makes the covariance honest. Of biases that
  // outlast the recording one run tells little: a factor of two and a half.
  const Json& filter = constants.at("filter");
  MESSAGE("NIS " << filter.at("mean_nis").get<double>() << ", NEES in plan "
                 << filter.at("mean_nees").get<double>());
  CHECK(filter.at("mean_nis").get<double>() > 0.7);
  CHECK(filter.at("mean_nis").get<double>() < 1.4);
  CHECK(filter.at("mean_nees").get<double>() > 0.4);
  CHECK(filter.at("mean_nees").get<double>() < 2.5);
  const std::string report = files.read("out/report.html");
  for (const char* title :
       {"Innovations (NIS)", "Ellipses: where", "Bars from below", "causally"}) {
    CHECK(report.find(title) != std::string::npos);
  }
  if (kSanitized) return;
  network.insert(network.end(),
                 {"--bias-network", "examples/bias_training/lias/bias_network.json"});
  REQUIRE(run_with(network) == kSuccess);
  const Json trained = Json::parse(files.read("out/summary.json"));
  CHECK(trained.at("error_m").at("rmse").get<double>() < 0.030);
}

TEST_CASE("filtering: a robot outside its box of four anchors") {
  const auto folder = test::data_or_skip("hanyang/los_trajectory_b_case_4",
                                         "a robot outside four anchors through replay --filter");
  if (!folder) return;
  const Files files;
  REQUIRE(run_with({"replay", "--anchors", (*folder / "anchors.csv").string(), "--ranges",
                    (*folder / "ranges.csv").string(), "--truth", (*folder / "truth.tum").string(),
                    "--height", "1", "--filter", "--out", files.path("out").string()}) == kSuccess);
  const Json summary = Json::parse(files.read("out/summary.json"));
  CHECK(summary.at("error_m").at("rmse_xy").get<double>() <= 0.40);
}

TEST_CASE("filtering: one of four anchors that lies is named, and its lie estimated") {
  const auto folder = test::data_or_skip("hanyang/los_trajectory_b_case_4",
                                         "a liar among four anchors through replay --filter");
  if (!folder) return;
  Settings settings;
  settings.anchors = *folder / "anchors.csv";
  settings.ranges = *folder / "ranges.csv";
  settings.truth = *folder / "truth.tum";
  settings.height = 1;
  settings.filter = true;
  Problems problems;
  const Recording recording = read_recording(settings, problems);
  const double clean = replay_filtered(settings, recording).all.error.rmse;
  for (const auto& [liar, position] : recording.site.anchors) {
    CAPTURE(liar);
    Recording harmed = recording;
    for (Reading& r : harmed.readings) r.range += r.anchor == liar ? 2 : 0;
    const Replay result = replay_filtered(settings, harmed);
    CHECK(guilty_anchors(*result.filtering) == std::vector<Id>{liar});
    MESSAGE("anchor " << liar << " lies: " << result.all.error.rmse << " m, clean " << clean
                      << " m, " << result.all.solved << " epochs");
    CHECK(result.all.error.rmse < 2 * clean);
    CHECK(20 * (result.all.epochs - result.all.solved) < result.all.epochs);
  }
}

TEST_CASE("filtering: options that need one another, and inertial files that hold nothing") {
  const Files files;
  const std::string anchors =
      files.write("a.csv", "anchor_id,x_m,y_m,z_m\n0,0,0,1\n1,9,0,1\n2,0,9,1\n3,9,9,1\n").string();
  std::string rows = "t_s,anchor_id,range_m\n";
  for (int i = 0; i < 100; ++i) rows += fmt::format("{},{},6.364\n", 0.01 * i, i % 4);
  // A time that no clock tells; it is refused, the rest is followed.
  const std::string ranges = files.write("r.csv", rows + "1e300,0,6\n").string();
  const std::string out = files.path("out").string();
  const std::vector<std::string> base{"replay", "--anchors", anchors, "--ranges",
                                      ranges,   "--out",     out};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), base.begin(), base.end());
    return run_with(more);
  };
  const auto imu = [&](const std::string& text) {
    return files
        .write("i.csv",
               "t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,acc_x_mps2,acc_y_mps2,acc_z_"
               "mps2\n" +
                   text)
        .string();
  };
  CHECK(with({"--imu", imu("0,0,0,0,0,0,9.8\n")}) == kBadUsage);
  CHECK(with({"--filter", "--loss", "huber"}) == kBadUsage);
  CHECK(with({"--tdoa", ranges}) == kBadUsage);
  CHECK(with({"--filter", "--subnets", anchors}) == kBadUsage);
  CHECK(with({"--filter", "--imu", imu("")}) == kBadInput);
  CHECK(with({"--filter", "--imu", files.write("n.csv", "t_s\n0\n").string()}) == kBadInput);
  CHECK(with({"--filter", "--imu", imu("x,0,0,0,0,0,0\n0,,0,0,0,0,0\n"), "--strict"}) == kBadInput);
  CHECK(with({"--filter"}) == kSuccess);
  const Json summary = Json::parse(files.read("out/summary.json"));
  CHECK(summary.at("solved").get<int>() > 0);
  CHECK(summary.at("refused_readings").at("numeric_overflow") == 1);
  // Of no use in the plane with one tag, which is said.
  CHECK(with({"--filter", "--imu", imu("0,0,0,0,0,0,9.8\n1e300,9e99,0,0,0,0,0\n")}) == kSuccess);
  CHECK(files.read("out/report.html").find("inertial unit was not used") != std::string::npos);
}

}  // namespace tests::host_filtering
