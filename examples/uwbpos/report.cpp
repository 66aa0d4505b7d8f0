// SPDX-License-Identifier: MIT
#include "report.hpp"

#include <cmath>

#include <fmt/format.h>

#include "uwbpos/core/version.hpp"

#include "diagnosis.hpp"
#include "plots.hpp"
#include "report_parts.hpp"
#include "report_style.hpp"

namespace uwbpos::host {
namespace {

std::string metres(double value) {
  if (!std::isfinite(value)) return "–";
  if (std::abs(value) < 0.9995) return fmt::format("{:.1f} cm", 100 * value);
  return fmt::format("{:.2f} m", value);
}

std::string degrees(double radians) {
  if (!std::isfinite(radians)) return "–";
  return fmt::format("{:.1f}°", radians_to_degrees(radians));
}

std::string thousands(double value) {
  if (value >= 1e6) return fmt::format("{:.2g} M", value / 1e6);
  if (value >= 1e4) return fmt::format("{:.0f} 000", value / 1e3);
  return fmt::format("{:.0f}", value);
}

std::string list(const std::vector<std::string>& sentences) {
  std::string text = "<ul>";
  for (const std::string& sentence : sentences) {
    text += fmt::format("<li>{}</li>", escaped(sentence));
  }
  return text + "</ul>";
}

// The headline numbers.
std::string numbers(const Replay& replay) {
  const Outcome all = replay.body ? outcome_of(*replay.body) : replay.all;
  const bool eight = all.scored > 0 && (replay.dim == 3 || replay.body);
  std::string text = eight ? "<div class=\"numbers two-rows\">\n" : "<div class=\"numbers\">\n";
  if (all.scored > 0) {
    const ErrorSummary& e = all.error;
    text += number(metres(e.rmse), replay.dim == 3 ? "rmse in space" : "rmse in the plane", true);
    if (replay.dim == 3) text += number(metres(e.rmse_xy), "rmse in the plane");
    text += number(metres(e.median), "median error");
    text += number(metres(e.p95), "95 % are below");
    text += number(metres(e.max), "largest error");
    if (replay.body && replay.body->heading_error.count > 0) {
      text += number(degrees(replay.body->heading_error.rmse), "rmse of the heading");
    }
  }
  const double share = 100 * static_cast<double>(all.solved) /
                       static_cast<double>(std::max<std::size_t>(all.epochs, 1));
  text += number(
      fmt::format("{}", all.solved),
      fmt::format("of {} epochs solved ({:.{}f} %)", all.epochs, share, share == 100 ? 0 : 1));
  text += number(fmt::format("{}", total(all.rejected)), "epochs rejected");
  const double seconds = replay.body ? replay.body->solve_seconds : replay.solve_seconds;
  const std::size_t calls = replay.body ? replay.body->solve_calls : replay.solve_calls;
  if (seconds > 0) {
    text += number(thousands(static_cast<double>(calls) / seconds),
                   replay.filtering ? "measurements per second" : "solves per second");
  }
  return text + "</div>\n";
}

std::string outcome_row(std::string_view name, const Outcome& outcome, bool scored, int dim) {
  std::string text =
      fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td>", name, outcome.epochs, outcome.solved);
  if (scored) {
    const ErrorSummary& e = outcome.error;
    for (const double value : {e.rmse, e.mean, e.median, e.p95, e.max}) {
      text += fmt::format("<td>{}</td>", outcome.scored > 0 ? metres(value) : "–");
    }
    if (dim == 3) text += fmt::format("<td>{}</td>", outcome.scored > 0 ? metres(e.rmse_xy) : "–");
  }
  return text + "</tr>\n";
}

std::string tag_table(const Replay& replay) {
  const bool scored = replay.all.scored > 0;
  std::string text = "<div class=\"scroll\"><table><tr><th></th><th>epochs</th><th>solved</th>";
  if (scored) {
    text += "<th>rmse</th><th>mean</th><th>median</th><th>95 %</th><th>largest</th>";
    if (replay.dim == 3) text += "<th>rmse xy</th>";
  }
  text += "</tr>\n";
  for (const auto& [tag, outcome] : replay.of_tag) {
    text += outcome_row(fmt::format("tag {}", tag), outcome, scored, replay.dim);
  }
  if (replay.of_tag.size() > 1) text += outcome_row("all", replay.all, scored, replay.dim);
  if (replay.body) {
    text += outcome_row("body", outcome_of(*replay.body), replay.body->scored > 0, replay.dim);
    if (replay.body->heading_error.count > 0) {
      const ErrorSummary& e = replay.body->heading_error;
      text += "<tr><td>heading</td><td></td><td></td>";
      for (const double value : {e.rmse, e.mean, e.median, e.p95, e.max}) {
        text += fmt::format("<td>{}</td>", degrees(value));
      }
      text += replay.dim == 3 ? "<td></td></tr>\n" : "</tr>\n";
    }
  }
  return text + "</table></div>";
}

std::string anchor_table(const std::vector<AnchorQuality>& worst_first,
                         const Filtering* filtering) {
  std::string text =
      "<div class=\"scroll\"><table><tr><th>anchor</th><th>readings</th><th>median</th>"
      "<th>spread</th><th>rms</th><th>outliers</th>";
  text += filtering != nullptr ? "<th>refused</th></tr>\n" : "</tr>\n";
  for (const AnchorQuality& q : worst_first) {
    text += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{:+.3f}</td><td>{:.3f}</td><td>{:.3f}</td>"
        "<td>{:.1f} %</td>",
        q.anchor, q.readings, q.bias, q.spread, q.rms, 100 * q.outlier_share);
    if (filtering != nullptr) {
      const auto tally = filtering->of_anchor.find(q.anchor);
      text += tally == filtering->of_anchor.end()
                  ? std::string{"<td>–</td>"}
                  : fmt::format("<td>{:.1f} %</td>", 100 * refused_share(tally->second));
    }
    text += "</tr>\n";
  }
  return text + "</table></div>";
}

std::string rejected_table(const Counts& rejected, std::string_view what) {
  std::string text =
      fmt::format("<div class=\"scroll\"><table><tr><th>reason</th><th>{}</th></tr>\n", what);
  for (const auto& [reason, count] : rejected) {
    text += fmt::format("<tr><td class=\"words\">{}</td><td>{}</td></tr>\n",
                        escaped(reason_words(reason)), count);
  }
  return text + "</table></div>";
}

// Two columns on a wide screen; on a narrow one the plots come before the words.
std::string findings(const Settings& settings, const Recording& recording, const Replay& replay) {
  const std::vector<AnchorQuality> worst_first = anchor_qualities(replay);
  const Replay view = drawn(replay);
  std::string left = figure(map_figure(view, recording.site.anchors, settings.target));
  std::string right;
  if (view.all.scored > 0) right = figure(time_figure(view)) + figure(distribution_figure(view));
  if (replay.filtering && !replay.filtering->innovations.empty()) {
    right += figure(nis_figure(view));
  }
  if (replay.dim == 3) left += figure(height_figure(view));
  if (replay.body) {
    if (replay.body->heading_error.count > 0) left += figure(heading_figure(*replay.body));
    if (settings.velocity) {
      const auto twists = twists_of(*replay.body, *settings.velocity);
      if (!twists.empty()) left += figure(twist_figure(twists));
    }
    if (settings.target) {
      const auto seen = targets_seen(*replay.body, *settings.target);
      if (!seen.empty()) left += figure(target_figure(seen));
    }
  }
  if (!worst_first.empty()) {
    right += figure(residual_figure(replay, worst_first));
    std::string verdict;
    for (const std::string& sentence : diagnose(replay, worst_first)) {
      verdict += fmt::format("<p class=\"{}\">{}</p>", verdict.empty() ? "verdict" : "reason",
                             escaped(sentence));
    }
    left +=
        card("Which anchor is the worst, and why",
             verdict + anchor_table(worst_first, replay.filtering ? &*replay.filtering : nullptr),
             "later");
  }
  return fmt::format("<div class=\"column\">\n{}</div>\n<div class=\"column\">\n{}</div>\n", left,
                     right) +
         card("Tags", tag_table(replay), "wide later");
}

std::string range_table_row(std::string_view name, const SampleSummary& s) {
  return fmt::format(
      "<tr><td>{}</td><td>{}</td><td>{:+.3f}</td><td>{:.3f}</td><td>{:+.3f}</td>"
      "<td>{:.1f} %</td></tr>\n",
      name, s.count, s.median, s.spread, s.mean, 100 * s.outlier_share);
}

// The headline numbers when ranges are all there is.
std::string range_numbers(const Ranging& ranging) {
  const SampleSummary s = score_ranges(ranging.scored).ours;
  return "<div class=\"numbers\">\n" + number(metres(s.median), "median error of a range", true) +
         number(metres(s.spread), "spread (robust)") + number(metres(s.mean), "mean error") +
         number(fmt::format("{:.2f} %", 100 * s.outlier_share), "off by more than 0.6 m") +
         number(fmt::format("{}", ranging.readings.size()),
                fmt::format("of {} exchanges ranged", ranging.exchanges)) +
         "</div>\n";
}

std::string range_section(const Ranging& ranging) {
  const RangeScore score = score_ranges(ranging.scored);
  std::string table =
      "<div class=\"scroll\"><table><tr><th>error [m]</th><th>ranges</th>"
      "<th>median</th><th>spread</th><th>mean</th><th>&gt; 0.6 m</th></tr>\n";
  table += range_table_row("ranged here", score.ours);
  if (score.logged) table += range_table_row("as the module logged", *score.logged);
  if (score.uncorrected) table += range_table_row("clocks not corrected", *score.uncorrected);
  table += "</table></div><p class=\"note\">Spread: 1.4826 × median absolute deviation.";
  if (score.spread_at_one_distance) {
    table += fmt::format(" At one distance, averaged over the distances, it is {:.3f} m here",
                         *score.spread_at_one_distance);
    if (score.logged_spread_at_one_distance) {
      table +=
          fmt::format(" and {:.3f} m as the module logged", *score.logged_spread_at_one_distance);
    }
    table += ": the rest is what differs between distances, such as received power.";
  }
  table += "</p>";
  return figure(range_error_figure(ranging.scored)) + card("Ranges against true distances", table);
}

std::string lead(const Settings& settings, const Recording& recording, const Replay& replay) {
  std::string text = reading_count(recording);
  if (recording.seconds > 0) text += fmt::format(" over {:.6g} s", recording.seconds);
  if (replay.all.epochs > 0) {
    text += fmt::format(", {}, {}", count_of(recording.site.anchors.size(), "anchor"),
                        count_of(replay.of_tag.size(), "tag"));
    text += replay.dim == 3 ? "; solved in space"
            : settings.height
                ? fmt::format("; solved in the plane, tags {:g} m high", *settings.height)
                : std::string{"; solved in the plane, heights left out"};
    text += replay.rule.window > 0 ? fmt::format(", epochs of up to {:.3g} s", replay.rule.window)
                                   : std::string{", one epoch per time stamp"};
    if (replay.body) text += "; poses of the body from all its tags at once";
    text += settings.bias.empty() ? "; no bias table" : "; link biases subtracted";
    if (settings.truth.empty()) text += "; no truth to compare with";
  }
  if (replay.all.epochs > 0) {
    if (replay.filtering) {
      return text + fmt::format(
                        ". Filtered over time, causally: each {} is what was known at the end of "
                        "its epoch. Motion: {}; how fast it changes and how noisy the radio is, "
                        "the recording tells.",
                        replay.body ? "pose" : "position", replay.filtering->motion);
    }
    return text + fmt::format(". Each {} is solved on its own: nothing is smoothed or filtered.",
                              replay.body ? "pose" : "position");
  }
  return text + ", compared with true distances.";
}

}  // namespace

