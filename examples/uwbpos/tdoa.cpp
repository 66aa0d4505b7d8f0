// SPDX-License-Identifier: MIT
#include "tdoa.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include "uwbpos/frames/fuse_fixes.hpp"

#include "failure.hpp"
#include "level_solver.hpp"
#include "statistics.hpp"

namespace uwbpos::host {
namespace {

constexpr double kArrivalsPerDifference = std::numbers::sqrt2;  // of sigmas

// Epochs and the place of each one's first difference in the log.
using PlacedDifferences = std::vector<std::pair<std::size_t, DifferenceEpoch>>;

struct Open {
  DifferenceEpoch epoch;
  std::size_t first = 0;
  std::set<Id> anchors;
};

void close(PlacedDifferences& closed, Open& open) {
  if (open.epoch.differences.empty()) return;
  const double start = open.epoch.differences.front().t;
  double sum = 0;
  for (const Difference& d : open.epoch.differences) sum += d.t - start;
  open.epoch.t = start + sum / static_cast<double>(open.epoch.differences.size());
  closed.emplace_back(open.first, std::exchange(open.epoch, {}));
  open.anchors.clear();
}

// What one epoch came to.
struct Solved {
  Vec3 position;
  Mat<double, 3> covariance;  // of the plane alone in 2-D
  double chi_squared;
  int degrees_of_freedom;
  std::uint64_t excluded;
  bool consistent;
};

// Differences of one blink against one reference are not independent: Q = σ² (I + 11ᵀ). The same
// sum of squares comes from all pairs of the n arrivals, each with √n of an arrival's sigma:
//   Σ_{i<j} (x_i − x_j)² / n = Σ (x_i − mean)².
// Nothing where they are not of one blink, or too many.
std::vector<PairDifference<double, 3>> all_pairs_of_blink(const DifferenceEpoch& epoch,
                                                          Pairs differences,
                                                          std::uint64_t excluded) {
  struct Arrival {
    Vec<double, 3> anchor;
    double later;  // than the reference [m]
  };
  std::vector<Arrival> arrivals{{differences.front().anchor_a, 0}};
  double variance = 0;
  for (std::size_t i = 0; i < differences.size(); ++i) {
    const Difference& d = epoch.differences[i];
    const Difference& first = epoch.differences.front();
    if (d.t != first.t || d.anchor_a != first.anchor_a) return {};
    if ((excluded >> i & 1) != 0) continue;
    arrivals.push_back({differences[i].anchor_b, differences[i].difference});
    variance += differences[i].sigma * differences[i].sigma / 2;
  }
  const std::size_t n = arrivals.size();
  std::vector<PairDifference<double, 3>> pairs;
  if (n < 3 || n * (n - 1) / 2 > static_cast<std::size_t>(kMaxMeasurements)) return pairs;
  const double mean = variance / static_cast<double>(n - 1);  // of one arrival
  const double sigma = std::sqrt(mean * static_cast<double>(n));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      pairs.push_back(
          {arrivals[i].anchor, arrivals[j].anchor, arrivals[j].later - arrivals[i].later, sigma});
    }
  }
  return pairs;
}

// More outliers than exclusion can tell: a contradiction even if noise were twice what it is taken
// to be.
bool beyond_help(const Solved& solved) {
  constexpr double doubled = 4;  // of variances
  return !solved.consistent &&
         solved.chi_squared >
             doubled * chi_squared_gate(solved.degrees_of_freedom,
                                        ExclusionOptions<double>{}.normal_quantile);
}

// Solves epochs one after the other; remembers each tag's last position.
class DifferenceSolver {
 public:
  DifferenceSolver(const Settings& settings, const Site& site, int dim)
      : settings_{settings}, site_{site}, dim_{dim} {
    for (const SubnetFrame& f : site.subnets.frames) {
      // Ids are unique and transforms were checked when they were read.
      (void)plane_.add({f.id, f.control_anchor, f.map_T_subnet});
      (void)space_.add({f.id, f.control_anchor, in_space_of(f)});
    }
  }

  // Of differences whose log tells none [m].
  double sigma = kRangeSigma * kArrivalsPerDifference;
  double seconds = 0;
  std::size_t calls = 0;
  bool by_prior = false;
  bool fused = false;

