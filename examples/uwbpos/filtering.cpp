// SPDX-License-Identifier: MIT
#include "filtering.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <functional>
#include <iterator>
#include <limits>
#include <numbers>
#include <set>

#include <fmt/format.h>

#include "failure.hpp"
#include "hypotheses.hpp"
#include "recording.hpp"
#include "replay.hpp"
#include "statistics.hpp"
#include "tdoa.hpp"

namespace uwbpos::host {
namespace {

constexpr Id kBody = 0;  // stands for all tags of a body

// The end of an epoch.
struct EpochEnd {
  double t;
  Id tag;
};

// All measurements of one track, by time, and the times at which its pose is asked for.
struct Stream {
  std::vector<TimedMeasurement> measurements;
  std::vector<double> ends;
};

// How a recording is to be followed.
struct Plan {
  int dim = 2;
  bool flat = false;  // heights are left out
  bool body = false;  // all tags are those of one body whose pose is wanted
  bool unit = false;  // with an inertial unit
  double start = 0;   // time zero [s]
  std::map<Id, Stream> streams;
  std::vector<ClockReset> clock_resets;
};

std::int64_t microseconds(double t, double start) { return std::llround((t - start) * 1e6); }

// Differences of one blink against one reference share its noise.
void mark_shared(std::vector<TimedMeasurement>& all) {
  for (std::size_t i = 0; i < all.size();) {
    std::size_t end = i + 1;
    bool one_reference = all[i].is_difference;
    while (end < all.size() && all[end].time == all[i].time && all[end].tag == all[i].tag) {
      one_reference =
          one_reference && all[end].is_difference && all[end].anchor_a == all[i].anchor_a;
      ++end;
    }
    if (one_reference && end - i > 1) {
      for (std::size_t k = i; k < end; ++k) all[k].shared = true;
    }
    i = end;
  }
}

std::vector<EpochEnd> epoch_ends(const Settings& settings, const Site& site, bool body, int dim,
                                 const std::vector<Reading>& readings,
                                 std::vector<Difference> differences, Replay& result) {
  std::vector<EpochEnd> ends;
  if (!readings.empty()) {
    std::vector<std::pair<Id, Id>> links;
    std::vector<Epoch> epochs;
    if (body && !site.tags.empty()) {
      epochs = body_epochs(site, readings, settings.epoch_window, links, result.rule);
    } else {
      result.rule = epoch_rule(readings, settings.epoch_window);
      epochs = group_epochs(readings, result.rule).epochs;
    }
    for (const Epoch& epoch : epochs) {
      ends.push_back({epoch.readings.back().t, body ? kBody : epoch.tag});
    }
  } else {
    if (body) {
      for (Difference& d : differences) d.tag = kBody;
    }
    const DifferenceRule rule = difference_rule(differences, dim, settings.epoch_window);
    result.rule = {rule.window, 0};
    for (const DifferenceEpoch& epoch : group_differences(differences, rule)) {
      ends.push_back({epoch.differences.back().t, epoch.tag});
    }
  }
  return ends;
}

// Notes when a track was interrupted, and how long it took to recover.
class RecoveryWatch {
 public:
  // `pause`: without a measurement that is worth a note [s].
  RecoveryWatch(double pause, std::vector<ClockReset> resets)
      : pause_{pause}, resets_{std::move(resets)} {}

  void measured(double t, Id tag, const Verdict& verdict) {
    if (!first_) first_ = t;
    if (reset_ < resets_.size() && resets_[reset_].t <= t) {
      open(t, tag, "the clock was " + words_of(resets_[reset_]));
      ++reset_;
    }
    if (last_ && t - *last_ > pause_) open(t, tag, "nothing was received");
    last_ = t;
    if (verdict.reopened) {
      open(t, tag, "the gate had locked the filter out");
    } else if (verdict.began && tracked_) {
      open(t, tag, "the track was lost and began anew");
    } else if (used_at_ && !verdict.used && t - *used_at_ > std::max(pause_, 1.0)) {
      open(t, tag, "every measurement was refused");
    }
    if (verdict.began || verdict.reopened || verdict.used) {
      tracked_ = true;
      used_at_ = t;
      if (open_ && !open_->used) open_->used = t;
    }
  }

