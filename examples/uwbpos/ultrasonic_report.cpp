// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "uwbpos/core/version.hpp"

#include "command_line.hpp"
#include "failure.hpp"
#include "output.hpp"
#include "plots.hpp"
#include "report.hpp"
#include "report_parts.hpp"
#include "report_style.hpp"
#include "statistics.hpp"
#include "summary.hpp"
#include "ultrasonic.hpp"

namespace uwbpos::host {
namespace {

using Json = nlohmann::ordered_json;

std::vector<double> lags_of(const UltrasonicReplay& found) {
  std::vector<double> lags;
  for (const ShotDetail& shot : found.shots) lags.push_back(shot.lag);
  std::ranges::sort(lags);
  return lags;
}

template <class Key>
Json counts_json(const std::map<Key, std::size_t>& counts) {
  Json json = Json::object();
  for (const auto& [key, count] : counts) json[fmt::format("{}", key)] = count;
  return json;
}

std::string centimetres(double metres) { return fmt::format("{:.2f} cm", 100 * metres); }

}  // namespace

std::string ultrasonic_summary(const UltrasonicReplay& found, const Problems& problems) {
  const Replay& replay = found.replay;
  Json json{
      {"epochs", replay.all.epochs},
      {"solved", replay.all.solved},
      {"rejected", counts_json(replay.all.rejected)},
      {"solves_per_second", replay.solve_seconds > 0
                                ? static_cast<double>(replay.solve_calls) / replay.solve_seconds
                                : 0.0}};
  if (replay.all.scored > 0) {
    const ErrorSummary& e = replay.all.error;
    json["scored"] = replay.all.scored;
    json["error_m"] = {{"rmse", e.rmse}, {"mean", e.mean}, {"median", e.median},
                       {"p95", e.p95},   {"max", e.max},   {"rmse_xy", e.rmse_xy}};
  }
  json["dim"] = replay.dim;
  json["ambiguous"] = found.ambiguous();
  json["repaired"] = found.repaired();
  Json repairs = Json::object();
  for (const auto& [name, count] : found.repairs()) repairs[name] = count;
  json["repairs"] = repairs;
  if (const std::vector<double> lags = lags_of(found); !lags.empty()) {
    json["lag_m"] = {{"mean", mean(lags)},
                     {"median", quantile_of_sorted(lags, 0.5)},
                     {"min", lags.front()},
                     {"max", lags.back()}};
  }
  json["refused_readings"] = counts_json(replay.refused_readings);
  json["unknown_receivers"] = counts_json(replay.unknown_anchors);
  json["duplicate_readings"] = replay.duplicates;
  json["outside_truth"] = replay.outside_truth;
  json["malformed_rows"] = problems.total();
  return json.dump(2) + '\n';
}

std::string ultrasonic_table(const UltrasonicReplay& found) {
  const Replay& replay = found.replay;
  std::string text =
      fmt::format("{} shots, {} solved in {}; {} repaired, {} ambiguous\n", replay.all.epochs,
                  replay.all.solved, replay.dim == 2 ? "the plane" : "space", found.repaired(),
                  found.ambiguous());
  for (const auto& [reason, count] : replay.all.rejected) {
    text += fmt::format("  refused {:>6}: {}\n", count, reason_words(reason));
  }
  for (const auto& [reason, count] : replay.refused_readings) {
    text += fmt::format("  arrivals left out {:>6}: {}\n", count, reason_words(reason));
  }
  for (const auto& [id, count] : replay.unknown_anchors) {
    text +=
        fmt::format("  receiver {} is not in the anchors file: {} arrivals left out\n", id, count);
  }
  if (replay.duplicates > 0) {
    text += fmt::format("  {} arrivals came twice; the first of each counts\n", replay.duplicates);
  }
  if (const std::vector<double> lags = lags_of(found); !lags.empty()) {
    text += fmt::format("  lag {} to {}, median {}\n", centimetres(lags.front()),
                        centimetres(lags.back()), centimetres(quantile_of_sorted(lags, 0.5)));
  }
  for (const auto& [name, count] : found.repairs()) {
    text += fmt::format("  repair {:<24}{:>6}\n", name, count);
  }
  if (replay.all.scored > 0) {
    const ErrorSummary& e = replay.all.error;
    text += fmt::format("  error against truth: rmse {}, median {}, 95 % {}, largest {}\n",
                        centimetres(e.rmse), centimetres(e.median), centimetres(e.p95),
                        centimetres(e.max));
  }
  return text;
}

std::string ultrasonic_report(const UltrasonicSettings& settings, const Site& site,
                              const UltrasonicReplay& found) {
  const Replay& replay = found.replay;
  const std::string name = escaped(
      (settings.shots.parent_path().filename() / settings.shots.filename()).generic_string());
  std::string page = fmt::format(
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta name=\"color-scheme\" content=\"light dark\">\n<title>uwbpos: {0}</title>\n"
      "<style>{1}</style>\n</head>\n<body>\n<main>\n<h1>{0}</h1>\n<p class=\"lead\">{2} shots, {3} "
      "receivers; solved in {4}. {5}</p>\n<div class=\"numbers\">\n",
      name, kReportStyle, replay.all.epochs, site.anchors.size(),
      replay.dim == 2 ? "the plane" : "space",
      settings.follow ? "Each position is the next shot's prior."
                      : "Each position is solved on its own.");
  if (replay.all.scored > 0) {
    page += number(centimetres(replay.all.error.median), "median error");
    page += number(centimetres(replay.all.error.p95), "95 % are below");
  }
  page += number(fmt::format("{}", replay.all.solved),
                 fmt::format("of {} shots solved", replay.all.epochs));
  page += number(fmt::format("{}", found.repaired()), "repaired by whole waves");
  page += number(fmt::format("{}", found.ambiguous()), "ambiguous");
  page += number(fmt::format("{}", total(replay.all.rejected)), "refused");
  page += "</div>\n<div class=\"grid\">\n";
  if (!found.shots.empty()) {
    std::vector<ShotDot> lags;
    for (const ShotDetail& shot : found.shots) lags.push_back({shot.t, shot.lag, shot.ambiguous});
    page += "<div class=\"column\">\n" + figure(map_figure(replay, site.anchors));
    if (replay.dim == 3) page += figure(height_figure(replay));
    page += "</div>\n<div class=\"column\">\n";
    page += figure(lag_figure(lags, settings.max_lag * found.wave));
    page += figure(repair_figure(found.repairs()));
    if (replay.all.scored > 0) page += figure(distribution_figure(replay));
    page += "</div>\n";
  }
  std::string refused;
  for (const auto* counts : {&replay.all.rejected, &replay.refused_readings}) {
    for (const auto& [reason, count] : *counts) {
      refused += fmt::format("<tr><td class=\"words\">{}</td><td>{}</td></tr>\n",
                             escaped(reason_words(reason)), count);
    }
  }
  if (!refused.empty()) {
    page += card("Refused shots and arrivals",
                 "<div class=\"scroll\"><table><tr><th>reason</th><th>how many</th></tr>\n" +
                     refused + "</table></div>");
  }
  return page + fmt::format(
                    "</div>\n<footer>Written by uwbpos {}. The same numbers, for programs: "
                    "summary.json; the positions: track.tum.</footer>\n</main>\n</body>\n</html>\n",
                    kVersion);
}

int run_ultrasonic(const UltrasonicSettings& settings) {
  Problems problems{settings.common.strict};
  make_directory(settings.common.out);
  Site site;
  site.anchors = read_anchors(settings.common.anchors, problems);
  if (site.anchors.empty()) {
    throw Failure{
        fmt::format("{}: expected receivers, found none", settings.common.anchors.string())};
  }
  if (!settings.common.truth.empty()) {
    site.truth = read_trajectory(settings.common.truth, problems);
  }
  const Log<Arrival> log = read_ultrasonic(settings.shots, problems);
  problems.tell_rest();
  const UltrasonicReplay found = replay_ultrasonic(settings, site, log.rows);
  fmt::print("{}", ultrasonic_table(found));
  const std::filesystem::path& out = settings.common.out;
  write_file(out / "summary.json", ultrasonic_summary(found, problems));
  write_file(out / "track.tum", track_tum(found.replay, std::nullopt));
  write_file(out / "report.html", ultrasonic_report(settings, site, found));
  fmt::print("wrote summary.json, track.tum and the report to open: {}\n",
             (out / "report.html").string());
  if (found.replay.all.solved == 0) {
    throw Failure{fmt::format("{}: no shot could be solved", settings.shots.string())};
  }
  return kSuccess;
}

}  // namespace uwbpos::host