  Result<Solved> solve(const DifferenceEpoch& epoch) {
    const auto last = last_.find(epoch.tag);
    const std::optional<Vec3> prior =
        last != last_.end() ? std::optional{last->second} : settings_.prior;
    by_prior = false;
    fused = false;
    const double height =
        settings_.height ? tag_height(*settings_.height, site_.tags, epoch.tag) : 0.0;
    Result<Solved> solved = site_.subnets.empty() ? in_frame(epoch, site_.anchors, height, prior)
                            : dim_ == 3           ? in_subnets<3>(epoch, height, prior)
                                                  : in_subnets<2>(epoch, height, prior);
    if (solved && !beyond_help(*solved)) last_[epoch.tag] = solved->position;
    return solved;
  }

  // Heights are left out of the model.
  [[nodiscard]] bool flat() const { return dim_ == 2 && !settings_.height; }

 private:
  // One in this many may be an outlier before an epoch is beyond help.
  [[nodiscard]] ExclusionOptions<double> exclusion() const {
    constexpr int share = 3;
    return {.max_excluded = static_cast<int>(pairs_.size()) / share};
  }

  template <class Locate>
  auto timed(const Locate& locate_it) {
    const auto start = std::chrono::steady_clock::now();
    auto result = locate_it();
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    seconds += taken.count();
    ++calls;
    return result;
  }

  static Transform<double, 3> in_space_of(const SubnetFrame& frame) {
    return uwbpos::in_space(frame.map_T_subnet, frame.height);
  }

  // All in one frame, that of `anchors`, `height` and `prior`.
  Result<Solved> in_frame(const DifferenceEpoch& epoch, const Points& anchors, double height,
                          const std::optional<Vec3>& prior) {
    pairs_.clear();
    for (const Difference& d : epoch.differences) {
      pairs_.push_back(
          {anchors.at(d.anchor_a), anchors.at(d.anchor_b), d.difference, d.sigma.value_or(sigma)});
      if (flat()) pairs_.back().anchor_a.z() = pairs_.back().anchor_b.z() = 0;
    }
    Result<Solved> solved = dim_ == 3 ? in_space(prior) : in_plane(height, prior);
    if (solved) refine(epoch, *solved);
    return solved;
  }

  template <int D>
  Subnets<double, D, kMostSubnets>& subnets() {
    if constexpr (D == 3) {
      return space_;
    } else {
      return plane_;
    }
  }

  // Each subnet in its own frame, then all that heard the tag as one in the map.
  template <int D>
  Result<Solved> in_subnets(const DifferenceEpoch& epoch, double height,
                            const std::optional<Vec3>& prior) {
    std::vector<SubnetFix<double, D>> fixes;
    Solved all{Vec3::Zero(), Mat<double, 3>::Zero(), 0, 0, 0, true};
    Error last_error = Error::TooFewMeasurements;
    for (std::size_t place = 0; place < site_.subnets.frames.size(); ++place) {
      DifferenceEpoch own{epoch.tag, epoch.t, {}};
      std::vector<std::size_t> from;
      for (std::size_t i = 0; i < epoch.differences.size(); ++i) {
        if (site_.subnets.of_anchor.at(epoch.differences[i].anchor_a) != place) continue;
        own.differences.push_back(epoch.differences[i]);
        from.push_back(i);
      }
      if (own.differences.empty()) continue;
      const SubnetFrame& frame = site_.subnets.frames[place];
      const auto subnet_T_map = inverse(in_space_of(frame));
      const auto local_prior = prior ? std::optional<Vec3>{apply(subnet_T_map, *prior)} : prior;
      const double floor = flat() ? 0 : frame.height.value;
      const Result<Solved> solved = in_frame(own, site_.subnets.local, height - floor, local_prior);
      if (!solved) {
        last_error = solved.error();
        continue;
      }
      fixes.push_back(
          {frame.id,
           {solved->position.template head<D>(), solved->covariance.template topLeftCorner<D, D>(),
            solved->chi_squared, solved->degrees_of_freedom}});
      for (std::size_t i = 0; i < from.size(); ++i) {
        all.excluded |= (solved->excluded >> i & 1) << from[i];
      }
      all.consistent = all.consistent && solved->consistent;
    }
    if (fixes.empty()) return std::unexpected(last_error);
    if (fixes.size() > kMaxHeard) fixes.resize(kMaxHeard);
    FuseOptions<double> options;
    if (const auto led = leading_.find(epoch.tag); led != leading_.end()) {
      options.preferred = led->second;
    }
    const auto map = fuse_and_learn(subnets<D>(), fixes, options);
    if (!map) return std::unexpected(map.error());
    leading_[epoch.tag] = map->leading;
    fused = map->fused > 1;
    all.position.z() = height;
    all.position.template head<D>() = map->fix.position;
    all.covariance.template topLeftCorner<D, D>() = map->fix.covariance;
    all.chi_squared = map->fix.chi_squared;
    all.degrees_of_freedom = map->fix.degrees_of_freedom;
    return all;
  }

