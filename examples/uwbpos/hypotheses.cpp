// SPDX-License-Identifier: MIT
#include "hypotheses.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <numbers>
#include <type_traits>
#include <utility>
#include <variant>

#include "uwbpos/filter/motion/constant_velocity.hpp"
#include "uwbpos/filter/motion/inertial.hpp"
#include "uwbpos/filter/motion/planar_body.hpp"
#include "uwbpos/filter/tracker.hpp"

#include "failure.hpp"

namespace uwbpos::host {
namespace {

constexpr double kMemory = 10;          // T of (1) [s]
constexpr double kOutlierShare = 0.05;  // ε
constexpr double kCorrelated = 10;      // successive errors of a link that are as good as one
constexpr double kOutlierWidth = 10;    // w [m]
constexpr double kLateStart = 50;       // what a track that begins later is behind the best
constexpr std::int64_t kSecond = 1'000'000;
constexpr int kMostAnchors = 256;
constexpr std::size_t kMostSuspects = 16;  // of more anchors one misleads nobody

Rotation rotation_of(const Quaternion<double>& q) { return {q[1], q[2], q[3], q[0]}; }

Mat<double, 3> attitude_of(const BodyPose<double>& p) {
  return rotation_matrix(quaternion_from_yaw(p.pose.heading));
}
Mat<double, 3> attitude_of(const InertialPose<double>& p) {
  return rotation_matrix(p.body.orientation);
}

Estimate estimate_of(const MovingPoint<double, 3>& p, double) {
  return {p.position, p.covariance.topLeftCorner<3, 3>()};
}
Estimate estimate_of(const MovingPoint<double, 2>& p, double height) {
  Estimate e{{p.position[0], p.position[1], height}};
  e.covariance.topLeftCorner<2, 2>() = p.covariance.topLeftCorner<2, 2>();
  return e;
}
Estimate estimate_of(const BodyPose<double>& p, double height) {
  Estimate e{{p.pose.position[0], p.pose.position[1], height}};
  e.covariance.topLeftCorner<2, 2>() = p.pose.covariance.topLeftCorner<2, 2>();
  e.heading = {p.pose.heading, p.pose.covariance(2, 2)};
  return e;
}
Estimate estimate_of(const InertialPose<double>& p, double) {
  Estimate e{p.body.position, p.covariance.topLeftCorner<3, 3>()};
  e.heading = {p.heading, p.heading_variance};
  e.attitude = rotation_of(p.body.orientation);
  return e;
}

// Whether an inertial unit drives a motion.
template <class Motion>
constexpr bool kDriven = std::is_same_v<Motion, Inertial<double>>;

// What a radio's errors are taken for.
struct RadioNoise {
  double white = 1;      // times the sigmas of what a tracker is fed
  double bias = 0;       // of links, times the typical sigma
  double bias_time = 0;  // in which they change [s]
};

// A tracker of one motion, with `Biases` for links.
template <class Motion, int Biases>
class Follower final : public Hypothesis {
 public:
  Follower(const BankOptions& bank, const TrackerOptions<Motion>& options, const RadioNoise& noise)
      : bank_{bank}, options_{options}, factor_{noise.white} {
    if (Biases > 0) {
      options_.model.bias_sigma = noise.bias * bank.sigma;
      options_.model.bias_time = noise.bias_time;
    }
    make();
  }

  Verdict take(const TimedMeasurement& m) override {
    Verdict verdict;
    verdict.met_track = tracker_->tracking();
    if (ignored.contains(m.anchor_b) || (m.is_difference && ignored.contains(m.anchor_a))) {
      verdict.refused = Error::OutlierRejected;
      return verdict;
    }
    if (keeps_early() && !verdict.met_track) early_.push_back({m.time, m});
    const auto told = feed(m, verdict.met_track ? now() : std::nullopt);
    if (!told) {
      verdict.refused = told.error();
    } else {
      verdict.reopened = told->event == TrackEvent::Reopened;
      verdict.began = told->event == TrackEvent::Started;
      if (told->event == TrackEvent::Used) verdict.used = told->innovation;
    }
    if (verdict.began) unbias_start();
    return verdict;
  }

