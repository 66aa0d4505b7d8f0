// SPDX-License-Identifier: MIT
#include "summary.hpp"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace uwbpos::host {
namespace {

using Json = nlohmann::ordered_json;

Json json_of(const ErrorSummary& error) {
  return {{"rmse", error.rmse}, {"mean", error.mean}, {"median", error.median},
          {"p95", error.p95},   {"max", error.max},   {"rmse_xy", error.rmse_xy}};
}

Json json_of(const SampleSummary& s) {
  return {{"count", s.count},   {"mean", s.mean}, {"median", s.median},
          {"spread", s.spread}, {"rms", s.rms},   {"beyond_0.6_m", s.outlier_share}};
}

Json json_of(const RangeScore& score) {
  Json json = json_of(score.ours);
  if (score.spread_at_one_distance) {
    json["spread_at_one_distance"] = *score.spread_at_one_distance;
  }
  if (score.logged) {
    json["logged"] = json_of(*score.logged);
    if (score.logged_spread_at_one_distance) {
      json["logged"]["spread_at_one_distance"] = *score.logged_spread_at_one_distance;
    }
  }
  if (score.uncorrected) json["uncorrected"] = json_of(*score.uncorrected);
  return json;
}

// Angles in degrees.
Json degrees_of(const ErrorSummary& error) {
  return {{"rmse", radians_to_degrees(error.rmse)},
          {"mean", radians_to_degrees(error.mean)},
          {"median", radians_to_degrees(error.median)},
          {"p95", radians_to_degrees(error.p95)},
          {"max", radians_to_degrees(error.max)}};
}

Json json_of(const Counts& counts) {
  Json json = Json::object();
  for (const auto& [reason, count] : counts) json[reason] = count;
  return json;
}

Json json_of(const std::map<Id, std::size_t>& counts) {
  Json json = Json::object();
  for (const auto& [id, count] : counts) json[std::to_string(id)] = count;
  return json;
}

void add_outcome(Json& json, const Outcome& outcome) {
  json["epochs"] = outcome.epochs;
  json["solved"] = outcome.solved;
  json["rejected"] = json_of(outcome.rejected);
  if (outcome.scored > 0) {
    json["scored"] = outcome.scored;
    json["error_m"] = json_of(outcome.error);
  }
}

Json json_of(const std::vector<Interruption>& interruptions) {
  Json json = Json::array();
  for (const Interruption& i : interruptions) {
    json.push_back({{"t_s", i.t}, {"tag_id", i.tag}, {"cause", i.cause}, {"without_s", i.silent}});
    json.back()["recovery_s"] = i.recovery ? Json(*i.recovery) : Json(nullptr);
    if (!i.usual_error) continue;
    json.back()["recovery_by_truth_s"] = i.true_recovery ? Json(*i.true_recovery) : Json(nullptr);
    json.back()["usual_error_m"] = *i.usual_error;
  }
  return json;
}

std::map<std::pair<Id, Id>, std::vector<ScoredRange>> by_link(const Ranging& ranging) {
  std::map<std::pair<Id, Id>, std::vector<ScoredRange>> links;
  for (const ScoredRange& range : ranging.scored) links[{range.tag, range.anchor}].push_back(range);
  return links;
}

Json json_of(const Ranging& ranging) {
  Json json{{"exchanges", ranging.exchanges},
            {"ranged", ranging.readings.size()},
            {"double_sided", ranging.double_sided},
            {"single_sided_logged_offset", ranging.single_sided_logged},
            {"single_sided_tracked_offset", ranging.single_sided_tracked},
            {"refused", json_of(ranging.refused)},
            {"counter_bits", ranging.counter_bits}};
  if (ranging.scored.empty()) return json;
  json["error_m"] = json_of(score_ranges(ranging.scored));
  Json links = Json::array();
  for (const auto& [link, ranges] : by_link(ranging)) {
    links.push_back({{"tag_id", link.first},
                     {"anchor_id", link.second},
                     {"error_m", json_of(score_ranges(ranges))}});
  }
  json["links"] = links;
  return json;
}

std::string metres_cell(double value) {
  return std::isfinite(value) ? fmt::format("{:.3f}", value) : std::string{"-"};
}

std::string error_row(std::string_view name, const Outcome& outcome, int dim) {
  std::string row = fmt::format("{:<10}{:>9}{:>9}", name, outcome.epochs, outcome.solved);
  if (outcome.scored == 0) return row + '\n';
  const ErrorSummary& e = outcome.error;
  row += fmt::format("{:>9}{:>9}{:>9}{:>9}{:>9}", metres_cell(e.rmse), metres_cell(e.mean),
                     metres_cell(e.median), metres_cell(e.p95), metres_cell(e.max));
  if (dim == 3) row += fmt::format("{:>9}", metres_cell(e.rmse_xy));
  return row + '\n';
}

std::string body_rows(const Body& body, int dim) {
  std::string text = error_row("body", outcome_of(body), dim);
  if (body.heading_error.count == 0) return text;
  const ErrorSummary& e = body.heading_error;
  text += fmt::format("{:<10}{:>18}", "heading", "");
  for (const double value : {e.rmse, e.mean, e.median, e.p95, e.max}) {
    text += fmt::format("{:>9.2f}", radians_to_degrees(value));
  }
  return text + "   error [deg]\n";
}

// Solves in a second, of what was scored: poses where there are any.
double rate_of(const Replay& replay) {
  const double seconds = replay.body ? replay.body->solve_seconds : replay.solve_seconds;
  const std::size_t calls = replay.body ? replay.body->solve_calls : replay.solve_calls;
  return seconds > 0 ? static_cast<double>(calls) / seconds : 0;
}

std::string range_row(std::string_view name, const SampleSummary& s) {
  return fmt::format("{:<34}{:>8}{:>9.3f}{:>9.3f}{:>9.3f}{:>9.1f} %\n", name, s.count, s.median,
                     s.spread, s.mean, 100 * s.outlier_share);
}

}  // namespace