  Result<Solved> in_space(const std::optional<Vec3>& prior) {
    LocateOptions<double, 3> options;
    if (settings_.side != Side::kUnknown) options.side = upwards(settings_.side);
    using Pair = PairDifference<double, 3>;
    const auto attempt = [&] {
      return exclude_outliers<Pair, double, 3>(
          pairs_, exclusion(), prior, [&](Pairs some) { return locate(some, options); },
          [](const Pair& d, const Vec3& at) { return residual_of<double, 3>(d, at); });
    };
    auto fix = timed(attempt);
    if (!fix && fix.error() == Error::AmbiguousSolution && prior) {
      options.prior = prior;
      by_prior = true;
      fix = timed(attempt);
    }
    if (!fix) return std::unexpected(fix.error());
    return Solved{fix->fix.position,           fix->fix.covariance, fix->fix.chi_squared,
                  fix->fix.degrees_of_freedom, fix->excluded,       fix->consistent};
  }

  Result<Solved> in_plane(double height, const std::optional<Vec3>& prior) {
    LocateOptions<double, 2> options;
    if (prior) options.prior = prior->head<2>();
    const auto fix =
        timed([&] { return locate_level_excluding(pairs_, height, options, exclusion()); });
    if (!fix) return std::unexpected(fix.error());
    const Vec<double, 2>& at = fix->fix.position;
    Mat<double, 3> covariance = Mat<double, 3>::Zero();
    covariance.topLeftCorner<2, 2>() = fix->fix.covariance;
    return Solved{{at.x(), at.y(), height},    covariance,    fix->fix.chi_squared,
                  fix->fix.degrees_of_freedom, fix->excluded, fix->consistent};
  }

  // Correlations, where there are any, once the outliers are known.
  void refine(const DifferenceEpoch& epoch, Solved& solved) {
    const auto pairs = all_pairs_of_blink(epoch, pairs_, solved.excluded);
    if (pairs.empty()) return;
    const Vec3 start = solved.position;
    if (dim_ == 3) {
      const auto fix = timed([&] { return locate(pairs, {.prior = start}); });
      if (!fix) return;
      solved.position = fix->position;
      solved.covariance = fix->covariance;
      solved.chi_squared = fix->chi_squared;
    } else {
      const auto fix = timed([&] {
        return locate_level(pairs, start.z(), {.prior = Vec<double, 2>{start.head<2>()}});
      });
      if (!fix) return;
      solved.position.head<2>() = fix->position;
      solved.covariance.topLeftCorner<2, 2>() = fix->covariance;
      solved.chi_squared = fix->chi_squared;
    }
  }

  const Settings& settings_;
  const Site& site_;
  int dim_;
  std::vector<PairDifference<double, 3>> pairs_;
  std::map<Id, Vec3> last_;
  Subnets<double, 2, kMostSubnets> plane_;
  Subnets<double, 3, kMostSubnets> space_;
  std::map<Id, Id> leading_;  // of each tag, the subnet with the best position last
};

double distance(const Vec3& a, const Vec3& b, bool flat) {
  return error_length(a - b, flat ? 2 : 3);
}

double residual_of(const Difference& d, const Vec3& tag, const Site& site, bool flat) {
  return d.difference - (distance(tag, site.anchors.at(d.anchor_b), flat) -
                         distance(tag, site.anchors.at(d.anchor_a), flat));
}

// Standard deviation of a difference, from what is left over in epochs all over the log. Half of
// the residuals are nearer to zero than 0.6745 of it, whatever the outliers are; a fix of k numbers
// from n differences leaves 1 − k/n of their variance.
std::optional<double> find_sigma(const Settings& settings, const Site& site, int dim,
                                 const std::vector<DifferenceEpoch>& epochs) {
  constexpr std::size_t most = 300;
  constexpr std::size_t few = 100;
  constexpr double least = 0.01;  // [m]
  DifferenceSolver solver{settings, site, dim};
  for (int round = 0; round < 2; ++round) {
    std::vector<double> residuals;
    const std::size_t stride = std::max<std::size_t>(1, epochs.size() / most);
    for (std::size_t i = 0; i < epochs.size(); i += stride) {
      const DifferenceEpoch& epoch = epochs[i];
      const auto count = static_cast<double>(epoch.differences.size());
      if (count < 2 * dim) continue;
      const auto solved = solver.solve(epoch);
      if (!solved) continue;
      const double left = std::sqrt(1 - dim / count);
      for (const Difference& d : epoch.differences) {
        residuals.push_back(residual_of(d, solved->position, site, solver.flat()) / left);
      }
    }
    if (residuals.size() < few) return std::nullopt;
    solver.sigma = std::max(robust_spread(std::move(residuals)), least);
  }
  return solver.sigma;
}

}  // namespace