  // At the end of an epoch; `spread`: of the position [m], nothing without one.
  void posed(double t, std::optional<double> spread) {
    if (!spread) return;
    if (!after_ && first_) after_ = t - *first_;
    poses_.push_back({t, *spread});
    if (open_ && open_->used &&
        (usual_.empty() ||
         *spread <= kEnough * median(std::vector<double>(usual_.begin(), usual_.end())))) {
      close();
    }
    constexpr std::size_t most = 200;
    usual_.push_back(*spread);
    if (usual_.size() > most) usual_.pop_front();
  }

  void finish(Filtering& filtering) {
    if (open_) close();
    std::vector<double> spreads;
    for (const auto& [t, spread] : poses_) spreads.push_back(spread);
    const double usual = spreads.empty() ? 0 : median(std::move(spreads));
    for (auto& [what, used] : found_) {
      for (const auto& [t, spread] : poses_) {
        if (used && t >= *used && spread <= kEnough * usual) {
          what.recovery = std::max(t - what.t, 0.0);
          break;
        }
      }
      filtering.interruptions.push_back(std::move(what));
    }
    if (after_) {
      filtering.first_pose_after = std::max(filtering.first_pose_after.value_or(0), *after_);
    }
  }

 private:
  static constexpr double kEnough = 1.5;  // times the usual spread

  struct Open {
    Interruption what;
    std::optional<double> used = std::nullopt;  // when something was first [s]
  };
  struct Pose {
    double t;
    double spread;
  };

  void open(double t, Id tag, std::string cause) {
    if (open_ || !tracked_) return;
    open_ = Open{{t, tag, std::move(cause), used_at_ ? t - *used_at_ : 0}};
  }
  void close() {
    found_.push_back(std::move(*open_));
    open_.reset();
  }

  double pause_;
  std::vector<ClockReset> resets_;
  std::size_t reset_ = 0;
  bool tracked_ = false;
  std::optional<double> first_, last_, used_at_, after_;
  std::optional<Open> open_;
  std::deque<double> usual_;  // spreads of late
  std::vector<Pose> poses_;
  std::vector<Open> found_;
};

// From epoch to epoch, typically [s]; zero of a single one.
double period_of(const Stream& stream) { return usual_step(stream.ends, std::identity{}); }

// What counts as a pause in a stream [s].
double pause_of(const Stream& stream) {
  constexpr double shortest = 0.5;
  constexpr double times = 10;
  constexpr double epochs = 1.5;
  const double quiet = times * 1e-6 * usual_step(stream.measurements, &TimedMeasurement::time);
  return std::max({shortest, quiet, epochs * period_of(stream)});
}

// One track through its stream.
class Follow {
 public:
  Follow(const Site& site, const Plan& plan, Id tag, BankOptions options, RecoveryWatch watch,
         Replay& replay)
      : site_{site},
        plan_{plan},
        tag_{tag},
        bank_{std::move(options)},
        watch_{std::move(watch)},
        replay_{replay} {
    if (plan.body && !replay_.body) replay_.body.emplace();
    if (replay_.body) replay_.body->rule = replay_.rule;
  }