std::string summary_json(const Settings& settings, const Recording& recording, const Replay* replay,
                         const Problems& problems) {
  Json json;
  if (replay != nullptr) {
    const Body* body = replay->body ? &*replay->body : nullptr;
    add_outcome(json, body != nullptr ? outcome_of(*body) : replay->all);
    if (body != nullptr && body->heading_error.count > 0) {
      json["heading_error_deg"] = degrees_of(body->heading_error);
    }
    json["solves_per_second"] = rate_of(*replay);
    if (body != nullptr && settings.velocity) {
      const auto twists = twists_of(*body, *settings.velocity);
      const TwistErrors errors = summarize_twists(twists);
      json["velocity"] = {{"span_s", *settings.velocity}, {"twists", twists.size()}};
      if (errors.count > 0) {
        json["velocity"]["velocity_error_mps"] = errors.velocity;
        json["velocity"]["turn_rate_error_degps"] = radians_to_degrees(errors.turn_rate);
      }
    }
    if (replay->filtering) {
      const Filtering& f = *replay->filtering;
      double sum = 0;
      for (const Innovated& i : f.innovations) sum += i.normalised;
      Json of_anchor = Json::object();
      for (const auto& [id, tally] : f.of_anchor) {
        of_anchor[std::to_string(id)] = {{"used", tally.used}, {"refused", tally.refused}};
      }
      json["filter"] = {{"motion", f.motion},
                        {"used", f.used},
                        {"refused", json_of(f.refused)},
                        {"of_anchor", of_anchor},
                        {"guilty_anchors", guilty_anchors(f)},
                        {"reopened", f.reopened},
                        {"interruptions", json_of(f.interruptions)},
                        {"inertial_samples", f.samples},
                        {"inertial_epochs", f.inertial_epochs}};
      if (f.first_pose_after) json["filter"]["first_pose_after_s"] = *f.first_pose_after;
      if (std::isfinite(slowest_recovery(f))) {
        json["filter"]["slowest_recovery_s"] = slowest_recovery(f);
      }
      if (const auto truly = slowest_true_recovery(f); truly && std::isfinite(*truly)) {
        json["filter"]["slowest_recovery_by_truth_s"] = *truly;
      }
      if (f.settled_rmse) json["filter"]["settled_rmse_m"] = *f.settled_rmse;
      if (f.mean_nees) json["filter"]["mean_nees"] = *f.mean_nees;
      if (!f.innovations.empty()) {
        json["filter"]["mean_nis"] = sum / static_cast<double>(f.innovations.size());
      }
    }
    if (replay->of_tag.size() > 1) {
      Json tags = Json::object();
      for (const auto& [tag, outcome] : replay->of_tag) {
        Json of_tag;
        add_outcome(of_tag, outcome);
        tags[std::to_string(tag)] = of_tag;
      }
      json["tags"] = tags;
    }
    json["dim"] = replay->dim;
    json["epoch_window_s"] = body != nullptr ? body->rule.window : replay->rule.window;
    json["mirror_images_settled_by_prior"] =
        body != nullptr ? body->chosen_by_prior : replay->chosen_by_prior;
    json["unknown_anchors"] = json_of(replay->unknown_anchors);
    json["unknown_tags"] = json_of(replay->unknown_tags);
    json["refused_readings"] = json_of(replay->refused_readings);
    json["duplicate_readings"] = replay->duplicates;
    json["outside_truth"] = body != nullptr ? body->outside_truth : replay->outside_truth;
    if (replay->of_differences) {
      json["excluded_differences"] = replay->excluded;
      json["excluded_differences_of_anchor"] = json_of(replay->excluded_of_anchor);
      json["fused_epochs"] = replay->fused;
      json["inconsistent_epochs"] = replay->inconsistent;
      if (replay->found_sigma) json["found_sigma_m"] = *replay->found_sigma;
    }
  } else {
    json["epochs"] = 0;
    json["solved"] = 0;
    json["rejected"] = Json::object();
    json["solves_per_second"] = 0.0;
  }
  if (settings.height) json["height_m"] = *settings.height;
  if (recording.ranging) json["ranges"] = json_of(*recording.ranging);
  Json malformed = Json::object();
  for (const auto& [file, count] : problems.counts()) malformed[file] = count;
  json["input"] = {{"log", recording.log.string()},
                   {"rows", recording.counts.rows},
                   {"rows_without_reading", recording.counts.no_reading},
                   {"rows_out_of_order", recording.counts.out_of_order},
                   {"seconds", recording.seconds},
                   {"malformed_rows", malformed}};
  constexpr int indent = 2;
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + '\n';
}