void add_residual(Replay& result, const Difference& d, double residual) {
  result.residuals[{d.tag, d.anchor_b}].push_back({d.t, residual});
  result.residuals[{d.tag, d.anchor_a}].push_back({d.t, -residual});
}

void residuals_against_truth(const Site& site, const Settings& settings, bool flat,
                             const std::vector<Difference>& differences, Replay& result) {
  for (const Difference& d : differences) {
    const auto truth = expected_position(site, settings, result.dim, d.tag, d.t);
    if (!truth) continue;
    add_residual(result, d, residual_of(d, *truth, site, flat));
  }
}

std::vector<Difference> usable_differences(const Settings& settings, const Site& site, bool flat,
                                           const std::vector<Difference>& differences,
                                           Replay& result) {
  std::vector<Difference> kept;
  kept.reserve(differences.size());
  std::set<std::array<Id, 3>> of_this_time;  // tag and anchors
  double time = 0;
  for (Difference d : differences) {
    const auto& only = settings.only_tags;
    if (!only.empty() && std::ranges::find(only, d.tag) == only.end()) continue;
    const auto a = site.anchors.find(d.anchor_a);
    const auto b = site.anchors.find(d.anchor_b);
    if (a == site.anchors.end() || b == site.anchors.end()) {
      ++result.unknown_anchors[a == site.anchors.end() ? d.anchor_a : d.anchor_b];
      continue;
    }
    if (!site.subnets.empty() &&
        site.subnets.of_anchor.at(d.anchor_a) != site.subnets.of_anchor.at(d.anchor_b)) {
      ++result.refused_readings["across_subnets"];
      continue;
    }
    if (d.t != std::exchange(time, d.t)) of_this_time.clear();
    if (!of_this_time.insert({d.tag, d.anchor_a, d.anchor_b}).second) {
      ++result.duplicates;
      continue;
    }
    if (!site.tags.empty() && !site.tags.contains(d.tag)) ++result.unknown_tags[d.tag];
    if (!site.bias.empty()) {
      const auto bias_a = site.bias.find(d.tag, d.anchor_a);
      const auto bias_b = site.bias.find(d.tag, d.anchor_b);
      if (!bias_a || !bias_b) ++result.without_bias;
      d.difference -= bias_b.value_or(0) - bias_a.value_or(0);
    }
    const double sigma =
        d.sigma.value_or(settings.sigma.value_or(kRangeSigma) * kArrivalsPerDifference);
    const double baseline = distance(a->second, b->second, flat);
    if (std::abs(d.difference) > baseline + kDifferenceSigmas * sigma) {
      ++result.refused_readings[std::string{reason_name(Error::ImpossibleDifference)}];
      continue;
    }
    kept.push_back(d);
  }
  return kept;
}

DifferenceRule difference_rule(const std::vector<Difference>& differences, int dim,
                               std::optional<double> window) {
  constexpr std::size_t any = std::numeric_limits<std::size_t>::max();
  if (window) return {*window, any, any};
  const auto unknowns = static_cast<std::size_t>(dim);
  struct Stamp {
    double first;
    double last;
    std::size_t rows;  // with the last time
  };
  std::map<Id, Stamp> of_tag;
  std::size_t times = 0;
  std::size_t whole = 0;  // times with enough rows for a position
  const auto settle = [&](const Stamp& s) {
    ++times;
    whole += s.rows > unknowns ? 1 : 0;
  };
  double pauses = 0;  // longer than any epoch
  double spans = 0;
  constexpr double shortest = 0.2;  // [s]
  constexpr double longest = 0.5;
  for (const Difference& d : differences) {
    const auto [found, fresh] = of_tag.try_emplace(d.tag, Stamp{d.t, d.t, 0});
    Stamp& s = found->second;
    if (d.t != s.last) {
      settle(s);
      if (d.t - s.last > longest) pauses += d.t - s.last;
      s = {s.first, d.t, 0};
    }
    ++s.rows;
  }
  for (const auto& [tag, s] : of_tag) {
    settle(s);
    spans += s.last - s.first;
  }
  if (4 * whole > 3 * times) return {0, any, any};
  const std::size_t enough = 5 * (unknowns + 1);
  const double usual = static_cast<double>(enough) * (spans - pauses) /
                       static_cast<double>(std::max<std::size_t>(1, differences.size()));
  return {std::clamp(usual, shortest, longest), enough, unknowns + 2};
}

