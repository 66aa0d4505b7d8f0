// SPDX-License-Identifier: MIT
#include "replay.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "uwbpos/geometry/height.hpp"
#include "uwbpos/solve/locate.hpp"

#include "failure.hpp"

namespace uwbpos::host {
namespace {

constexpr double kTruthPause = 1;  // [s]

template <int D>
Vec<double, D> part(const Vec3& v) {
  return v.template head<D>();
}

template <int D>
Vec3 whole(const Vec<double, D>& v, double z) {
  if constexpr (D == 3) {
    return v;
  } else {
    return {v.x(), v.y(), z};
  }
}

// Solves epochs one after the other; remembers each tag's last position for mirror images.
template <int D>
class Solver {
 public:
  Solver(const Settings& settings, const Site& site, Replay& replay)
      : settings_{settings}, site_{site}, replay_{replay} {}

  void solve(const Epoch& epoch) {
    collect(epoch);
    Outcome& of_tag = replay_.of_tag[epoch.tag];
    ++of_tag.epochs;
    bool by_prior = false;
    const Result<Fix<double, D>> fix = locate_epoch(epoch.tag, by_prior);
    if (!fix) {
      ++of_tag.rejected[std::string{reason_name(fix.error())}];
      return;
    }
    ++of_tag.solved;
    if (by_prior) ++replay_.chosen_by_prior;
    last_[epoch.tag] = fix->position;
    replay_.track.push_back({epoch.t, epoch.tag, whole<D>(fix->position, height(epoch.tag)),
                             fix->chi_squared, fix->degrees_of_freedom,
                             static_cast<int>(ranges_.size()), by_prior, std::nullopt});
    if (!replay_.residuals_to_truth) {
      for (std::size_t i = 0; i < ranges_.size(); ++i) {
        const double expected = (fix->position - ranges_[i].anchor).norm();
        replay_.residuals[{epoch.tag, anchors_[i]}].push_back(
            {epoch.t, ranges_[i].range - expected});
      }
    }
  }

 private:
  // The epoch's usable readings, as ranges in D dimensions.
  void collect(const Epoch& epoch) {
    ranges_.clear();
    anchors_.clear();
    for (const Reading& reading : epoch.readings) {
      const Vec3& anchor = site_.anchors.at(reading.anchor);
      const double sigma = reading.sigma.value_or(settings_.sigma.value_or(kRangeSigma));
      RangeTo<double, D> range{part<D>(anchor), reading.range, sigma};
      if (D == 2 && settings_.height) {
        const auto level =
            horizontal_range<double>({reading.range, sigma * sigma}, anchor.z(), height(epoch.tag));
        if (!level) {
          ++replay_.refused_readings[std::string{reason_name(level.error())}];
          continue;
        }
        range.range = level->value;
        range.sigma = std::sqrt(level->variance);
      }
      ranges_.push_back(range);
      anchors_.push_back(reading.anchor);
    }
  }

  Result<Fix<double, D>> locate_epoch(Id tag, bool& by_prior) {
    LocateOptions<double, D> options;
    if constexpr (D == 3) {
      if (settings_.side != Side::kUnknown) options.side = upwards(settings_.side);
    }
    Result<Fix<double, D>> fix = timed_locate(options);
    if (fix || fix.error() != Error::AmbiguousSolution) return fix;
    const auto last = last_.find(tag);
    if (last != last_.end()) {
      options.prior = last->second;
    } else if (settings_.prior) {
      options.prior = part<D>(*settings_.prior);
    } else {
      return fix;
    }
    by_prior = true;
    return timed_locate(options);
  }

  Result<Fix<double, D>> timed_locate(const LocateOptions<double, D>& options) {
    const auto start = std::chrono::steady_clock::now();
    Result<Fix<double, D>> fix = locate(ranges_, options);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    replay_.solve_seconds += taken.count();
    ++replay_.solve_calls;
    return fix;
  }

