// SPDX-License-Identifier: MIT
#include "poses.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <numbers>

#include <fmt/format.h>

#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/solve/pose_from_ranges.hpp"

#include "replay.hpp"
#include "statistics.hpp"

namespace uwbpos::host {
namespace {

// The body's readings as those of one tag whose anchors are the links, so that they are grouped by
// the same rule as any tag's.
std::vector<Reading> as_links(const Site& site, const std::vector<Reading>& readings,
                              std::vector<std::pair<Id, Id>>& links) {
  std::map<std::pair<Id, Id>, Id> numbers;
  std::vector<Reading> result;
  result.reserve(readings.size());
  for (const Reading& reading : readings) {
    if (!site.tags.contains(reading.tag)) continue;
    const auto link = std::pair{reading.tag, reading.anchor};
    const auto [place, fresh] = numbers.try_emplace(link, static_cast<Id>(links.size()));
    if (fresh) links.push_back(link);
    result.push_back(reading);
    result.back().tag = 0;
    result.back().anchor = place->second;
  }
  return result;
}

// How the body's readings are grouped. A log that stamps whole rounds may stamp each tag's own:
// then an epoch is a round of all tags, and a tag that reports again ends it.
EpochRule body_rule(const std::vector<Reading>& of_links,
                    const std::vector<std::pair<Id, Id>>& links, std::optional<double> window) {
  const EpochRule rule = epoch_rule(of_links, window);
  if (window || rule.window > 0) return rule;
  std::map<Id, double> last;
  std::vector<Reading> rounds;
  for (const Reading& reading : of_links) {
    const Id tag = links[reading.anchor].first;
    const auto [place, fresh] = last.try_emplace(tag, reading.t);
    if (!fresh && place->second == reading.t) continue;
    place->second = reading.t;
    rounds.push_back(reading);
    rounds.back().anchor = tag;
  }
  return epoch_rule(rounds, window);
}

// Solves epochs one after the other. D = 2: heights are left out.
template <int D>
class PoseSolver {
 public:
  PoseSolver(const Settings& settings, const Site& site, int dim,
             const std::vector<std::pair<Id, Id>>& links, Body& body)
      : settings_{settings}, site_{site}, links_{links}, body_{body} {
    options_.robust.loss = settings.loss;
    if constexpr (D == 3) {
      if (dim == 2) {
        options_.height = Measured<double>{body_height(settings.height.value_or(0), site.tags), 0};
      } else if (settings.side != Side::kUnknown) {
        options_.side = upwards(settings.side);
      }
    }
  }

  void solve(const Epoch& epoch) {
    ranges_.clear();
    for (const Reading& reading : epoch.readings) {
      const auto& [tag, anchor] = links_[reading.anchor];
      ranges_.push_back({site_.tags.at(tag).head<D>(), site_.anchors.at(anchor).head<D>(),
                         reading.range,
                         reading.sigma.value_or(settings_.sigma.value_or(kRangeSigma))});
    }
    ++body_.epochs;
    bool by_prior = false;
    Result<PoseFix<double, D>> fix = timed_solve(options_);
    if (!fix && fix.error() == Error::AmbiguousSolution && (last_ || settings_.prior)) {
      PoseOptions<double, D> with_prior = options_;
      with_prior.prior = last_ ? *last_ : Vec<double, D>{settings_.prior->head<D>()};
      fix = timed_solve(with_prior);
      by_prior = true;
    }
    if (!fix) {
      ++body_.rejected[std::string{reason_name(fix.error())}];
      return;
    }
    if constexpr (D == 3) {
      if (site_.network && !without_network_bias(epoch, *fix)) {
        ++body_.rejected["bias_not_settled"];
        return;
      }
    }
    last_ = fix->pose.position;
    body_.chosen_by_prior += by_prior ? 1 : 0;
    body_.track.push_back({epoch.t, in_space(fix->pose), fix->chi_squared, fix->degrees_of_freedom,
                           static_cast<int>(ranges_.size()), by_prior, std::nullopt});
  }