std::string escaped(std::string_view text) {
  std::string result;
  bool code = false;
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      case '`':
        result += code ? "</code>" : "<code>";
        code = !code;
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string report_html(const Settings& settings, const Recording& recording, const Replay& replay,
                        const std::vector<std::string>& said) {
  const std::filesystem::path& log = recording.log;
  const std::string name =
      escaped((log.parent_path().filename() / log.filename()).generic_string());
  std::string page = fmt::format(
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta name=\"color-scheme\" content=\"light dark\">\n"
      "<title>uwbpos: {}</title>\n<style>{}</style>\n</head>\n<body>\n<main>\n<h1>{}</h1>\n"
      "<p class=\"lead\">{}</p>\n",
      name, kReportStyle, name, escaped(lead(settings, recording, replay)));
  const bool solved = replay.all.solved > 0;
  if (replay.all.epochs > 0) {
    page += numbers(replay);
  } else if (recording.ranging && !recording.ranging->scored.empty()) {
    page += range_numbers(*recording.ranging);
  }
  page += "<div class=\"grid\">\n";
  if (solved) page += findings(settings, recording, replay);
  if (recording.ranging && !recording.ranging->scored.empty()) {
    page += range_section(*recording.ranging);
  }
  if (replay.filtering && !replay.filtering->interruptions.empty()) {
    std::vector<std::string> sentences;
    for (const Interruption& i : replay.filtering->interruptions) {
      constexpr std::size_t most = 12;
      if (sentences.size() == most) {
        sentences.push_back(fmt::format("… {} in all; summary.json has each of them",
                                        replay.filtering->interruptions.size()));
        break;
      }
      sentences.push_back(words_of(i, replay.of_tag.size() > 1));
    }
    page += card("Interruptions and recovery", list(sentences));
  }
  if (replay.filtering && !replay.filtering->refused.empty()) {
    page += card("Refused measurements", rejected_table(replay.filtering->refused, "measurements"));
  }
  if (!replay.all.rejected.empty()) {
    page += card("Rejected epochs", rejected_table(replay.all.rejected, "epochs"));
  }
  if (recording.ranging && !recording.ranging->refused.empty()) {
    page += card("Refused exchanges", rejected_table(recording.ranging->refused, "exchanges"));
  }
  if (!said.empty()) page += card("About the input", list(said));
  page += fmt::format(
      "</div>\n<footer>Written by uwbpos {}. The same numbers, for programs: "
      "summary.json; the positions: track.tum.</footer>\n</main>\n</body>\n</html>\n",
      kVersion);
  return page;
}

}  // namespace uwbpos::host