  void take(const TimedMeasurement& m) {
    const auto start = std::chrono::steady_clock::now();
    const Verdict verdict = bank_.take(m);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    replay_.solve_seconds += taken.count();
    ++replay_.solve_calls;
    Filtering& f = *replay_.filtering;
    f.begun += verdict.began ? 1 : 0;
    f.reopened += verdict.reopened ? 1 : 0;
    const double t = plan_.start + 1e-6 * static_cast<double>(m.time);
    watch_.measured(t, m.tag, verdict);
    if (!verdict.met_track) return;
    // A difference is of b; if only a is not believed, the rest of it was of use.
    const bool of_use = verdict.used && verdict.disbelieved != m.anchor_b;
    if (of_use) {
      ++f.used;
      f.innovations.push_back({t, verdict.used->normalised_square});
    } else if (verdict.used || verdict.refused) {
      const Error reason = verdict.refused.value_or(Error::OutlierRejected);
      ++f.refused[std::string{reason_name(reason)}];
      f.refusals.push_back({t, m.anchor_b, reason});
    }
    // A row told twice says nothing of its anchor, nor one before it is known who lies.
    if (verdict.is_repeat()) return;
    if (bank_.settled() && (verdict.used || verdict.refused)) {
      const auto tally_one = [&](Id anchor) {
        tally(anchor, verdict.used && verdict.disbelieved != anchor);
      };
      tally_one(m.anchor_b);
      if (m.is_difference) tally_one(m.anchor_a);
    }
    if (!replay_.residuals_to_truth) note_residual(t, m);
  }

  void take(std::int64_t time, const InertialReading& sample) {
    const auto start = std::chrono::steady_clock::now();
    bank_.take(time, sample);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    replay_.solve_seconds += taken.count();
  }

  void end_epoch(double t) {
    const Result<Estimate> estimate = bank_.at(microseconds(t, plan_.start));
    watch_.posed(t, estimate ? std::optional{std::sqrt(estimate->covariance.trace())}
                             : std::optional<double>{});
    if (plan_.body) {
      end_body_epoch(t, estimate);
      return;
    }
    Outcome& outcome = replay_.of_tag[tag_];
    ++outcome.epochs;
    if (!estimate) {
      ++outcome.rejected[why_none(estimate.error())];
      return;
    }
    ++outcome.solved;
    add_position(t, tag_, estimate->position);
    add_spread(t, *estimate);
  }

  void finish() {
    replay_.filtering->unit_restarts += bank_.restarts();
    watch_.finish(*replay_.filtering);
  }

 private:
  // A bank's only ambiguity.
  static std::string why_none(Error error) {
    return std::string{error == Error::AmbiguousSolution ? "liar_unknown" : reason_name(error)};
  }

  void tally(Id anchor, bool used) {
    AnchorTally& tally = replay_.filtering->of_anchor[anchor];
    ++(used ? tally.used : tally.refused);
  }

  void add_position(double t, Id tag, const Vec3& position) {
    replay_.track.push_back({t, tag, position, 0, 0, 0, false, std::nullopt});
  }

  void add_spread(double t, const Estimate& e) {
    replay_.filtering->spreads.push_back({t, plan_.body ? std::nullopt : std::optional{tag_},
                                          e.position.head<2>(),
                                          e.covariance.topLeftCorner<2, 2>()});
  }

  // The body's pose, and the tags' positions by it.
  void end_body_epoch(double t, const Result<Estimate>& estimate) {
    Body& body = *replay_.body;
    ++body.epochs;
    if (!estimate) ++body.rejected[why_none(estimate.error())];
    if (estimate) {
      constexpr double guessed = 0.35;  // [rad]
      SolvedPose solved{t, {}, 0, 0, 0, false, std::nullopt};
      solved.pose.position = estimate->position;
      solved.pose.covariance.setZero();
      solved.pose.covariance.topLeftCorner<3, 3>() = estimate->covariance;
      solved.heading_known = estimate->heading && estimate->heading->variance < guessed * guessed;
      solved.pose.heading = estimate->heading ? estimate->heading->value : 0;
      solved.pose.covariance(3, 3) =
          estimate->heading ? estimate->heading->variance
                            : std::numbers::pi * std::numbers::pi / 3;  // of any heading
      solved.attitude = estimate->attitude;
      body.track.push_back(solved);
      add_spread(t, *estimate);
      if (bank_.best_is_inertial()) ++replay_.filtering->inertial_epochs;
    }
    for (auto& [tag, outcome] : replay_.of_tag) {
      ++outcome.epochs;
      if (!estimate) {
        ++outcome.rejected[why_none(estimate.error())];
        continue;
      }
      ++outcome.solved;
      const auto arm = site_.tags.find(tag);
      const Rotation level = level_rotation(body.track.back().pose.heading);
      Vec3 at = estimate->position;
      if (arm != site_.tags.end()) at += rotate(estimate->attitude.value_or(level), arm->second);
      add_position(t, tag, at);
    }
  }