 private:
  Result<PoseFix<double, D>> timed_solve(const PoseOptions<double, D>& options) {
    const auto start = std::chrono::steady_clock::now();
    Result<PoseFix<double, D>> fix = solve_pose(ranges_, options);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    body_.solve_seconds += taken.count();
    ++body_.solve_calls;
    return fix;
  }

  // Solves again with what the network says at the pose found taken off, until the pose stays.
  bool without_network_bias(const Epoch& epoch, PoseFix<double, D>& fix)
    requires(D == 3)
  {
    constexpr int most = 10;
    constexpr double settled = 1e-4;  // [m]
    for (int round = 0; round < most; ++round) {
      const Vec3 before = fix.pose.position;
      const double heading = fix.pose.heading;
      const Mat<double, 3> map_R_body = rotation_matrix(quaternion_from_yaw(heading));
      std::size_t unknown = 0;
      for (std::size_t i = 0; i < ranges_.size(); ++i) {
        const auto& [tag, anchor] = links_[epoch.readings[i].anchor];
        const Vec3 offset = ranges_[i].anchor - (before + map_R_body * ranges_[i].lever_arm);
        const auto bias = site_.network->bias(tag, anchor, offset, map_R_body);
        ranges_[i].range = epoch.readings[i].range - bias.value_or(0);
        unknown += bias ? 0 : 1;
      }
      PoseOptions<double, D> with_prior = options_;
      with_prior.prior = before;
      const auto next = timed_solve(with_prior);
      if (!next) return false;
      fix = *next;
      const double turned = std::abs(angle_difference(fix.pose.heading, heading));
      if ((fix.pose.position - before).norm() < settled && turned < settled) {
        body_.without_bias += unknown;
        return true;
      }
    }
    return false;
  }

  static LevelPose<double> in_space(const PoseOf<double, D>& pose) {
    if constexpr (D == 3) {
      return pose;
    } else {
      LevelPose<double> level{
          {pose.position.x(), pose.position.y(), 0}, pose.heading, Mat<double, 4>::Zero()};
      constexpr int to[3] = {0, 1, 3};
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) level.covariance(to[i], to[j]) = pose.covariance(i, j);
      }
      return level;
    }
  }

  const Settings& settings_;
  const Site& site_;
  const std::vector<std::pair<Id, Id>>& links_;
  Body& body_;
  PoseOptions<double, D> options_;
  std::vector<TagRange<double, D>> ranges_;
  std::optional<Vec<double, D>> last_;
};

Pose2<double> exact_pose(const StampedPose& pose) {
  return {pose.position.head<2>(), heading_of(pose.rotation), Mat<double, 3>::Zero()};
}

}  // namespace

void score_body(const Site& site, int dim, Body& body) {
  std::vector<Vec3> errors;
  std::vector<Vec3> turns;  // along x, so that the summary is that of lengths
  for (SolvedPose& p : body.track) {
    if (site.truth.empty()) break;
    p.truth = site.truth.at(p.t);
    if (!p.truth) {
      ++body.outside_truth;
      continue;
    }
    errors.emplace_back(p.pose.position - p.truth->position);
    if (!p.heading_known) continue;
    const double turn = angle_difference(p.pose.heading, heading_of(p.truth->rotation));
    turns.emplace_back(turn, 0, 0);
  }
  body.scored = errors.size();
  body.error = summarize_errors(errors, dim);
  body.heading_error = summarize_errors(turns, 2);
}

Outcome outcome_of(const Body& body) {
  return {body.epochs, body.track.size(), body.scored, body.rejected, body.error};
}