  void take(std::int64_t time, const InertialReading& sample) override {
    if constexpr (!requires { options_.model.motion.height; } || Motion::kHasHeading) {
      if (keeps_early() && !tracker_->tracking()) early_.push_back({time, sample});
      // A sample that is refused is one of a time that ranges tell of, too.
      static_cast<void>(tracker_->update(of(time, sample)));
    }
  }

  Result<Estimate> at(std::int64_t time) override {
    if (const auto moved = tracker_->predict_to(time); !moved) {
      return std::unexpected(moved.error());
    }
    const auto pose = tracker_->pose();
    if (!pose) return std::unexpected(pose.error());
    Estimate estimate = estimate_of(*pose, bank_.height);
    if (!all_finite(estimate.position) || !estimate.covariance.allFinite()) {
      return std::unexpected(Error::NotFinite);
    }
    return estimate;
  }

  [[nodiscard]] std::optional<Vec3> place(Id tag) const override {
    if (!tracker_->tracking()) return std::nullopt;
    return options_.model.motion.place(tracker_->track().state, lever(tag));
  }
  [[nodiscard]] bool tracking() const override { return tracker_->tracking(); }
  [[nodiscard]] bool inertial() const override { return kDriven<Motion>; }
  [[nodiscard]] bool estimates_biases() const override { return Biases > 0; }

 private:
  static constexpr TrackerSize kSize{.anchors = kMostAnchors,
                                     .tags = 16,
                                     .biases = Biases,
                                     .window = kDriven<Motion> ? 512 : 128,
                                     .stride = 32,
                                     .bias_by_link = true};
  using Following = Tracker<Motion, kSize>;

  // What biases of links depend on.
  struct Attitude {
    Mat<double, 3> map_R_body;
    Vec3 position;
  };
  struct Early {
    std::int64_t time;
    std::variant<TimedMeasurement, InertialReading> what;
  };

  [[nodiscard]] bool keeps_early() const { return bank_.network && Motion::kHasHeading; }

  void make() {
    tracker_ = std::make_unique<Following>(options_);
    const auto expect = [](const Result<void>& added, const char* what) {
      if (!added) throw Failure{std::string{what} + ": " + std::string{describe(added.error())}};
    };
    for (const auto& [id, position] : bank_.anchors) {
      expect(tracker_->add_anchor(id, position), "anchors for --filter");
    }
    if constexpr (Motion::kHasHeading) {
      for (const auto& [id, arm] : bank_.tags) {
        expect(tracker_->add_tag(id, arm), "tags for --filter");
      }
    }
  }

  static ImuSample<double> of(std::int64_t time, const InertialReading& sample) {
    return {time, sample.gyro, sample.accelerometer};
  }

  [[nodiscard]] Vec3 lever(Id tag) const {
    const auto found = bank_.tags.find(tag);
    return Motion::kHasHeading && found != bank_.tags.end() ? found->second : Vec3{Vec3::Zero()};
  }

  [[nodiscard]] std::optional<Attitude> now() const {
    if constexpr (Motion::kHasHeading) {
      if (!bank_.network) return std::nullopt;
      const auto& track = tracker_->track();
      const auto pose = options_.model.motion.pose(track.time, track.state, track.covariance);
      return Attitude{attitude_of(pose),
                      options_.model.motion.place(track.state, Vec3{Vec3::Zero()})};
    } else {
      return std::nullopt;
    }
  }

  [[nodiscard]] double bias(const std::optional<Attitude>& from, Id tag, Id anchor) const {
    if (!from) return 0;
    const Vec3 place = from->position + from->map_R_body * lever(tag);
    const Vec3 offset = bank_.anchors.at(anchor) - place;
    return bank_.network->bias(tag, anchor, offset, from->map_R_body).value_or(0);
  }