  [[nodiscard]] double height(Id tag) const {
    return settings_.height ? tag_height(*settings_.height, site_.tags, tag) : 0;
  }

  const Settings& settings_;
  const Site& site_;
  Replay& replay_;
  std::vector<RangeTo<double, D>> ranges_;
  std::vector<Id> anchors_;
  std::map<Id, Vec<double, D>> last_;
};

template <int D>
void solve_all(const Settings& settings, const Site& site, const std::vector<Epoch>& epochs,
               Replay& result, const std::function<void(std::size_t, std::size_t)>& progress) {
  Solver<D> solver{settings, site, result};
  for (std::size_t i = 0; i < epochs.size(); ++i) {
    if (progress && i % kProgressStep == 0) progress(i, epochs.size());
    solver.solve(epochs[i]);
  }
  if (progress) progress(epochs.size(), epochs.size());
}

}  // namespace

std::vector<Reading> usable_readings(const Settings& settings, const Site& site,
                                     const std::vector<Reading>& readings, Replay& result) {
  std::vector<Reading> kept;
  kept.reserve(readings.size());
  for (Reading reading : readings) {
    const auto& only = settings.only_tags;
    if (!only.empty() && std::ranges::find(only, reading.tag) == only.end()) continue;
    if (!site.anchors.contains(reading.anchor)) {
      ++result.unknown_anchors[reading.anchor];
      continue;
    }
    if (!site.tags.empty() && !site.tags.contains(reading.tag)) ++result.unknown_tags[reading.tag];
    if (!site.bias.empty()) {
      const auto bias = site.bias.find(reading.tag, reading.anchor);
      if (!bias) ++result.without_bias;
      reading.range -= bias.value_or(0);
    }
    constexpr double sigmas = 4;  // a range this far below zero is not noise
    const double sigma = reading.sigma.value_or(settings.sigma.value_or(kRangeSigma));
    if (reading.range < -sigmas * sigma) {
      ++result.refused_readings[std::string{reason_name(Error::NegativeRange)}];
    } else if (reading.range > settings.max_range) {
      ++result.refused_readings[std::string{reason_name(Error::RangeBeyondMaximum)}];
    } else {
      reading.range = std::max(reading.range, 0.0);
      kept.push_back(reading);
    }
  }
  return kept;
}

void residuals_against_truth(const Site& site, const Settings& settings, bool flat,
                             const std::vector<Reading>& readings, Replay& result) {
  for (const Reading& reading : readings) {
    const auto truth = expected_position(site, settings, result.dim, reading.tag, reading.t);
    if (!truth) continue;
    const double expected = error_length(*truth - site.anchors.at(reading.anchor), flat ? 2 : 3);
    result.residuals[{reading.tag, reading.anchor}].push_back(
        {reading.t, reading.range - expected});
  }
}

std::optional<Vec3> true_position(const Site& site, Id tag, double t) {
  if (site.tags.empty()) return site.truth.point_at(t, Vec3::Zero());
  const auto lever = site.tags.find(tag);
  if (lever == site.tags.end()) return std::nullopt;
  return site.truth.point_at(t, lever->second);
}

std::optional<Vec3> expected_position(const Site& site, const Settings& settings, int dim, Id tag,
                                      double t) {
  auto truth = true_position(site, tag, t);
  if (truth && settings.height && dim == 2) {
    truth->z() = tag_height(*settings.height, site.tags, tag);
  }
  return truth;
}

void score(const Site& site, Replay& result) {
  std::vector<Vec3> all;
  std::map<Id, std::vector<Vec3>> of_tag;
  for (Position& position : result.track) {
    if (site.truth.empty()) break;
    if (result.unknown_tags.contains(position.tag)) continue;
    position.truth = true_position(site, position.tag, position.t);
    if (!position.truth) {
      ++result.outside_truth;
      continue;
    }
    if (site.truth.spacing_at(position.t) > kTruthPause) ++result.in_truth_gaps;
    all.emplace_back(position.position - *position.truth);
    of_tag[position.tag].push_back(all.back());
  }
  for (auto& [tag, outcome] : result.of_tag) {
    outcome.scored = of_tag[tag].size();
    outcome.error = summarize_errors(of_tag[tag], result.dim);
    result.all.epochs += outcome.epochs;
    result.all.solved += outcome.solved;
    for (const auto& [reason, count] : outcome.rejected) result.all.rejected[reason] += count;
  }
  result.all.scored = all.size();
  result.all.error = summarize_errors(all, result.dim);
}

int choose_dim(const Settings& settings, const Points& anchors) {
  if (settings.dim) return *settings.dim;
  if (settings.height) return 2;
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const auto& [id, position] : anchors) {
    low = std::min(low, position.z());
    high = std::max(high, position.z());
  }
  constexpr double equally_high = 0.05;  // [m]
  const bool told_where = settings.side != Side::kUnknown || settings.prior;
  return high - low <= equally_high && !told_where ? 2 : 3;
}