std::optional<HeadingParts> parts_of_heading_error(const Body& body) {
  constexpr std::size_t fewest = 50;
  if (body.heading_error.count < fewest) return std::nullopt;
  std::vector<double> steps;
  std::optional<double> last;
  for (const SolvedPose& p : body.track) {
    if (!p.truth || !p.heading_known) continue;
    const double error = angle_difference(p.pose.heading, heading_of(p.truth->rotation));
    if (last) steps.push_back(angle_difference(error, *last));
    last = error;
  }
  const double noise = robust_spread(steps) / std::numbers::sqrt2;
  const double rms = body.heading_error.rmse;
  return HeadingParts{noise, std::sqrt(std::max(rms * rms - noise * noise, 0.0))};
}

Rotation level_rotation(double heading) {
  return {0, 0, std::sin(heading / 2), std::cos(heading / 2)};
}

double heading_of(const Rotation& rotation) {
  const Vec3 forward = rotate(rotation, {1, 0, 0});
  return std::atan2(forward.y(), forward.x());
}

bool apart_in_plan(const Points& tags, const std::set<Id>& heard) {
  constexpr double apart = 1e-6;  // [m]
  const Vec3* first = nullptr;
  for (const auto& [id, arm] : tags) {
    if (!heard.contains(id)) continue;
    if (first == nullptr) first = &arm;
    if ((arm - *first).head<2>().norm() > apart) return true;
  }
  return false;
}

bool has_pose(const Site& site, const std::vector<Reading>& readings) {
  std::set<Id> heard;
  for (const Reading& reading : readings) heard.insert(reading.tag);
  return apart_in_plan(site.tags, heard);
}

std::vector<Epoch> body_epochs(const Site& site, const std::vector<Reading>& readings,
                               std::optional<double> window, std::vector<std::pair<Id, Id>>& links,
                               EpochRule& rule) {
  const std::vector<Reading> of_links = as_links(site, readings, links);
  rule = body_rule(of_links, links, window);
  return group_epochs(of_links, rule).epochs;
}

Body solve_poses(const Settings& settings, const Site& site, int dim,
                 const std::vector<Reading>& readings,
                 const std::function<void(std::size_t, std::size_t)>& progress) {
  Body body;
  std::vector<std::pair<Id, Id>> links;
  const std::vector<Epoch> epochs =
      body_epochs(site, readings, settings.epoch_window, links, body.rule);
  const auto solve_all = [&](auto solver) {
    for (std::size_t i = 0; i < epochs.size(); ++i) {
      if (progress && i % kProgressStep == 0) progress(i, epochs.size());
      solver.solve(epochs[i]);
    }
    if (progress) progress(epochs.size(), epochs.size());
  };
  if (dim == 2 && !settings.height) {
    solve_all(PoseSolver<2>{settings, site, dim, links, body});
  } else {
    solve_all(PoseSolver<3>{settings, site, dim, links, body});
  }
  std::ranges::stable_sort(body.track, {}, &SolvedPose::t);
  score_body(site, dim, body);
  return body;
}

std::vector<BodyTwist> twists_of(const Body& body, double span) {
  std::vector<BodyTwist> twists;
  auto second = body.track.begin();
  for (const SolvedPose& first : body.track) {
    while (second != body.track.end() && second->t - first.t < span - kTimeRounding) ++second;
    if (second == body.track.end()) break;
    const double dt = second->t - first.t;
    if (dt > 2 * span) continue;
    const auto twist = twist_between(in_plan(first.pose), in_plan(second->pose), dt);
    if (!twist) continue;
    twists.push_back({first.t + dt / 2, *twist, std::nullopt});
    if (!first.truth || !second->truth) continue;
    const auto truth = twist_between(exact_pose(*first.truth), exact_pose(*second->truth), dt);
    if (truth) twists.back().truth = *truth;
  }
  return twists;
}

TwistErrors summarize_twists(const std::vector<BodyTwist>& twists) {
  std::vector<double> velocity;
  std::vector<double> turn_rate;
  for (const BodyTwist& t : twists) {
    if (!t.truth) continue;
    velocity.push_back((t.twist.body_velocity - t.truth->body_velocity).norm());
    turn_rate.push_back(t.twist.turn_rate - t.truth->turn_rate);
  }
  return {velocity.size(), root_mean_square(velocity), root_mean_square(turn_rate)};
}

