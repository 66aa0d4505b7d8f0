// SPDX-License-Identifier: MIT
#include "commands.hpp"

#include <cmath>
#include <set>

#include <fmt/format.h>

#include "calibrate.hpp"
#include "command_line.hpp"
#include "diagnosis.hpp"
#include "failure.hpp"
#include "filtering.hpp"
#include "network_bias.hpp"
#include "output.hpp"
#include "pose_remarks.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "summary.hpp"
#include "tdoa.hpp"

namespace uwbpos::host {
namespace {

void print_remarks(const std::vector<std::string>& said) {
  for (const std::string& sentence : said) fmt::print("{}\n", sentence);
}

void write_tracks(const std::filesystem::path& directory, const Replay& result) {
  write_file(directory / "track.tum",
             result.body ? poses_tum(*result.body) : track_tum(result, std::nullopt));
  if (result.of_tag.size() < 2) return;
  for (const auto& [tag, outcome] : result.of_tag) {
    write_file(directory / fmt::format("track_tag_{}.tum", tag), track_tum(result, tag));
  }
}

// What was asked for beside positions, and is a matter of poses.
void write_motion(const Settings& settings, const Replay& result) {
  if (!settings.velocity && !settings.target) return;
  if (!result.body) {
    throw Failure{fmt::format(
        "{} needs poses: --tags with two or more lever arms, and their ranges in one log",
        settings.target ? "target" : "--velocity")};
  }
  if (settings.velocity) {
    const std::vector<BodyTwist> twists = twists_of(*result.body, *settings.velocity);
    write_file(settings.out / "twists.csv", twists_csv(twists));
    fmt::print("{}, over {:g} s each: twists.csv\n", count_of(twists.size(), "twist"),
               *settings.velocity);
    if (const auto why = twist_remark(*result.body, *settings.velocity)) print_remarks({*why});
  }
  if (settings.target) {
    const std::vector<SeenTarget> seen = targets_seen(*result.body, *settings.target);
    write_file(settings.out / "target.csv", target_csv(seen));
    const auto unseen = target_remark(*result.body, *settings.target);
    if (unseen && seen.empty()) throw Failure{*unseen};
    fmt::print("{}\n", target_table(seen, *settings.target));
    if (unseen) print_remarks({*unseen});
  }
}

// What might help when no epoch could be solved.
std::string advice(const Settings& settings, const Replay& result) {
  const Counts& rejected = result.all.rejected;
  if (result.all.epochs == 0 && !settings.only_tags.empty()) {
    return "; the log has no usable reading of the tags asked for";
  }
  if (result.all.epochs == 0 && !result.unknown_anchors.empty()) {
    return "; no reading comes from an anchor of the anchors file";
  }
  if (rejected.contains("ambiguous_solution")) {
    return "; give --side, --prior or --height to choose between mirror images";
  }
  if (rejected.contains("too_few_measurements")) {
    return "; epochs have too few readings, try a longer --epoch-window or --height";
  }
  return "";
}

}  // namespace

int run_replay(const Settings& settings) {
  Problems problems{settings.strict};
  make_directory(settings.out);
  const Recording recording = read_recording(settings, problems);
  problems.tell_rest();
  const bool ranges_scored = recording.ranging && !recording.ranging->scored.empty();
  if (recording.ranging) fmt::print("{}\n", range_table(recording));
  if (recording.site.anchors.empty() && !ranges_scored) {
    throw Failure{
        fmt::format("{}: without --anchors, expected a column true_range_m to compare "
                    "ranges with",
                    recording.log.string())};
  }

  Replay result;
  if (!recording.site.anchors.empty()) {
    Progress progress{"solving"};
    const auto told = [&](std::size_t done, std::size_t of) { progress(done, of); };
    const Site& site = recording.site;
    if (settings.filter) {
      result = replay_filtered(settings, recording, told);
    } else if (site.network && !site.attitude.empty()) {
      result = recording.differences.empty()
                   ? replay_with_network(settings, site, recording.readings, told)
                   : replay_with_network(settings, site, recording.differences, told);
    } else {
      result = recording.differences.empty()
                   ? replay(settings, site, recording.readings, told)
                   : replay_differences(settings, site, recording.differences, told);
    }
  }
  const bool tried = result.all.epochs > 0;
  if (tried) fmt::print("{}", summary_table(settings, recording, result));
  for (const std::string& sentence : diagnose(result, anchor_qualities(result))) {
    fmt::print("{}\n", sentence);
  }
  const std::vector<std::string> said = remarks(recording, result, problems);
  print_remarks(said);

  write_file(settings.out / "summary.json",
             summary_json(settings, recording, tried ? &result : nullptr, problems));
  if (tried) write_tracks(settings.out, result);
  const std::filesystem::path report = settings.out / "report.html";
  write_file(report, report_html(settings, recording, result, said));
  fmt::print("wrote summary.json{} and the report to open: {}\n", tried ? ", track.tum" : "",
             report.string());
  if (tried) write_motion(settings, result);
  if (result.all.solved == 0 && !ranges_scored) {
    throw Failure{fmt::format("{}: nothing could be solved{}", recording.log.string(),
                              advice(settings, result))};
  }
  return kSuccess;
}

int run_calibrate(const Settings& settings) {
  Problems problems{settings.strict};
  make_directory(settings.out);
  const Recording recording = read_recording(settings, problems);
  problems.tell_rest();
  const Replay compared = compare_with_truth(settings, recording.site, recording.readings);
  const std::vector<LinkBias> biases = calibrate(compared);
  if (biases.empty()) {
    throw Failure{
        fmt::format("{}: no range can be compared with the truth; expected readings of "
                    "known anchors and tags within its time span",
                    recording.log.string())};
  }
  fmt::print("{}", calibration_table(biases));
  print_remarks(remarks(recording, compared, problems));
  const std::filesystem::path file = settings.out / "bias.csv";
  write_file(file, bias_csv(biases));
  fmt::print("wrote {}; use it with: uwbpos replay --bias {} …\n", file.string(), file.string());
  return kSuccess;
}

}  // namespace uwbpos::host