Side side_of(double height, const Points& anchors) {
  double mean = 0;
  for (const auto& [id, position] : anchors) mean += position.z();
  mean /= static_cast<double>(anchors.size());
  if (height == mean) return Side::kUnknown;
  return height > mean ? Side::kAbove : Side::kBelow;
}

double body_height(double mean_height, const Points& tags) {
  if (tags.empty()) return mean_height;
  double mean = 0;
  for (const auto& [id, lever] : tags) mean += lever.z();
  return mean_height - mean / static_cast<double>(tags.size());
}

double tag_height(double mean_height, const Points& tags, Id tag) {
  const auto lever = tags.find(tag);
  return lever == tags.end() ? mean_height : body_height(mean_height, tags) + lever->second.z();
}

Replay replay(Settings settings, const Site& site, const std::vector<Reading>& readings,
              const std::function<void(std::size_t, std::size_t)>& progress) {
  if (settings.side == Side::kUnknown && settings.height) {
    settings.side = side_of(*settings.height, site.anchors);
  }
  Replay result;
  result.dim = choose_dim(settings, site.anchors);
  result.residuals_to_truth = !site.truth.empty();
  const std::vector<Reading> kept = usable_readings(settings, site, readings, result);
  result.rule = epoch_rule(kept, settings.epoch_window);
  const Epochs grouped = group_epochs(kept, result.rule);
  result.duplicates = grouped.duplicates;
  if (result.dim == 2) {
    solve_all<2>(settings, site, grouped.epochs, result, progress);
  } else {
    solve_all<3>(settings, site, grouped.epochs, result, progress);
  }
  std::ranges::stable_sort(result.track,
                           [](const Position& a, const Position& b) { return a.t < b.t; });
  if (result.residuals_to_truth) {
    const bool flat = result.dim == 2 && !settings.height;
    residuals_against_truth(site, settings, flat, kept, result);
  }
  score(site, result);
  if (site.network && (!has_pose(site, kept) || (result.dim == 2 && !settings.height))) {
    throw Failure{
        "--bias-network needs the body's attitude, so --attitude or --tags with two or more lever "
        "arms, and heights, so --height or --dim 3"};
  }
  if (has_pose(site, kept)) {
    result.body = solve_poses(settings, site, result.dim, kept, progress);
    // Tags that are never heard together have positions all the same.
    if (result.body->track.empty() && result.all.solved > 0) {
      result.body.reset();
      result.never_together = true;
    }
  }
  return result;
}

Replay compare_with_truth(const Settings& settings, const Site& site,
                          const std::vector<Reading>& readings) {
  Replay result;
  result.dim = settings.height ? 2 : 3;
  result.residuals_to_truth = true;
  const std::vector<Reading> kept = usable_readings(settings, site, readings, result);
  residuals_against_truth(site, settings, false, kept, result);
  return result;
}

}  // namespace uwbpos::host