std::string track_tum(const Replay& replay, std::optional<Id> tag) {
  std::string text = "# t_s x_m y_m z_m qx qy qz qw\n";
  for (const Position& p : replay.track) {
    if (tag && p.tag != *tag) continue;
    fmt::format_to(std::back_inserter(text), "{:.6f} {:.6f} {:.6f} {:.6f} 0 0 0 1\n", p.t,
                   p.position.x(), p.position.y(), p.position.z());
  }
  return text;
}

std::string summary_table(const Settings& settings, const Recording& recording,
                          const Replay& replay) {
  const std::string where = replay.dim == 3 ? "in space"
                            : settings.height
                                ? fmt::format("in the plane, tags {:g} m high", *settings.height)
                                : "in the plane, heights left out";
  const std::string grouped = replay.rule.window > 0
                                  ? fmt::format("an epoch lasts up to {:.4g} s", replay.rule.window)
                                  : std::string{"an epoch is one time stamp"};
  std::string text = fmt::format("{}: {}, {:.6g} s, {}; solved {}; {}\n\n", recording.log.string(),
                                 reading_count(recording), recording.seconds,
                                 count_of(recording.site.anchors.size(), "anchor"), where, grouped);
  text += fmt::format("{:<10}{:>9}{:>9}", "", "epochs", "solved");
  if (replay.all.scored > 0) {
    text += fmt::format("{:>9}{:>9}{:>9}{:>9}{:>9}", "rmse", "mean", "median", "p95", "max");
    if (replay.dim == 3) text += fmt::format("{:>9}", "rmse xy");
    text += "   error [m]";
  }
  text += '\n';
  if (replay.of_tag.size() > 1) {
    for (const auto& [tag, outcome] : replay.of_tag) {
      text += error_row(fmt::format("tag {}", tag), outcome, replay.dim);
    }
  }
  text += error_row(replay.of_tag.size() == 1 ? fmt::format("tag {}", replay.of_tag.begin()->first)
                                              : std::string{"all tags"},
                    replay.all, replay.dim);
  if (replay.body) text += body_rows(*replay.body, replay.dim);
  for (const auto& [reason, count] : replay.body ? replay.body->rejected : replay.all.rejected) {
    text += fmt::format("{} rejected: {}\n", count_of(count, "epoch"), reason_words(reason));
  }
  if (replay.filtering) {
    constexpr std::size_t most = 8;
    const auto& all = replay.filtering->interruptions;
    for (std::size_t i = 0; i < all.size() && i < most; ++i) {
      text += fmt::format("interrupted {}\n", words_of(all[i], replay.of_tag.size() > 1));
    }
    if (all.size() > most) {
      text += fmt::format("… and {} more times; summary.json has them\n", all.size() - most);
    }
  }
  if (rate_of(replay) > 0) {
    text += fmt::format("{:.0f} {} per second\n", rate_of(replay),
                        replay.filtering ? "measurements" : "solves");
  }
  return text;
}

std::string range_table(const Recording& recording) {
  const Ranging& ranging = *recording.ranging;
  std::string text = fmt::format(
      "{}: {}, {}-bit counters: {} double-sided, {} single-sided with logged clock offset, {} with "
      "tracked clock offset, {} refused\n",
      recording.log.string(), count_of(ranging.exchanges, "exchange"), ranging.counter_bits,
      ranging.double_sided, ranging.single_sided_logged, ranging.single_sided_tracked,
      total(ranging.refused));
  if (ranging.scored.empty()) return text;
  const RangeScore score = score_ranges(ranging.scored);
  text += fmt::format("\n{:<34}{:>8}{:>9}{:>9}{:>9}{:>11}\n", "range error [m]", "ranges", "median",
                      "spread", "mean", "> 0.6 m");
  text += range_row("as ranged here", score.ours);
  if (score.logged) text += range_row("as the module logged", *score.logged);
  if (score.uncorrected) {
    text += range_row("single-sided, clocks not corrected", *score.uncorrected);
  }
  if (score.spread_at_one_distance) {
    text += fmt::format("spread at one distance, averaged over distances: {:.3f} m here",
                        *score.spread_at_one_distance);
    if (score.logged_spread_at_one_distance) {
      text += fmt::format(", {:.3f} m as the module logged", *score.logged_spread_at_one_distance);
    }
    text += '\n';
  }
  constexpr std::size_t most = 8;
  const auto links = by_link(ranging);
  if (links.size() > most) {
    return text + fmt::format("{} links; summary.json has each of them\n", links.size());
  }
  for (const auto& [link, ranges] : links) {
    if (links.size() == 1) break;
    text += range_row(fmt::format("tag {} to anchor {}", link.first, link.second),
                      score_ranges(ranges).ours);
  }
  return text;
}

}  // namespace uwbpos::host
