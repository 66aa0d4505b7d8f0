// SPDX-License-Identifier: MIT
#include "pose_remarks.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "uwbpos/model/lever_arm.hpp"
#include "uwbpos/solve/pose_options.hpp"

#include "reasons.hpp"
#include "recording.hpp"
#include "statistics.hpp"

namespace uwbpos::host {
namespace {

// Why tags with lever arms gave no pose, where that needs saying.
std::optional<std::string> why_no_pose(const Site& site, const Replay& replay) {
  std::set<Id> heard;
  for (const auto& [tag, outcome] : replay.of_tag) {
    if (site.tags.contains(tag)) heard.insert(tag);
  }
  if (site.tags.size() < 2) return std::nullopt;
  if (replay.never_together) {
    return "No epoch holds ranges of two tags that give a pose: positions are those of the tags.";
  }
  if (heard.size() == 1) {
    return fmt::format(
        "Of the {} tags of the tags file only tag {} was heard, and a heading takes two: positions "
        "are those of the tag.",
        site.tags.size(), *heard.begin());
  }
  if (heard.size() > 1 && !replay.of_differences) {
    return "The lever arms of the tags heard are one place in plan, which has no heading: "
           "positions "
           "are those of the tags.";
  }
  return std::nullopt;
}

}  // namespace

std::optional<TagDistance> oddest_tag_distance(const Points& tags, const Body& body,
                                               const std::vector<Position>& track) {
  constexpr double together = 0.06;  // [s]
  constexpr std::size_t fewest = 10;
  std::map<std::pair<Id, Id>, std::vector<double>> distances;
  auto next = track.begin();
  std::map<Id, const Position*> latest;
  for (const SolvedPose& pose : body.track) {
    for (; next != track.end() && next->t <= pose.t + together; ++next) {
      if (tags.contains(next->tag)) latest[next->tag] = &*next;
    }
    const Turn<double> turn = turn_of(pose.pose.heading);
    for (auto i = latest.begin(); i != latest.end(); ++i) {
      for (auto j = std::next(i); j != latest.end(); ++j) {
        if (std::min(i->second->t, j->second->t) < pose.t - together) continue;
        const Vec<double, 2> arm = (tags.at(j->first) - tags.at(i->first)).head<2>();
        const Vec<double, 2> across = (j->second->position - i->second->position).head<2>();
        if (!(arm.norm() > 0)) continue;
        const Vec<double, 2> direction = turned<double, 2>(turn, arm) / arm.norm();
        distances[{i->first, j->first}].push_back(across.dot(direction));
      }
    }
  }
  std::optional<TagDistance> oddest;
  double greatest = 0;
  for (auto& [pair, values] : distances) {
    if (values.size() < fewest) continue;
    const double given = (tags.at(pair.first) - tags.at(pair.second)).head<2>().norm();
    const double measured = median(std::move(values));
    const double odd = std::abs(measured - given) / std::max(std::min(measured, given), 1e-3);
    if (odd < greatest) continue;
    greatest = odd;
    oddest = {pair.first, pair.second, measured, given};
  }
  return oddest;
}

std::optional<std::string> arm_remark(const Site& site) {
  double apart = 0;
  for (const auto& [first, a] : site.anchors) {
    for (const auto& [second, b] : site.anchors) apart = std::max(apart, (a - b).norm());
  }
  std::optional<Id> longest;
  double length = apart;
  for (const auto& [tag, arm] : site.tags) {
    if (!(arm.norm() > length)) continue;
    longest = tag;
    length = arm.norm();
  }
  if (!longest) return std::nullopt;
  return fmt::format(
      "The lever arm of tag {} is {:.4g} m long, and the anchors are {:.4g} m apart at most: the "
      "tags file has metres from the body's origin.",
      *longest, length, apart);
}

std::optional<std::string> twist_remark(const Body& body, double span) {
  if (!twists_of(body, span).empty()) return std::nullopt;
  if (body.track.size() < 2) {
    return fmt::format("No twist: it takes two poses, and there is {}.",
                       body.track.empty() ? "none" : "one");
  }
  const double lasts = body.track.back().t - body.track.front().t;
  if (lasts < span) {
    return fmt::format(
        "No twist: --velocity asks for poses {:g} s apart, and all are within {:g} s.", span,
        lasts);
  }
  double shortest = lasts;
  for (std::size_t i = 1; i < body.track.size(); ++i) {
    const double step = body.track[i].t - body.track[i - 1].t;
    if (step > 0) shortest = std::min(shortest, step);
  }
  return fmt::format(
      "No twist: --velocity asks for poses {:g} to {:g} s apart, and there are none; the nearest "
      "are {:g} s apart.",
      span, 2 * span, shortest);
}

std::optional<std::string> target_remark(const Body& body, const Vec<double, 2>& target) {
  Counts reasons;
  for (const SolvedPose& p : body.track) {
    const auto seen = bearing_to(in_plan(p.pose), target);
    if (!seen) ++reasons[std::string{reason_name(seen.error())}];
  }
  if (reasons.empty()) return std::nullopt;
  std::vector<std::string> parts;
  for (const auto& [name, count] : reasons) {
    parts.push_back(fmt::format("{} of {}: {}", count, count_of(body.track.size(), "pose"),
                                reason_words(name)));
  }
  return fmt::format("The target at ({:g}, {:g}) m has no distance and bearing from {}.",
                     target.x(), target.y(), fmt::join(parts, ", "));
}

double misfit_of(const Body& body) {
  std::vector<double> ratios;
  for (const SolvedPose& p : body.track) {
    if (p.degrees_of_freedom > 0) ratios.push_back(p.chi_squared / p.degrees_of_freedom);
  }
  return ratios.empty() ? 0 : median(std::move(ratios));
}

std::vector<std::string> pose_remarks(const Site& site, const Replay& replay) {
  std::vector<std::string> said;
  if (const auto arm = arm_remark(site)) said.push_back(*arm);
  if (!replay.body) {
    if (const auto why = why_no_pose(site, replay)) said.push_back(*why);
    return said;
  }
  const Body& body = *replay.body;
  if (body.chosen_by_prior > 0) {
    said.push_back(fmt::format("{} settled between two poses by the body's last position.",
                               count_of(body.chosen_by_prior, "epoch")));
  }
  // χ² of sound input is its degrees of freedom; a sigma half too small doubles it and more.
  constexpr double sound = 3;
  const double misfit = misfit_of(body);
  if (misfit > sound) {
    said.push_back(fmt::format(
        "The ranges fit the poses {:.1f} times worse than their sigma says: biases of the links, a "
        "sigma too small, or lever arms that are not the tags'.",
        std::sqrt(misfit)));
  }
  // Biases of lias's links, twice the noise, make this a quarter.
  constexpr double odd = 0.4;
  const auto pair = oddest_tag_distance(site.tags, body, replay.track);
  const bool at_odds = pair && std::abs(pair->measured - pair->given) >
                                   odd * std::max(std::min(pair->measured, pair->given), 0.1);
  if (at_odds) {
    said.push_back(
        fmt::format("By their own positions tags {} and {} are {:.2f} m apart, by the tags file "
                    "{:.2f} m: lever "
                    "arms that are not the tags', or biases as large.",
                    pair->first, pair->second, pair->measured, pair->given));
  }
  const auto parts = parts_of_heading_error(body);
  if (parts && parts->slow > parts->noise / 2) {
    said.push_back(fmt::format(
        "Headings are off by {:.1f}° rms that change from epoch to epoch, which is noise, and by "
        "{:.1f}° that do not: {}.",
        radians_to_degrees(parts->noise), radians_to_degrees(parts->slow),
        at_odds             ? "the distance of those tags says why, perhaps"
        : site.bias.empty() ? "biases of the links, if arms and truth are right; uwbpos calibrate "
                              "finds their constant part"
                            : "what a constant for each link cannot take away, such as a bias that "
                              "depends on the way the body looks"));
  }
  return said;
}

}  // namespace uwbpos::host