  auto feed(const TimedMeasurement& m, const std::optional<Attitude>& from) {
    const double sigma = factor_ * m.sigma;
    if (m.is_difference) {
      const double value =
          m.value - (bias(from, m.tag, m.anchor_b) - bias(from, m.tag, m.anchor_a));
      return tracker_->update(
          TimedDifference<double>{m.time, m.anchor_a, m.anchor_b, value, sigma, m.tag, m.shared});
    }
    const double value = m.value - bias(from, m.tag, m.anchor_b);
    return tracker_->update(TimedRange<double>{m.time, m.anchor_b, value, sigma, m.tag});
  }

  // The network needs a pose, the first pose the network: begins again with the biases at the
  // pose that biased measurements gave, twice.
  void unbias_start() {
    if (!keeps_early()) return;
    for (int round = 0; round < 2; ++round) {
      const auto from = now();
      const auto before = std::exchange(tracker_, nullptr);
      make();
      for (const Early& early : early_) {
        if (const auto* m = std::get_if<TimedMeasurement>(&early.what)) {
          static_cast<void>(feed(*m, from));
        } else if (const auto* sample = std::get_if<InertialReading>(&early.what)) {
          static_cast<void>(tracker_->update(of(early.time, *sample)));
        }
      }
      if (!tracker_->tracking()) return;  // it begins with what comes next
    }
    early_.clear();
  }