std::vector<DifferenceEpoch> group_differences(const std::vector<Difference>& differences,
                                               const DifferenceRule& rule) {
  PlacedDifferences closed;
  std::map<Id, Open> open_of_tag;
  for (std::size_t i = 0; i < differences.size(); ++i) {
    const Difference& d = differences[i];
    Open& open = open_of_tag[d.tag];
    std::vector<Difference>& group = open.epoch.differences;
    if (!group.empty() && (d.t - group.front().t > rule.window + kTimeRounding ||
                           group.size() == static_cast<std::size_t>(kMaxMeasurements))) {
      close(closed, open);
    }
    if (group.empty()) {
      open.epoch.tag = d.tag;
      open.first = i;
    }
    group.push_back(d);
    open.anchors.insert({d.anchor_a, d.anchor_b});
    if (group.size() >= rule.enough && open.anchors.size() >= rule.anchors) close(closed, open);
  }
  for (auto& [tag, open] : open_of_tag) close(closed, open);
  std::ranges::sort(closed, [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<DifferenceEpoch> epochs;
  epochs.reserve(closed.size());
  for (auto& [first, epoch] : closed) epochs.push_back(std::move(epoch));
  return epochs;
}

Replay replay_differences(Settings settings, const Site& site,
                          const std::vector<Difference>& differences,
                          const std::function<void(std::size_t, std::size_t)>& progress) {
  if (site.network) throw Failure{"--bias-network with --tdoa needs the body's --attitude"};
  if (settings.side == Side::kUnknown && settings.height) {
    settings.side = side_of(*settings.height, site.anchors);
  }
  Replay result;
  result.of_differences = true;
  result.dim = choose_dim(settings, site.anchors);
  result.residuals_to_truth = !site.truth.empty();
  DifferenceSolver solver{settings, site, result.dim};
  const std::vector<Difference> kept =
      usable_differences(settings, site, solver.flat(), differences, result);
  const DifferenceRule rule = difference_rule(kept, result.dim, settings.epoch_window);
  result.rule = {rule.window, 0};
  const std::vector<DifferenceEpoch> epochs = group_differences(kept, rule);
  if (settings.sigma) {
    solver.sigma = *settings.sigma * kArrivalsPerDifference;
  } else if (std::ranges::any_of(kept, [](const Difference& d) { return !d.sigma; })) {
    result.found_sigma = find_sigma(settings, site, result.dim, epochs);
    solver.sigma = result.found_sigma.value_or(solver.sigma);
  }

  for (std::size_t i = 0; i < epochs.size(); ++i) {
    if (progress && i % kProgressStep == 0) progress(i, epochs.size());
    const DifferenceEpoch& epoch = epochs[i];
    Outcome& of_tag = result.of_tag[epoch.tag];
    ++of_tag.epochs;
    const Result<Solved> solved = solver.solve(epoch);
    if (!solved) {
      ++of_tag.rejected[std::string{reason_name(solved.error())}];
      continue;
    }
    if (beyond_help(*solved)) {
      ++of_tag.rejected["inconsistent"];
      continue;
    }
    ++of_tag.solved;
    if (solver.by_prior) ++result.chosen_by_prior;
    if (solver.fused) ++result.fused;
    if (!solved->consistent) ++result.inconsistent;
    std::size_t excluded = 0;
    for (std::size_t k = 0; k < epoch.differences.size(); ++k) {
      const Difference& d = epoch.differences[k];
      if ((solved->excluded >> k & 1) != 0) {
        ++excluded;
        ++result.excluded_of_anchor[d.anchor_a];
        ++result.excluded_of_anchor[d.anchor_b];
      }
      if (!result.residuals_to_truth) {
        add_residual(result, d, residual_of(d, solved->position, site, solver.flat()));
      }
    }
    result.excluded += excluded;
    result.track.push_back(
        {epoch.t, epoch.tag, solved->position, solved->chi_squared, solved->degrees_of_freedom,
         static_cast<int>(epoch.differences.size() - excluded), solver.by_prior, std::nullopt});
  }
  if (progress) progress(epochs.size(), epochs.size());
  result.solve_seconds = solver.seconds;
  result.solve_calls = solver.calls;

  std::ranges::stable_sort(result.track,
                           [](const Position& a, const Position& b) { return a.t < b.t; });
  if (result.residuals_to_truth) {
    residuals_against_truth(site, settings, solver.flat(), kept, result);
  }
  score(site, result);
  return result;
}

}  // namespace uwbpos::host