std::vector<SeenTarget> targets_seen(const Body& body, const Vec<double, 2>& target) {
  std::vector<SeenTarget> seen;
  for (const SolvedPose& p : body.track) {
    if (const auto at = bearing_to(in_plan(p.pose), target)) seen.push_back({p.t, *at});
  }
  return seen;
}

std::string poses_tum(const Body& body) {
  std::string text = "# t_s x_m y_m z_m qx qy qz qw\n";
  for (const SolvedPose& p : body.track) {
    const Vec3& at = p.pose.position;
    const Rotation q = p.attitude.value_or(level_rotation(p.pose.heading));
    fmt::format_to(std::back_inserter(text),
                   "{:.6f} {:.6f} {:.6f} {:.6f} {:.8g} {:.8g} {:.8f} {:.8f}\n", p.t, at.x(), at.y(),
                   at.z(), q.x, q.y, q.z, q.w);
  }
  return text;
}

std::string twists_csv(const std::vector<BodyTwist>& twists) {
  std::string text =
      "t_s,x_mps,y_mps,forward_mps,left_mps,turn_rate_radps,sigma_forward_mps,sigma_left_mps,"
      "sigma_turn_rate_radps\n";
  for (const auto& [t, twist, truth] : twists) {
    const auto sigma = [&](int i) { return std::sqrt(twist.body_covariance(i, i)); };
    fmt::format_to(std::back_inserter(text),
                   "{:.6f},{:.5f},{:.5f},{:.5f},{:.5f},{:.6f},{:.5f},{:.5f},{:.6f}\n", t,
                   twist.global_velocity.x(), twist.global_velocity.y(), twist.body_velocity.x(),
                   twist.body_velocity.y(), twist.turn_rate, sigma(0), sigma(1), sigma(2));
  }
  return text;
}

std::string target_csv(const std::vector<SeenTarget>& seen) {
  std::string text = "t_s,distance_m,bearing_deg,ahead,sigma_distance_m,sigma_bearing_deg\n";
  for (const auto& [t, target] : seen) {
    fmt::format_to(std::back_inserter(text), "{:.6f},{:.5f},{:.4f},{},{:.5f},{:.4f}\n", t,
                   target.distance, radians_to_degrees(target.bearing), target.ahead ? 1 : 0,
                   std::sqrt(target.distance_variance),
                   radians_to_degrees(std::sqrt(target.bearing_variance)));
  }
  return text;
}

std::string target_table(const std::vector<SeenTarget>& seen, const Vec<double, 2>& target) {
  if (seen.empty()) return "";
  constexpr std::size_t rows = 20;
  std::string text =
      fmt::format("\ntarget at ({:g}, {:g}) m\n{:>12}{:>14}{:>8}{:>16}{:>8}\n", target.x(),
                  target.y(), "time [s]", "distance [m]", "sigma", "bearing [deg]", "sigma");
  const std::size_t count = std::min(rows, seen.size());
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t place = count == 1 ? 0 : i * (seen.size() - 1) / (count - 1);
    const auto& [t, at] = seen[place];
    // Beyond a thousand kilometres in as many digits as a column has.
    const std::string distance =
        at.distance < 1e6 ? fmt::format("{:.3f}", at.distance) : fmt::format("{:.6g}", at.distance);
    text += fmt::format("{:>12.3f}{:>14}{:>8.3f}{:>16.1f}{:>8.1f}   {}\n", t, distance,
                        std::sqrt(at.distance_variance), radians_to_degrees(at.bearing),
                        radians_to_degrees(std::sqrt(at.bearing_variance)),
                        at.ahead ? "ahead" : "behind");
  }
  return text;
}

}  // namespace uwbpos::host