  void note_residual(double t, const TimedMeasurement& m) {
    const auto place = bank_.place(m.tag);
    if (!place) return;
    const auto distance = [&](Id anchor) {
      return error_length(*place - site_.anchors.at(anchor), plan_.flat ? 2 : 3);
    };
    const double to_b = distance(m.anchor_b);
    if (m.is_difference) {
      add_residual(replay_, {t, m.tag, m.anchor_a, m.anchor_b, m.value, {}, 0},
                   m.value - (to_b - distance(m.anchor_a)));
    } else {
      replay_.residuals[{m.tag, m.anchor_b}].push_back({t, m.value - to_b});
    }
  }

  const Site& site_;
  const Plan& plan_;
  Id tag_;
  HypothesisBank bank_;
  RecoveryWatch watch_;
  Replay& replay_;
};

// The unit's samples, a fast one's averaged down to some 200 a second, which is all that radio has
// a use for.
std::vector<InertialReading> thinned(const std::vector<InertialReading>& samples) {
  constexpr double period = 0.004;
  std::vector<InertialReading> kept;
  std::size_t count = 0;
  InertialReading sum{};
  double first = 0;
  const auto flush = [&] {
    if (count == 0) return;
    const auto n = static_cast<double>(count);
    kept.push_back({sum.t, sum.gyro / n, sum.accelerometer / n});
    count = 0;
  };
  // Beyond what units measure and bodies bear: a broken row.
  constexpr double fastest = 200;   // [rad/s]
  constexpr double hardest = 2000;  // [m/s²]
  for (const InertialReading& s : samples) {
    if (!(s.gyro.norm() < fastest) || !(s.accelerometer.norm() < hardest)) continue;
    if (count > 0 && s.t - first >= period) flush();
    if (count == 0) {
      first = s.t;
      sum = {s.t, Vec3::Zero(), Vec3::Zero()};
    }
    sum.t = s.t;
    sum.gyro += s.gyro;
    sum.accelerometer += s.accelerometer;
    ++count;
  }
  flush();
  return kept;
}

// The time that half of all measurements are before: near most of them, whatever a broken stamp
// says.
double middle_time(const std::vector<Reading>& readings,
                   const std::vector<Difference>& differences) {
  std::vector<double> times;
  times.reserve(readings.size() + differences.size());
  for (const Reading& r : readings) times.push_back(r.t);
  for (const Difference& d : differences) times.push_back(d.t);
  return times.empty() ? 0 : median(std::move(times));
}

// Whether samples are all of another time than the measurements, as by another clock.
bool elsewhen(const std::vector<InertialReading>& samples, const std::vector<Reading>& readings,
              const std::vector<Difference>& differences) {
  double first = std::numeric_limits<double>::infinity();
  double last = -first;
  const auto span = [&](const auto& all) {
    for (const auto& m : all) {
      first = std::min(first, m.t);
      last = std::max(last, m.t);
    }
  };
  span(readings);
  span(differences);
  return std::ranges::none_of(samples, [&](const auto& s) { return s.t >= first && s.t <= last; });
}

// Why an accelerometer cannot be one in m/s² in axes of the body; empty if it can. Whatever the
// body does, it feels g on average, and most of the time; and it starts upright.
std::string implausible(const std::vector<InertialReading>& samples) {
  constexpr double low = 6;  // [m/s²]
  constexpr double high = 16;
  std::vector<double> lengths;
  for (const InertialReading& s : samples) lengths.push_back(s.accelerometer.norm());
  const double usual = median(std::move(lengths));
  if (usual < 3) {
    return fmt::format(
        "its accelerometer feels {:.2g} m/s² most of the time: gravity was taken off; what is "
        "wanted is the specific force, 9.8 upwards at rest",
        usual);
  }
  if (usual > low && usual < high) {
    constexpr double beginning = 1;  // [s]
    Vec3 mean = Vec3::Zero();
    for (const InertialReading& s : samples) {
      if (s.t > samples.front().t + beginning) break;
      mean += s.accelerometer;
    }
    constexpr double upright = 0.5;  // cosine
    if (mean.z() > -upright * mean.norm()) {
      if (mean.z() > upright * mean.norm()) return "";
      return fmt::format(
          "its accelerometer feels gravity along {} when it starts, not along z: are its axes "
          "those "
          "of the body, x forward, y left, z up?",
          std::abs(mean.x()) > std::abs(mean.y()) ? "x" : "y");
    }
    return fmt::format(
        "its accelerometer feels {:.2g} m/s² along z when it starts, where an upright body at rest "
        "feels +9.8: its z axis points down, or its sign is the other way round",
        mean.z() / mean.norm() * usual);
  }
  return fmt::format(
      "its accelerometer feels {:.3g} m/s², where gravity alone is 9.8: another unit?", usual);
}

// The sigma of a range in a stream of measurements, a difference's being that of two.
double typical_sigma(const std::vector<TimedMeasurement>& all) {
  std::vector<double> sigmas;
  for (const TimedMeasurement& m : all) {
    sigmas.push_back(m.is_difference ? m.sigma / std::numbers::sqrt2 : m.sigma);
  }
  return sigmas.empty() ? kRangeSigma : median(std::move(sigmas));
}

BankOptions bank_options(const Settings& settings, const Site& site, const Plan& plan, Id tag) {
  BankOptions o;
  o.sigma = typical_sigma(plan.streams.at(tag).measurements);
  o.motion = plan.unit && plan.dim == 3 ? BodyMotion::kInertial
             : plan.body                ? BodyMotion::kPlanarBody
             : plan.dim == 3            ? BodyMotion::kPointInSpace
                                        : BodyMotion::kPointInPlane;
  o.anchors = site.anchors;
  o.tags = site.tags;
  if (plan.flat) {
    for (auto& [id, position] : o.anchors) position.z() = 0;
    for (auto& [id, arm] : o.tags) arm.z() = 0;
  }
  if (settings.height) {
    o.height = plan.body ? body_height(*settings.height, site.tags)
                         : tag_height(*settings.height, site.tags, tag);
  }
  if (settings.side != Side::kUnknown) o.side = upwards(settings.side);
  o.prior = settings.prior;
  o.network = site.network;
  o.period = period_of(plan.streams.at(tag));
  return o;
}

// An error against truth.
struct TrackError {
  double t;
  Id tag;
  double error;  // [m]
};

std::vector<TrackError> errors_of(const Replay& result) {
  std::vector<TrackError> errors;
  if (result.body) {
    for (const SolvedPose& p : result.body->track) {
      if (!p.truth) continue;
      errors.push_back({p.t, kBody, error_length(p.pose.position - p.truth->position, result.dim)});
    }
  } else {
    for (const Position& p : result.track) {
      if (!p.truth) continue;
      errors.push_back({p.t, p.tag, error_length(p.position - *p.truth, result.dim)});
    }
  }
  return errors;
}

// Neither interrupted nor on its way back.
bool is_settled(const Filtering& filtering, double t) {
  return std::ranges::none_of(filtering.interruptions, [&](const Interruption& i) {
    return t > i.t - i.silent && (!i.recovery || t < i.t + *i.recovery);
  });
}

// RMSE of what is settled; nothing without truth.
std::optional<double> settled_rmse(const Filtering& filtering,
                                   const std::vector<TrackError>& errors) {
  double sum = 0;
  std::size_t count = 0;
  for (const TrackError& e : errors) {
    if (!is_settled(filtering, e.t)) continue;
    sum += e.error * e.error;
    ++count;
  }
  if (count == 0) return std::nullopt;
  return std::sqrt(sum / static_cast<double>(count));
}

// How long recoveries took as truth has it.
void judge_recoveries(const std::vector<TrackError>& errors, bool one_body, Filtering& filtering) {
  constexpr double times = 2;
  constexpr std::size_t steady = 5;
  for (Interruption& i : filtering.interruptions) {
    std::vector<double> settled;
    std::vector<TrackError> after;
    for (const TrackError& e : errors) {
      if (!one_body && e.tag != i.tag) continue;
      if (is_settled(filtering, e.t)) settled.push_back(e.error);
      if (e.t >= i.t) after.push_back(e);
    }
    if (settled.empty()) continue;
    i.usual_error = median(settled);
    for (std::size_t k = 0; k < after.size() && !i.true_recovery; ++k) {
      if (after[k].error > times * *i.usual_error) continue;
      std::vector<double> some;
      for (std::size_t j = k; j < std::min(k + steady, after.size()); ++j) {
        some.push_back(after[j].error);
      }
      if (median(some) <= times * *i.usual_error) i.true_recovery = after[k].t - i.t;
    }
  }
}

// eᵀP⁻¹e / 2 of positions in plan, on average; nothing without truth.
std::optional<double> mean_nees(const Site& site, const std::vector<PositionSpread>& spreads) {
  double sum = 0;
  std::size_t count = 0;
  for (const PositionSpread& s : spreads) {
    const auto truth =
        s.tag ? true_position(site, *s.tag, s.t) : site.truth.point_at(s.t, Vec3{Vec3::Zero()});
    const Ldlt<double, 2> factor{s.covariance};
    if (!truth || !factor.positive_definite()) continue;
    const Vec2 e = s.position - truth->head<2>();
    sum += e.dot(factor.solve(e)) / 2;
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum / static_cast<double>(count);
}

std::string words_for(const Plan& plan) {
  if (plan.unit && plan.dim == 3) return "inertial navigation, and points that move on as they do";
  if (plan.body) return plan.unit ? "a body on a floor, with a gyro" : "a body on a floor";
  return plan.dim == 3 ? "a point in space that moves on as it does"
                       : "a point in the plane that moves on as it does";
}

void follow_all(const Settings& settings, const Site& site, const Plan& plan,
                const std::vector<InertialReading>& samples, Replay& result,
                const std::function<void(std::size_t, std::size_t)>& progress) {
  std::size_t of = 0;
  std::size_t done = 0;
  for (const auto& [tag, stream] : plan.streams) of += stream.measurements.size();
  for (const auto& [tag, stream] : plan.streams) {
    double& period = result.filtering->period;
    period = std::max(period, period_of(stream));
    Follow follow{site,
                  plan,
                  tag,
                  bank_options(settings, site, plan, tag),
                  RecoveryWatch{pause_of(stream), plan.clock_resets},
                  result};
    std::size_t sample = 0;
    std::size_t end = 0;
    const auto samples_until = [&](std::int64_t time) {
      for (; sample < samples.size(); ++sample) {
        const std::int64_t at = microseconds(samples[sample].t, plan.start);
        if (at > time) break;
        follow.take(at, samples[sample]);
      }
    };
    for (const TimedMeasurement& m : stream.measurements) {
      if (progress && done++ % kProgressStep == 0) progress(done, of);
      while (end < stream.ends.size() && microseconds(stream.ends[end], plan.start) < m.time) {
        follow.end_epoch(stream.ends[end++]);
      }
      samples_until(m.time);
      follow.take(m);
    }
    while (end < stream.ends.size()) follow.end_epoch(stream.ends[end++]);
    follow.finish();
  }
  if (progress) progress(of, of);
}

}  // namespace

double slowest_recovery(const Filtering& filtering) {
  double slowest = 0;
  for (const Interruption& i : filtering.interruptions) {
    slowest = std::max(slowest, i.recovery.value_or(std::numeric_limits<double>::infinity()));
  }
  return slowest;
}

std::optional<double> slowest_true_recovery(const Filtering& filtering) {
  std::optional<double> slowest;
  for (const Interruption& i : filtering.interruptions) {
    if (!i.usual_error) continue;
    slowest = std::max(slowest.value_or(0),
                       i.true_recovery.value_or(std::numeric_limits<double>::infinity()));
  }
  return slowest;
}

std::string words_of(const Interruption& i, bool several) {
  const std::string whose = several ? fmt::format(", tag {}", i.tag) : std::string{};
  const std::string silent =
      i.silent > 0 ? fmt::format(", {:.2f} s without a measurement used", i.silent) : std::string{};
  const std::string after = i.recovery ? fmt::format("recovered {:.2f} s later", *i.recovery)
                                       : std::string{"not recovered within the recording"};
  const std::string truly = !i.usual_error ? std::string{}
                            : i.true_recovery
                                ? fmt::format(", by the truth {:.2f} s", *i.true_recovery)
                                : std::string{", by the truth not within the recording"};
  return fmt::format("at {:.2f} s{}: {}{}; {}{}", i.t, whose, i.cause, silent, after, truly);
}

double refused_share(const AnchorTally& tally) {
  const std::size_t all = tally.used + tally.refused;
  return all == 0 ? 0 : static_cast<double>(tally.refused) / static_cast<double>(all);
}

std::vector<Id> guilty_anchors(const Filtering& filtering) {
  constexpr std::size_t enough = 20;
  constexpr double most = 0.5;
  constexpr double times = 3;
  std::vector<double> shares;
  for (const auto& [id, tally] : filtering.of_anchor) shares.push_back(refused_share(tally));
  if (shares.size() < 3) return {};
  const double typical = median(shares);
  std::vector<Id> guilty;
  for (const auto& [id, tally] : filtering.of_anchor) {
    const double share = refused_share(tally);
    if (tally.used + tally.refused >= enough && share > most && share > times * typical) {
      guilty.push_back(id);
    }
  }
  return guilty;
}

Replay replay_filtered(Settings settings, const Recording& recording,
                       const std::function<void(std::size_t, std::size_t)>& progress) {
  const Site& site = recording.site;
  if (settings.side == Side::kUnknown && settings.height) {
    settings.side = side_of(*settings.height, site.anchors);
  }
  Replay result;
  result.filtering.emplace();
  Filtering& f = *result.filtering;
  Plan plan;
  plan.dim = result.dim = choose_dim(settings, site.anchors);
  plan.flat = plan.dim == 2 && !settings.height;
  result.residuals_to_truth = !site.truth.empty();
  result.of_differences = recording.readings.empty();

  std::vector<Reading> readings = usable_readings(settings, site, recording.readings, result);
  std::vector<Difference> differences =
      usable_differences(settings, site, plan.flat, recording.differences, result);
  std::set<Id> heard;
  for (const Reading& r : readings) heard.insert(r.tag);
  for (const Difference& d : differences) heard.insert(d.tag);
  f.samples = recording.samples.size();
  const bool several = apart_in_plan(site.tags, heard);
  const bool one_body = several || heard.size() == 1;
  if (!recording.samples.empty()) {
    if (!one_body) {
      f.unused_unit = "several tags, and no tags file that tells where they sit on one body";
    } else if (plan.dim == 2 && !several) {
      f.unused_unit = "one tag in the plane has no heading; --dim 3 uses it";
    } else {
      f.unused_unit = elsewhen(recording.samples, readings, differences)
                          ? "none of its samples is from the time of the measurements"
                          : implausible(recording.samples);
      plan.unit = f.unused_unit.empty();
    }
  }
  plan.body = (several && plan.dim == 2) || (plan.unit && plan.dim == 3);
  if (site.network && (!plan.body || plan.flat)) {
    throw Failure{
        "--bias-network needs the body's attitude, so --tags with two or more lever arms in the "
        "plane, or --imu, and heights, so --height or --dim 3"};
  }
  if (plan.body && !site.tags.empty()) {
    // A tag that sits nobody knows where is of no use to the body.
    std::erase_if(readings, [&](const Reading& r) { return !site.tags.contains(r.tag); });
    std::erase_if(differences, [&](const Difference& d) { return !site.tags.contains(d.tag); });
  }
  f.motion = words_for(plan);
  f.apart = heard.size() > 1 && !plan.body;
  f.apart_in_space = f.apart && several;
  plan.clock_resets = recording.counts.clock_resets;
  std::ranges::sort(plan.clock_resets, {}, &ClockReset::t);

  const double of_difference = settings.sigma.value_or(kRangeSigma) * std::numbers::sqrt2;
  constexpr double longest = 1e8;  // [s]; three years
  const double middle = middle_time(readings, differences);
  const auto too_late = [&](const auto& m) { return !(std::abs(m.t - middle) < longest); };
  const std::size_t dropped =
      std::erase_if(readings, too_late) + std::erase_if(differences, too_late);
  if (dropped > 0) {
    result.refused_readings[std::string{reason_name(Error::NumericOverflow)}] += dropped;
  }

  plan.start = std::numeric_limits<double>::infinity();
  for (const Reading& r : readings) plan.start = std::min(plan.start, r.t);
  for (const Difference& d : differences) plan.start = std::min(plan.start, d.t);

  for (const Reading& r : readings) {
    plan.streams[plan.body ? kBody : r.tag].measurements.push_back(
        {microseconds(r.t, plan.start), r.tag, r.anchor, r.anchor, r.range,
         r.sigma.value_or(settings.sigma.value_or(kRangeSigma)), false, false});
  }
  for (const Difference& d : differences) {
    plan.streams[plan.body ? kBody : d.tag].measurements.push_back(
        {microseconds(d.t, plan.start), d.tag, d.anchor_a, d.anchor_b, d.difference,
         d.sigma.value_or(of_difference), true, false});
  }
  for (auto& [tag, stream] : plan.streams) {
    std::ranges::stable_sort(stream.measurements, {}, &TimedMeasurement::time);
    mark_shared(stream.measurements);
  }
  for (const EpochEnd& end :
       epoch_ends(settings, site, plan.body, plan.dim, readings, differences, result)) {
    plan.streams[end.tag].ends.push_back(end.t);
  }
  for (auto& [tag, stream] : plan.streams) std::ranges::sort(stream.ends);
  for (const Id tag : heard) result.of_tag.try_emplace(tag);

  std::vector<InertialReading> samples;
  if (plan.unit) {
    samples = thinned(recording.samples);
    std::erase_if(samples, too_late);
    f.samples = samples.size();
  }
  follow_all(settings, site, plan, samples, result, progress);

  std::ranges::stable_sort(result.track, {}, &Position::t);
  std::ranges::stable_sort(f.interruptions, {}, &Interruption::t);
  f.mean_nees = mean_nees(site, f.spreads);
  if (result.residuals_to_truth) {
    residuals_against_truth(site, settings, plan.flat, readings, result);
    residuals_against_truth(site, settings, plan.flat, differences, result);
  }
  score(site, result);
  if (result.body) {
    std::ranges::stable_sort(result.body->track, {}, &SolvedPose::t);
    score_body(site, result.dim, *result.body);
  }
  const std::vector<TrackError> errors = errors_of(result);
  f.settled_rmse = settled_rmse(f, errors);
  judge_recoveries(errors, result.body.has_value(), f);
  if (result.body) {
    result.body->solve_seconds = result.solve_seconds;
    result.body->solve_calls = result.solve_calls;
  }
  return result;
}

}  // namespace uwbpos::host
