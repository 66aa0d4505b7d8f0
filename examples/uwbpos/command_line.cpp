// SPDX-License-Identifier: MIT
#include "command_line.hpp"

#include <cmath>
#include <exception>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "uwbpos/core/version.hpp"

#include "commands.hpp"
#include "demo.hpp"
#include "failure.hpp"
#include "simulate.hpp"
#include "ultrasonic.hpp"

namespace uwbpos::host {
namespace {

constexpr const char* kAbout =
    "uwbpos: positions from recordings of UWB ranges or raw timestamps.\n"
    "\n"
    "A first position from your own data, in two files:\n"
    "  anchors.csv  anchor_id,x_m,y_m,z_m\n"
    "  ranges.csv   t_s,anchor_id,range_m          (tag_id, sigma_m if you have them)\n"
    "  uwbpos replay --anchors anchors.csv --ranges ranges.csv --height 1.0 --out out\n"
    "and then open out/report.html. No recording yet? `uwbpos simulate` makes one.";

constexpr const char* kReplayFooter =
    "Files are CSV with a header row; columns are found by name, others ignored:\n"
    "  anchors.csv  anchor_id,x_m,y_m,z_m\n"
    "  tags.csv     tag_id,x_m,y_m,z_m    lever arms: body x forward, y left, z up\n"
    "  ranges.csv   t_s,anchor_id,range_m [tag_id,sigma_m,rssi_dbm,fp_power_dbm]\n"
    "  tdoa.csv     t_s,anchor_id_a,anchor_id_b,difference_m [tag_id,sigma_m]\n"
    "               difference: distance(tag, b) minus distance(tag, a)\n"
    "  imu.csv      t_s,gyro_x_radps,gyro_y_radps,gyro_z_radps,\n"
    "               acc_x_mps2,acc_y_mps2,acc_z_mps2  with --filter; specific force,\n"
    "               (0, 0, +g) at rest\n"
    "  subnets.csv  subnet_id,x_m,y_m,z_m,yaw_deg\n"
    "               [control_anchor_id,sigma_m,sigma_yaw_deg]: where the subnet's origin,\n"
    "               its control anchor, is in the map, and its x axis points; or\n"
    "               subnet_id,anchor_id,x_m,y_m,z_m [control_anchor_id,sigma_m]: two or\n"
    "               more of its anchors surveyed in the map. anchors.csv then has\n"
    "               subnet_id, and positions in the subnet's own frame, where each\n"
    "               subnet is solved; positions of several are fused by covariance\n"
    "  twr.csv      t_s,anchor_id,poll_tx,poll_rx,resp_tx,resp_rx [tag_id,final_tx,final_rx,\n"
    "               clock_offset_ppm,fp_power_dbm,true_range_m,logged_range_m]\n"
    "  bias.csv     anchor_id,bias_m [tag_id]         range minus truth, is subtracted\n"
    "  truth.tum    t_s x_m y_m z_m qx qy qz qw       pose of the body, separated by spaces\n"
    "\n"
    "Exit code: 0 solved, 1 bad input or nothing to solve, 2 wrong usage.";

// All numbers but NaN; `inf` too where it makes sense.
CLI::Validator above_zero() {
  return CLI::Validator{[](std::string& text) -> std::string {
                          const double value = std::strtod(text.c_str(), nullptr);
                          return value > 0 && std::isfinite(value)
                                     ? ""
                                     : fmt::format("expected a finite number above zero, got {}",
                                                   text);
                        },
                        "", "above zero"};
}

CLI::Validator finite() {
  return CLI::Validator{[](std::string& text) -> std::string {
                          const double value = std::strtod(text.c_str(), nullptr);
                          return std::isfinite(value) ? ""
                                                      : "expected a finite number, got " + text;
                        },
                        "", "finite"};
}

CLI::Validator not_negative() {
  return CLI::Validator{
      [](std::string& text) -> std::string {
        const double value = std::strtod(text.c_str(), nullptr);
        return value >= 0 && std::isfinite(value) ? "" : "expected zero or more, got " + text;
      },
      "", "not negative"};
}

// An option that names one of a few things.
template <class T>
void add_choice(CLI::App& app, const std::string& option, T& value, const std::string& description,
                std::vector<std::pair<std::string, T>> choices) {
  std::string names;
  for (const auto& [name, meaning] : choices) names += (names.empty() ? "" : "|") + name;
  app.add_option_function<std::string>(
         option,
         [&value, choices = std::move(choices), names, option](const std::string& text) {
           for (const auto& [name, meaning] : choices) {
             if (name != text) continue;
             value = meaning;
             return;
           }
           throw CLI::ValidationError{option, fmt::format("expected {}, got {}", names, text)};
         },
         description)
      ->type_name(names);
}

struct Arguments {
  Settings settings;
  double height = 0;
  double epoch_window = 0;
  std::string velocity;
  Vec<double, 2> target = Vec<double, 2>::Zero();
  std::vector<double> prior;
};

void add_inputs(CLI::App& app, Arguments& a) {
  Settings& s = a.settings;
  app.add_option("--anchors", s.anchors, "where the anchors are (CSV)")->type_name("FILE");
  auto* ranges = app.add_option("--ranges", s.ranges, "measured ranges (CSV)")->type_name("FILE");
  auto* twr = app.add_option("--twr", s.twr, "raw timestamps of two-way exchanges (CSV)")
                  ->type_name("FILE");
  ranges->excludes(twr);
  app.add_option("--tags", s.tags, "lever arms of the tags on the body (CSV)")->type_name("FILE");
  app.add_option("--truth", s.truth, "true poses of the body (TUM)")->type_name("FILE");
  app.add_option(
         "--height", a.height,
         "height of the tags' antennas [m]; solves in the\nplane, or with --dim 3 tells the side")
      ->type_name("H")
      ->check(finite());
  app.add_option("--tag", s.only_tags, "only this tag; may be given several times")
      ->type_name("ID");
  app.add_option_function<double>(
         "--sigma", [&s](const double& sigma) { s.sigma = sigma; },
         "standard deviation of ranges, or arrivals of\n--tdoa, that tell none [m] (default: 0.1; "
         "with\n--tdoa found from the log)")
      ->type_name("S")
      ->check(above_zero());
  app.add_option("--max-range", s.max_range, "longer ranges are refused [m]")
      ->type_name("R")
      ->check(above_zero())
      ->capture_default_str();
  app.add_option("--counter-bits", s.counter_bits,
                 "width of the counter in --twr, 24 to 40\n(default: 32 or 40, found from the log)")
      ->type_name("N")
      ->check(CLI::Range(24u, 40u).description(""));
  app.add_option("--power-bias", s.power_bias,
                 "range bias by received power, is subtracted\n(CSV: power_dbm,bias_m)")
      ->type_name("FILE");
  app.add_option("--out", s.out, "directory for the results")
      ->type_name("DIR")
      ->capture_default_str();
  app.add_flag("--strict", s.strict, "a malformed row ends the run");
}

void add_solving(CLI::App& app, Arguments& a) {
  Settings& s = a.settings;
  app.add_option("--tdoa", s.tdoa, "range differences between pairs of anchors (CSV)")
      ->type_name("FILE");
  app.add_option("--subnets", s.subnets, "how subnets lie in the map (CSV)")
      ->type_name("FILE")
      ->needs(app.get_option("--tdoa"));
  app.add_option("--bias", s.bias, "bias of each link (CSV, from calibrate)")->type_name("FILE");
  app.add_option(
         "--bias-network", s.bias_network,
         "network of the links' biases (JSON, from\nexamples/bias_training/train.py); with several "
         "tags,\nor --attitude")
      ->type_name("FILE")
      ->excludes(app.get_option("--bias"));
  app.add_option("--attitude", s.attitude,
                 "how the body lies over time, as from an inertial\nunit (TUM; positions are not "
                 "used), for\n--bias-network with one tag or --tdoa")
      ->type_name("FILE")
      ->needs(app.get_option("--bias-network"));
  auto* filter = app.add_flag("--filter", s.filter,
                              "follow the tags over time, causally, with all files\nthat are "
                              "given; else each epoch stands alone")
                     ->excludes(app.get_option("--subnets"))
                     ->excludes(app.get_option("--attitude"));
  app.add_option("--imu", s.imu, "gyro and accelerometer of the body (CSV)")
      ->type_name("FILE")
      ->needs(filter);
  add_choice<std::optional<int>>(app, "--dim", s.dim,
                                 "2: in the plane, 3: in space (default: 2 with\n--height or when "
                                 "all anchors are equally high,\nelse 3)",
                                 {{"2", 2}, {"3", 3}});
  app.add_option("--epoch-window", a.epoch_window,
                 "readings within this time are solved together [s]\n(default: from the log)")
      ->type_name("S")
      ->check(not_negative());
  add_choice<Side>(app, "--side", s.side,
                   "in space: the tags are above or below the plane\nof the anchors",
                   {{"above", Side::kAbove}, {"below", Side::kBelow}});
  add_choice<Loss>(app, "--loss", s.loss,
                   "of poses of several tags: squares, or one that bounds\nthe pull of outliers",
                   {{"squares", Loss::Squares}, {"huber", Loss::Huber}, {"cauchy", Loss::Cauchy}});
  app.add_option("--velocity", a.velocity,
                 "with several tags: velocities too, between poses this\nfar apart [s] (default: "
                 "1)")
      ->type_name("S")
      ->expected(0, 1)
      ->check(above_zero());
  app.add_option("--prior", a.prior,
                 "where the tags start, roughly [m]; settles mirror\nimages before the first "
                 "position is known")
      ->type_name("X,Y[,Z]")
      ->delimiter(',')
      ->expected(2, 3)
      ->check(finite());
}

// Options that have to be given or not, which CLI11 leaves as values.
void settle(const CLI::App& app, Arguments& a) {
  Settings& s = a.settings;
  if (app.count("--height") > 0) s.height = a.height;
  if (s.ranges.empty() && s.twr.empty() && s.tdoa.empty()) {
    throw CLI::RequiredError{"--ranges, --twr or --tdoa"};
  }
}

void settle_solving(const CLI::App& app, Arguments& a) {
  settle(app, a);
  Settings& s = a.settings;
  if (app.count("--epoch-window") > 0) s.epoch_window = a.epoch_window;
  if (app.count("--velocity") > 0) {
    s.velocity = a.velocity.empty() ? 1 : std::strtod(a.velocity.c_str(), nullptr);
  }
  if (!a.prior.empty()) {
    s.prior = Vec3{a.prior[0], a.prior[1], a.prior.size() > 2 ? a.prior[2] : 0};
  }
  if (s.anchors.empty() && (s.twr.empty() || s.filter)) throw CLI::RequiredError{"--anchors"};
  if (s.filter) {
    if (app.count("--loss") > 0) throw CLI::ExcludesError{"--loss", "--filter"};
    return;
  }
  if (!s.tdoa.empty()) {
    for (const char* other : {"--ranges", "--twr"}) {
      if (app.count(other) > 0) {
        throw CLI::ValidationError{
            other, "cannot be used together with --tdoa but with --filter, which uses both"};
      }
    }
    if (app.count("--bias-network") > 0 && app.count("--attitude") == 0) {
      throw CLI::ValidationError{"--bias-network", "with --tdoa needs --attitude or --filter"};
    }
  }
}

void add_simulation(CLI::App& app, SimulateSettings& s) {
  app.add_option("--out", s.out, "directory for the logs")->type_name("DIR")->capture_default_str();
  app.add_option("--seed", s.seed, "the same seed, the same logs")
      ->type_name("N")
      ->capture_default_str();
  app.add_option("--hall", s.hall, "the hall, and how high the anchors hang [m] (default: 10,8,3)")
      ->type_name("WIDTH,DEPTH,HEIGHT")
      ->delimiter(',')
      ->expected(3)
      ->check(finite());
  app.add_option("--anchor-count", s.anchors, "how many anchors, up to 64")
      ->type_name("N")
      ->check(CLI::Range(1, 64).description(""))
      ->capture_default_str();
  add_choice<sim::Placement>(app, "--placement", s.placement,
                             "where the anchors hang (default: perimeter)",
                             {{"axes", sim::Placement::Axes},
                              {"corners", sim::Placement::Corners},
                              {"edges", sim::Placement::Edges},
                              {"perimeter", sim::Placement::Perimeter},
                              {"grid", sim::Placement::Grid}});
  app.add_option("--second-height", s.other_height,
                 "height of every second anchor [m] (default: as the others)")
      ->type_name("H")
      ->check(finite());
  add_choice<PathShape>(
      app, "--path", s.path, "how the robot moves (default: lawn)",
      {{"lawn", PathShape::kLawn}, {"circle", PathShape::kCircle}, {"stops", PathShape::kStops}});
  app.add_option("--speed", s.speed, "of the robot [m/s]")
      ->type_name("V")
      ->check(above_zero())
      ->capture_default_str();
  app.add_option("--height", s.tag_height, "of the tags [m]")
      ->type_name("H")
      ->check(finite())
      ->capture_default_str();
  app.add_option("--tag-count", s.tags, "tags on the robot, 0.3 m from its centre if several")
      ->type_name("N")
      ->check(CLI::Range(1, sim::kMaxTags).description(""))
      ->capture_default_str();
  add_choice<RadioModel>(app, "--radio", s.radio, "clocks, noise and reply times (default: dw1000)",
                         {{"ideal", RadioModel::kIdeal},
                          {"dw1000", RadioModel::kDw1000},
                          {"dw3000", RadioModel::kDw3000},
                          {"delivery-robot", RadioModel::kDeliveryRobot}});
  app.add_option("--rate", s.rate, "epochs in a second")
      ->type_name("HZ")
      ->check(above_zero())
      ->capture_default_str();
  app.add_option("--blocked", s.blocked, "share of the time that a link is blocked")
      ->type_name("P")
      ->check(CLI::Range(0.0, 1.0).description(""))
      ->capture_default_str();
  app.add_option("--loss", s.loss, "probability that a message is lost")
      ->type_name("P")
      ->check(CLI::Range(0.0, 1.0).description(""))
      ->capture_default_str();
  auto* tdoa = app.add_flag_callback(
      "--tdoa", [&s] { s.kind = s.kind == LogKind::kPairs ? s.kind : LogKind::kShared; },
      "log range differences of blinks, of all anchors\nagainst a control anchor");
  app.add_flag_callback(
         "--pairs", [&s] { s.kind = LogKind::kPairs; },
         "of each blink only one difference, between two\nanchors that chance chooses")
      ->needs(tdoa);
  app.add_option("--outliers", s.outliers, "share of --tdoa differences off by 0.5 to 4 m")
      ->type_name("P")
      ->needs(tdoa)
      ->check(finite())
      ->check(CLI::Range(0.0, 1.0).description(""))
      ->capture_default_str();
}

constexpr const char* kUltrasonicFooter =
    "Files are CSV with a header row:\n"
    "  anchors.csv     anchor_id,x_m,y_m,z_m      the receivers\n"
    "  ultrasonic.csv  t_s,receiver_id,count [temperature_c]   ticks from shot to arrival\n"
    "Rows of one time are one shot. Receivers equally high are solved in the plane, the\n"
    "emitter on the side of greater y unless --side below or --prior says otherwise;\n"
    "--dim 3 solves in space, --side then is above or below the receivers' plane.";

void add_ultrasonic(CLI::App& app, UltrasonicSettings& u, Arguments& a) {
  Settings& s = u.common;
  app.add_option("--anchors", s.anchors, "where the receivers are (CSV)")
      ->type_name("FILE")
      ->required();
  app.add_option("--ultrasonic", u.shots, "counter readings of each shot (CSV)")
      ->type_name("FILE")
      ->required();
  app.add_option("--truth", s.truth, "true positions of the emitter (TUM)")->type_name("FILE");
  app.add_option("--temperature", u.temperature, "where the log gives none [deg C]")
      ->type_name("C")
      ->check(finite())
      ->capture_default_str();
  app.add_option_function<double>(
         "--tick-us", [&u](const double& us) { u.tick = 1e-6 * us; },
         "of the counter [us] (default: 1/3)")
      ->type_name("T")
      ->check(above_zero());
  app.add_option_function<double>(
         "--delay-us", [&u](const double& us) { u.circuit_delay = 1e-6 * us; },
         "of the circuit, is subtracted [us] (default: 0)")
      ->type_name("T")
      ->check(not_negative());
  app.add_option("--frequency", u.frequency, "of the sound [Hz]")
      ->type_name("F")
      ->check(above_zero())
      ->capture_default_str();
  app.add_option("--max-lag", u.max_lag, "longest lag [waves]")
      ->type_name("N")
      ->check(not_negative())
      ->capture_default_str();
  app.add_option("--max-repair", u.max_repair, "most waves to move a length by")
      ->type_name("N")
      ->check(CLI::Range(0, 8).description(""))
      ->capture_default_str();
  app.add_option_function<double>(
         "--sigma", [&s](const double& sigma) { s.sigma = sigma; },
         "standard deviation of a length [m] (default: a\nhundredth of a wave)")
      ->type_name("S")
      ->check(above_zero());
  app.add_flag("--follow", u.follow, "the last position is the next shot's prior");
  app.add_option("--prior-sigma", u.prior_sigma, "how far a prior may be off, along each axis [m]")
      ->type_name("S")
      ->check(above_zero())
      ->capture_default_str();
  app.add_option("--prior", a.prior, "where the emitter starts, roughly [m]")
      ->type_name("X,Y[,Z]")
      ->delimiter(',')
      ->expected(2, 3)
      ->check(finite());
  app.add_option("--height", a.height, "of the emitter, for the track in the plane [m]")
      ->type_name("H")
      ->check(finite());
  add_choice<std::optional<int>>(app, "--dim", s.dim,
                                 "2: in the plane, 3: in space (default: 2 when all\nreceivers are "
                                 "equally high, else 3)",
                                 {{"2", 2}, {"3", 3}});
  add_choice<Side>(app, "--side", s.side,
                   "of a bar or plate of receivers: greater or smaller\ny (in space, z)",
                   {{"above", Side::kAbove}, {"below", Side::kBelow}});
  app.add_option("--epoch-window", a.epoch_window,
                 "arrivals within this time are one shot [s]\n(default: from the log)")
      ->type_name("S")
      ->check(not_negative());
  app.add_option("--max-range", s.max_range, "longer lengths are refused [m]")
      ->type_name("R")
      ->check(above_zero())
      ->capture_default_str();
  app.add_option("--out", s.out, "directory for the results")
      ->type_name("DIR")
      ->capture_default_str();
  app.add_flag("--strict", s.strict, "a malformed row ends the run");
  app.footer(kUltrasonicFooter);
}

void settle_ultrasonic(const CLI::App& app, UltrasonicSettings& u, const Arguments& a) {
  if (app.count("--height") > 0) u.common.height = a.height;
  if (app.count("--epoch-window") > 0) u.common.epoch_window = a.epoch_window;
  if (!a.prior.empty()) {
    u.common.prior = Vec3{a.prior[0], a.prior[1], a.prior.size() > 2 ? a.prior[2] : 0};
  }
}

int dispatch(int argc, const char* const* argv) {
  CLI::App app{kAbout, "uwbpos"};
  app.require_subcommand(1);
  app.set_version_flag("--version", std::string{kVersion});
  app.get_formatter()->column_width(34);

  Arguments replay_arguments;
  CLI::App* replay = app.add_subcommand("replay", "solve a recording and report on it");
  add_inputs(*replay, replay_arguments);
  add_solving(*replay, replay_arguments);
  replay->footer(kReplayFooter);

  Arguments target_arguments;
  CLI::App* target = app.add_subcommand(
      "target", "replay, and the distance and bearing of a target along the way");
  target->add_option("--x", target_arguments.target.x(), "where the target is [m]")
      ->type_name("X")
      ->required()
      ->check(finite());
  target->add_option("--y", target_arguments.target.y(), "where the target is [m]")
      ->type_name("Y")
      ->required()
      ->check(finite());
  add_inputs(*target, target_arguments);
  add_solving(*target, target_arguments);
  target->footer(kReplayFooter);

  Arguments calibrate_arguments;
  CLI::App* calibrate =
      app.add_subcommand("calibrate", "measure the bias of each link where the truth is known");
  add_inputs(*calibrate, calibrate_arguments);
  calibrate->footer(kReplayFooter);

  SimulateSettings simulation;
  CLI::App* simulate =
      app.add_subcommand("simulate", "write the logs and the truth of a simulated run");
  add_simulation(*simulate, simulation);

  UltrasonicSettings ultrasonic_settings;
  Arguments ultrasonic_arguments;
  CLI::App* ultrasonic =
      app.add_subcommand("ultrasonic", "solve shots of ultrasound, lag and whole waves included");
  add_ultrasonic(*ultrasonic, ultrasonic_settings, ultrasonic_arguments);

  std::filesystem::path demo_out = "out/demo";
  CLI::App* demo = app.add_subcommand("demo", "show in a minute what this is about");
  demo->add_option("--out", demo_out, "directory for the reports")
      ->type_name("DIR")
      ->capture_default_str();

  try {
    app.parse(argc, argv);
    if (simulate->parsed()) return run_simulate(simulation);
    if (demo->parsed()) return run_demo(demo_out);
    if (ultrasonic->parsed()) {
      settle_ultrasonic(*ultrasonic, ultrasonic_settings, ultrasonic_arguments);
      return run_ultrasonic(ultrasonic_settings);
    }
    if (target->parsed()) {
      settle_solving(*target, target_arguments);
      target_arguments.settings.target = target_arguments.target;
      return run_replay(target_arguments.settings);
    }
    if (replay->parsed()) {
      settle_solving(*replay, replay_arguments);
      return run_replay(replay_arguments.settings);
    }
    settle(*calibrate, calibrate_arguments);
    if (calibrate_arguments.settings.anchors.empty()) throw CLI::RequiredError{"--anchors"};
    if (calibrate_arguments.settings.truth.empty()) throw CLI::RequiredError{"--truth"};
    return run_calibrate(calibrate_arguments.settings);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kSuccess : kBadUsage;
  }
}

}  // namespace

int run(int argc, const char* const* argv) {
  try {
    return dispatch(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "uwbpos: {}\n", error.what());
    return kBadInput;
  }
}

}  // namespace uwbpos::host