  const BankOptions& bank_;
  TrackerOptions<Motion> options_;
  double factor_;
  std::unique_ptr<Following> tracker_;
  std::deque<Early> early_;
};

// What hypotheses are compared by. Errors of a radio outlast a measurement, as what bends its waves
// does: so many count as one, or the noise of correlated errors would pass for motion.
double credit(const Hypothesis& h) { return h.score / kCorrelated - h.handicap; }

double log_likelihood(const Verdict& verdict) {
  double p = kOutlierShare / kOutlierWidth;
  if (verdict.used && verdict.used->variance > 0) {
    p += (1 - kOutlierShare) * std::exp(-verdict.used->normalised_square / 2) /
         std::sqrt(2 * std::numbers::pi * verdict.used->variance);
  }
  return std::log(p);
}

template <class Motion>
TrackerOptions<Motion> options_for(const BankOptions& bank) {
  TrackerOptions<Motion> options;
  constexpr int D = Motion::kDimension;
  if (bank.prior) options.locate.prior = bank.prior->head<D>();
  if constexpr (D == 3) {
    if (bank.side) options.locate.side = *bank.side;
  }
  if constexpr (requires { options.model.motion.height; }) {
    options.model.motion.height = bank.height;
  }
  return options;
}

// A radio's errors: as they are told, or the default, and white; white, in a worse place than that;
// a little noise on biases of the links that change within seconds of driving, and more of both.
// White and less: never, what is correlated looks like little noise.
constexpr std::array<RadioNoise, 6> kRadioNoises{
    {{1}, {1.8}, {0.3, 0.45, 1}, {0.3, 0.6, 3}, {0.6, 1.2, 1}, {0.6, 1.2, 3}}};

// One tag alone tells too little of its links' biases, and estimating them costs accuracy.
constexpr std::array<RadioNoise, 2> kWhiteNoises{{{1}, {1.8}}};

template <class Motion>
std::unique_ptr<Hypothesis> follower(const BankOptions& bank, const TrackerOptions<Motion>& options,
                                     const RadioNoise& noise) {
  return std::make_unique<Follower<Motion, 0>>(bank, options, noise);
}
std::unique_ptr<Hypothesis> follower(const BankOptions& bank,
                                     const TrackerOptions<PlanarBody<double>>& options,
                                     const RadioNoise& noise) {
  constexpr int most = 32;  // links whose bias is estimated
  using Estimating = Follower<PlanarBody<double>, most>;
  if (noise.bias > 0) return std::make_unique<Estimating>(bank, options, noise);
  return std::make_unique<Follower<PlanarBody<double>, 0>>(bank, options, noise);
}

}  // namespace

HypothesisBank::HypothesisBank(BankOptions options) : options_{std::move(options)} {
  add_all();
  add_suspicious();
}

void HypothesisBank::add_all() {
  const std::size_t before = all_.size();
  switch (options_.motion) {
    case BodyMotion::kPointInPlane:
      add_points(2);
      break;
    case BodyMotion::kPointInSpace:
      add_points(3);
      break;
    case BodyMotion::kInertial:
      add_points(3);
      add_inertial();
      break;
    case BodyMotion::kPlanarBody:
      add_bodies();
      break;
  }
  for (std::size_t i = before; i < all_.size(); ++i) all_[i]->ignored = ignored_;
}

void HypothesisBank::add_suspicious() {
  // Behind those that move alike.
  const double handicap = options_.motion == BodyMotion::kPlanarBody ? 15 : 3;
  if (options_.anchors.size() > kMostSuspects) return;
  std::vector<std::set<Id>> suspects{{}};
  for (const auto& [id, position] : options_.anchors) suspects.push_back({id});
  const auto add = [&](const auto& motion, const std::set<Id>& suspected) {
    auto o = options_for<std::decay_t<decltype(motion)>>(options_);
    const double height = options_.height;
    o.model.motion = motion;
    if constexpr (requires { o.model.motion.height; }) o.model.motion.height = height;
    all_.push_back(follower(options_, o, {}));
    all_.back()->ignored = suspected;
    all_.back()->suspicious = true;
    all_.back()->handicap = handicap;
  };
  for (const std::set<Id>& suspected : suspects) {
    if (options_.motion == BodyMotion::kPlanarBody) {
      add(
          PlanarBody<double>{
              .acceleration = 0.2, .sideward_acceleration = 0.05, .turn_acceleration = 0.5},
          suspected);
      continue;
    }
    for (const double acceleration : {0.5, 3.0}) {
      if (options_.motion == BodyMotion::kPointInPlane) {
        add(ConstantVelocity<double, 2>{.acceleration = acceleration}, suspected);
      } else {
        add(ConstantVelocity<double, 3>{.acceleration = acceleration}, suspected);
      }
    }
  }
}

void HypothesisBank::add_bodies() {
  // Forward, sideward [m/s²/√Hz] and angular [rad/s²/√Hz], from a trolley that is pushed at a walk
  // to a nimble robot. Each is believed a little less beforehand than the one before.
  constexpr std::array<std::array<double, 3>, 6> motions{{{0.01, 0.001, 0.05},
                                                          {0.02, 0.002, 0.1},
                                                          {0.05, 0.01, 0.15},
                                                          {0.2, 0.05, 0.5},
                                                          {0.5, 0.5, 1},
                                                          {2, 2, 4}}};
  constexpr double handicap = 4;
  for (const RadioNoise& noise : kRadioNoises) {
    double less = 0;
    for (const auto& [forward, sideward, angular] : motions) {
      auto o = options_for<PlanarBody<double>>(options_);
      o.model.motion.acceleration = forward;
      o.model.motion.sideward_acceleration = sideward;
      o.model.motion.turn_acceleration = angular;
      // Several tags tell enough of each other to do without all that bends or echoes, unless that
      // is estimated.
      if (noise.bias == 0) o.model.gate.sigmas = 2;
      all_.push_back(follower(options_, o, noise));
      all_.back()->handicap = less;
      less += handicap;
    }
  }
}

void HypothesisBank::add_points(int dimension) {
  const auto add = [this](auto motion, const RadioNoise& noise, double acceleration) {
    auto o = options_for<decltype(motion)>(options_);
    o.model.motion.acceleration = acceleration;
    all_.push_back(follower(options_, o, noise));
  };
  for (const RadioNoise& noise : kWhiteNoises) {
    for (const double acceleration : {0.15, 0.5, 1.5, 5.0}) {
      if (dimension == 2) {
        add(ConstantVelocity<double, 2>{}, noise, acceleration);
      } else {
        add(ConstantVelocity<double, 3>{}, noise, acceleration);
      }
    }
  }
}

void HypothesisBank::add_inertial() {
  constexpr int yaws = 8;
  // Noise of accelerometer and gyro, by how much the frame shakes.
  struct Noise {
    double accelerometer;
    double gyro;
    RadioNoise radio;
  };
  constexpr std::array<Noise, 3> noises{{{0.1, 0.005, {1}}, {0.5, 0.02, {1}}, {0.3, 0.01, {1.8}}}};
  for (const auto& [accelerometer, gyro, radio] : noises) {
    for (int k = 0; k < yaws; ++k) {
      auto o = options_for<Inertial<double>>(options_);
      constexpr double spread = 0.4;  // [rad], half of the way to the next
      o.heading = Measured<double>{wrap_angle(2 * std::numbers::pi * k / yaws), spread * spread};
      o.model.motion.accelerometer_noise = accelerometer;
      o.model.motion.gyro_noise = gyro;
      all_.push_back(follower(options_, o, radio));
    }
  }
}

void HypothesisBank::choose() {
  best_ = nullptr;
  for (const auto& h : all_) {
    if (h->tracking() && (best_ == nullptr || credit(*h) > credit(*best_))) best_ = h.get();
  }
}

Verdict HypothesisBank::take(const TimedMeasurement& m) {
  const double kept =
      std::exp(-1e-6 * static_cast<double>(std::max<std::int64_t>(m.time - last_, 0)) / kMemory);
  last_ = std::max(last_, m.time);
  const Hypothesis* const judge = best_;
  if (judge != nullptr) ++met_;
  Verdict told;
  double leading = -std::numeric_limits<double>::infinity();
  std::vector<Hypothesis*> fresh;
  for (const auto& h : all_) {
    const Verdict verdict = h->take(m);
    if (verdict.met_track && h->tracking()) {
      h->score = kept * h->score + log_likelihood(verdict);
      leading = std::max(leading, h->score);
    } else if (h->tracking()) {
      fresh.push_back(h.get());
    }
    if (judge == nullptr ? h == all_.front() : h.get() == judge) told = verdict;
    if (h.get() == listener_ && verdict.met_track) note_of_listener(m, verdict);
  }
  for (Hypothesis* h : fresh) h->score = std::isfinite(leading) ? leading - kLateStart : 0;
  choose();
  judge_anchors(m.time);
  weed(m.time);
  return told;
}

void HypothesisBank::take(std::int64_t time, const InertialReading& sample) {
  fed_by_unit_ = true;
  for (const auto& h : all_) h->take(time, sample);
}

void HypothesisBank::note_of_listener(const TimedMeasurement& m, const Verdict& verdict) {
  constexpr double step = 0.04;
  const auto note = [&](Id anchor) {
    AnchorRecord& record = records_[anchor];
    ++record.count;
    record.refused += step * ((verdict.used ? 0.0 : 1.0) - record.refused);
  };
  note(m.anchor_b);
  if (m.is_difference) note(m.anchor_a);
}

void HypothesisBank::ignore_liars() {
  constexpr std::size_t enough = 50;
  constexpr double liar = 0.8;
  constexpr double honest = 0.5;
  const bool planar =
      options_.motion == BodyMotion::kPointInPlane || options_.motion == BodyMotion::kPlanarBody;
  const std::size_t fewest = planar ? 3 : 4;
  std::set<Id> ignored = ignored_;
  for (const auto& [anchor, record] : records_) {
    if (record.count > enough && record.refused < honest) ignored.erase(anchor);
    // What is left must tell of another liar, at least by not fitting.
    const std::size_t left = options_.anchors.size() - ignored.size();
    if (record.count > enough && record.refused > liar && left > fewest) {
      ignored.insert(anchor);
    }
  }
  if (ignored == ignored_) return;
  ignored_ = ignored;
  for (const auto& h : all_) {
    if (!h->suspicious) h->ignored = ignored_;
  }
}

void HypothesisBank::judge_anchors(std::int64_t time) {
  listener_ = nullptr;
  for (const auto& h : all_) {
    if (!h->suspicious || !h->ignored.empty() || !h->tracking()) continue;
    if (listener_ == nullptr || h->score > listener_->score) listener_ = h.get();
  }
  // One that is lost itself is no witness.
  constexpr double credible = 30;
  if (listener_ != nullptr && best_ != nullptr && best_->score - listener_->score > credible) {
    listener_ = nullptr;
    records_.clear();
  }
  ignore_liars();
  constexpr std::int64_t pause = kSecond / 2;
  constexpr double hopeless = 60;
  if (best_ == nullptr) return;
  if (begun_ < 0) begun_ = time;
  if (time - judged_ < pause || time - begun_ < pause) return;
  if (!best_->suspicious || best_->ignored == ignored_) return;
  double other = -std::numeric_limits<double>::infinity();
  for (const auto& h : all_) {
    if (!h->suspicious && h->tracking()) other = std::max(other, h->score);
  }
  if (best_->score - other < hopeless) return;
  judged_ = time;
  ignored_ = best_->ignored;
  std::erase_if(all_, [](const auto& h) { return !h->suspicious; });
  add_all();
}

bool HypothesisBank::disputed(std::int64_t time) {
  constexpr std::int64_t longest = kSecond;
  constexpr double apart = 0.5;  // [m]
  constexpr double sigmas = 2.5;
  constexpr double decided = 30;  // in score
  if (time - begun_ > longest) return false;
  // One that does without an anchor may need another measurement to begin.
  if (options_.motion != BodyMotion::kPlanarBody && time - begun_ < kSecond / 8 &&
      options_.anchors.size() <= kMostSuspects &&
      (met_ < 2 * options_.anchors.size() ||
       std::ranges::any_of(all_, [](const auto& h) { return h->suspicious && !h->tracking(); }))) {
    return true;
  }
  const auto mine = best_->at(time);
  if (!mine) return false;
  return std::ranges::any_of(all_, [&](const auto& h) {
    if (!h->suspicious || !h->tracking() || best_->score - h->score > decided) return false;
    const auto other = h->at(time);
    if (!other) return false;
    const double spread = std::sqrt(mine->covariance.trace() + other->covariance.trace());
    return (other->position - mine->position).norm() > apart + sigmas * spread;
  });
}

void HypothesisBank::weed(std::int64_t time) {
  if (options_.motion != BodyMotion::kInertial || time - weeded_ < kSecond || best_ == nullptr) {
    return;
  }
  weeded_ = time;
  constexpr double hopeless = 40;
  constexpr double known = 0.15;  // [rad]
  constexpr double same = 0.1;    // [rad]
  constexpr std::int64_t rest = 10 * kSecond;
  double best_inertial = -std::numeric_limits<double>::infinity();
  bool any_inertial = false;
  for (const auto& h : all_) {
    if (!h->inertial()) continue;
    any_inertial = any_inertial || h->tracking();
    if (h->tracking()) best_inertial = std::max(best_inertial, h->score);
  }
  if (!best_->inertial()) {
    if (fed_by_unit_ && (!any_inertial || best_->score - best_inertial > hopeless) &&
        time - restarted_ > rest) {
      restarted_ = time;
      ++restarts_;
      std::erase_if(all_, [](const auto& h) { return h->inertial(); });
      const std::size_t before = all_.size();
      add_inertial();
      for (std::size_t i = before; i < all_.size(); ++i) all_[i]->ignored = ignored_;
    }
    return;
  }
  const auto winner = best_->at(time);
  if (!winner || !winner->heading || winner->heading->variance > known * known) return;
  // Those on the way to the same heading, and those that are lost.
  std::erase_if(all_, [&](const auto& h) {
    if (!h->inertial() || h.get() == best_) return false;
    if (!h->tracking() || h->score < best_->score - hopeless) return true;
    const auto e = h->at(time);
    return e && e->heading &&
           std::abs(angle_difference(e->heading->value, winner->heading->value)) < same &&
           h->score < best_->score - 8;
  });
}

Result<Estimate> HypothesisBank::at(std::int64_t time) {
  if (best_ == nullptr || disputed(time)) return std::unexpected(Error::NotYetLocated);
  const Result<Estimate> best = best_->at(time);
  if (!best) return best;
  struct Weighed {
    double weight;
    bool estimates_biases;
    Estimate estimate;
  };
  std::vector<Weighed> weighed;
  for (const bool family : {false, true}) {
    if (family && !best_->estimates_biases()) continue;
    const Hypothesis* leader = nullptr;
    for (const auto& h : all_) {
      if (h->estimates_biases() != family || !h->tracking()) continue;
      if (h->suspicious && !best_->suspicious) continue;
      if (leader == nullptr || credit(*h) > credit(*leader)) leader = h.get();
    }
    for (const auto& h : all_) {
      if (h->estimates_biases() != family || !h->tracking()) continue;
      if (h->suspicious && !best_->suspicious) continue;
      const double weight = std::exp(credit(*h) - credit(*leader));
      if (weight < 1e-3) continue;
      auto e = h.get() == best_ ? best : h->at(time);
      if (!e) continue;
      // One that knows no attitude has the tag for the body.
      if (!e->attitude && best->attitude && options_.tags.size() == 1) {
        e->position -= rotate(*best->attitude, options_.tags.begin()->second);
      }
      // The mean of two places is neither.
      const double reach = std::sqrt(best->covariance.trace()) + std::sqrt(e->covariance.trace());
      if ((e->position - best->position).norm() > 0.3 + 4 * reach) continue;
      weighed.push_back({weight, family, *e});
    }
  }
  std::array<double, 2> of_family{};
  for (const Weighed& w : weighed) of_family[w.estimates_biases ? 1 : 0] += w.weight;
  for (Weighed& w : weighed) w.weight /= of_family[w.estimates_biases ? 1 : 0];
  double total = 0;
  for (const double sum : of_family) total += sum > 0 ? 1 : 0;

  Estimate mixed = *best;
  mixed.position.setZero();
  mixed.covariance.setZero();
  double turn = 0;
  double of_heading = 0;
  for (const Weighed& w : weighed) {
    mixed.position += w.weight / total * w.estimate.position;
    if (!best->heading || !w.estimate.heading) continue;
    of_heading += w.weight;
    turn += w.weight * angle_difference(w.estimate.heading->value, best->heading->value);
  }
  if (mixed.heading) {
    turn /= of_heading;
    mixed.heading = {wrap_angle(best->heading->value + turn), 0};
  }
  // What white noise takes for certainty is not that: where biases are estimated, theirs counts.
  const bool honest = of_family[1] > 0;
  double counted = 0;
  double counted_heading = 0;
  for (const Weighed& w : weighed) {
    if (honest && !w.estimates_biases) continue;
    counted += w.weight;
    const Vec3 off = w.estimate.position - mixed.position;
    mixed.covariance += w.weight * (w.estimate.covariance + off * off.transpose());
    if (!mixed.heading || !w.estimate.heading) continue;
    counted_heading += w.weight;
    const double d = angle_difference(w.estimate.heading->value, mixed.heading->value);
    mixed.heading->variance += w.weight * (w.estimate.heading->variance + d * d);
  }
  mixed.covariance /= counted;
  if (mixed.heading) mixed.heading->variance /= counted_heading;
  return mixed;
}

std::optional<Vec3> HypothesisBank::place(Id tag) const {
  return best_ == nullptr ? std::nullopt : best_->place(tag);
}

}  // namespace uwbpos::host
