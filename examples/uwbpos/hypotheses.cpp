// SPDX-License-Identifier: MIT
#include "hypotheses.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <utility>

namespace uwbpos::host {
namespace {

constexpr double kMemory = 10;          // T of (1) [s]
constexpr double kOutlierShare = 0.05;  // ε
constexpr double kCorrelated = 10;      // successive errors of a link that are as good as one
constexpr double kOutlierWidth = 10;    // w [m]
constexpr double kLateStart = 50;       // what a track that begins later is behind the best
constexpr double kConvicted = 5;        // in credit, what is known beforehand counts for
constexpr double kDecided = 30;         // by such a score it is known which anchor lies
constexpr std::int64_t kSecond = 1'000'000;
constexpr std::int64_t kRemembered = 10 * kSecond;
constexpr std::size_t kMostRemembered = 30'000;
constexpr std::size_t kMostSuspects = 16;  // of more anchors one misleads nobody

// What hypotheses are compared by. Errors of a radio outlast a measurement, as what bends its waves
// does: so many count as one, or the noise of correlated errors would pass for motion.
double credit(const Hypothesis& h) { return h.score / kCorrelated - h.handicap; }

// Whether what it estimates is a lie, not the small bias that any anchor has. Once it is known who
// lied that does not matter.
bool stands(const Hypothesis& h) {
  constexpr double least = 0.5;  // [m]
  constexpr double sigmas = 3;
  if (!h.tracking() || h.asleep) return false;
  if (!h.liar || !h.suspicious) return true;
  const auto lie = h.lie();
  return lie && std::abs(lie->value) > least + sigmas * std::sqrt(lie->variance);
}

double log_likelihood(const Verdict& verdict) {
  double p = kOutlierShare / kOutlierWidth;
  if (verdict.used && verdict.used->variance > 0) {
    p += (1 - kOutlierShare) * std::exp(-verdict.used->normalised_square / 2) /
         std::sqrt(2 * std::numbers::pi * verdict.used->variance);
  }
  return std::log(p);
}

// A radio's errors: as they are told, or the default, and white; white, in a worse place than that;
// a little noise on biases of the links that change within seconds of driving, and more of both.
// White and less: never, what is correlated looks like little noise.
constexpr std::array<RadioNoise, 6> kRadioNoises{
    {{1}, {1.8}, {0.3, 0.45, 1}, {0.3, 0.6, 3}, {0.6, 1.2, 1}, {0.6, 1.2, 3}}};

// Of gates, unless there is a reason for another: the library's own [standard deviations].
constexpr double kGate = GateOptions<double>{}.sigmas;

// One tag alone tells too little of its links' biases, and estimating them costs accuracy.
constexpr std::array<RadioNoise, 2> kWhiteNoises{{{1}, {1.8}}};

// Feeds hypotheses, `since` the last measurement [µs]. Calls `told(h, verdict)` of each.
template <class Told>
void feed(const std::vector<std::unique_ptr<Hypothesis>>& hypotheses, const TimedMeasurement& m,
          std::int64_t since, const Told& told) {
  const double kept =
      std::exp(-1e-6 * static_cast<double>(std::max<std::int64_t>(since, 0)) / kMemory);
  double leading = -std::numeric_limits<double>::infinity();
  std::vector<Hypothesis*> fresh;
  for (const auto& h : hypotheses) {
    if (h->asleep) continue;
    const Verdict verdict = h->take(m);
    if (verdict.met_track && h->tracking()) {
      h->score *= kept;
      if (!verdict.is_repeat()) {
        h->score += log_likelihood(verdict);
        ++h->met;
        if (!verdict.used) ++h->refused;
      }
      leading = std::max(leading, h->score);
    } else if (h->tracking()) {
      fresh.push_back(h.get());
    }
    told(*h, verdict);
  }
  const bool behind = std::isfinite(leading);
  for (Hypothesis* h : fresh) {
    h->late = behind ? kLateStart : 0;
    h->score = behind ? leading - h->late : 0;
  }
}

}  // namespace

HypothesisBank::HypothesisBank(BankOptions options) : options_{std::move(options)} {
  for (const auto& [a, place] : options_.anchors) {
    for (const auto& [b, other] : options_.anchors) {
      extent_ = std::max(extent_, (place - other).norm());
    }
  }
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
  // One may begin to lie at any time: by a decimetre in the first second.
  constexpr RadioNoise noise{.lie_time = 2'000};
  // Behind those that move alike.
  const double handicap = options_.motion == BodyMotion::kPlanarBody ? 15 : 3;
  if (options_.anchors.size() > kMostSuspects) return;
  const auto add = [&](std::unique_ptr<Hypothesis> h, std::set<Id> ignored) {
    h->ignored = std::move(ignored);
    h->suspicious = true;
    h->handicap = handicap;
    all_.push_back(std::move(h));
  };
  const auto add_moving = [&](const std::set<Id>& ignored, std::optional<Id> liar) {
    if (options_.motion == BodyMotion::kPlanarBody) {
      // Its tags' ranges are many: without those of an anchor there are enough.
      if (liar) return;
      PlanarBody<double> motion;
      motion.acceleration = 0.2;
      motion.sideward_acceleration = 0.05;
      motion.turn_acceleration = 0.5;
      motion.height = options_.height;
      add(follower(options_, motion, {}, kGate), ignored);
      return;
    }
    for (const double acceleration : {0.5, 3.0}) {
      if (options_.motion == BodyMotion::kPointInPlane) {
        const ConstantVelocity<double, 2> motion{acceleration, options_.height};
        add(follower(options_, motion, noise, liar), ignored);
      } else {
        const ConstantVelocity<double, 3> motion{acceleration, 0};
        add(follower(options_, motion, noise, liar), ignored);
      }
    }
  };
  add_moving({}, std::nullopt);
  for (const auto& [id, position] : options_.anchors) {
    add_moving({id}, std::nullopt);
    add_moving({}, id);
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
      PlanarBody<double> motion;
      motion.acceleration = forward;
      motion.sideward_acceleration = sideward;
      motion.turn_acceleration = angular;
      motion.height = options_.height;
      // Several tags tell enough of each other to do without all that bends or echoes, unless that
      // is estimated.
      constexpr double narrow = 2;
      all_.push_back(follower(options_, motion, noise, noise.bias > 0 ? kGate : narrow));
      all_.back()->handicap = less;
      less += handicap;
    }
  }
}

void HypothesisBank::add_points(int dimension) {
  for (const RadioNoise& noise : kWhiteNoises) {
    for (const double acceleration : {0.15, 0.5, 1.5, 5.0}) {
      if (dimension == 2) {
        const ConstantVelocity<double, 2> motion{acceleration, options_.height};
        all_.push_back(follower(options_, motion, noise, liar_));
      } else {
        const ConstantVelocity<double, 3> motion{acceleration, 0};
        all_.push_back(follower(options_, motion, noise, liar_));
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
      constexpr double spread = 0.4;  // [rad], half of the way to the next
      const Measured<double> heading{wrap_angle(2 * std::numbers::pi * k / yaws), spread * spread};
      Inertial<double> motion;
      motion.accelerometer_noise = accelerometer;
      motion.gyro_noise = gyro;
      all_.push_back(follower(options_, motion, radio, heading, liar_));
    }
  }
}

void HypothesisBank::choose() {
  best_ = nullptr;
  // Once it is known who lies, others follow that lie better, and another is suspected only with
  // more reason.
  const auto belief = [this](const Hypothesis& h) {
    return credit(h) - (h.suspicious && liar_ ? kConvicted : 0);
  };
  for (const auto& h : all_) {
    if (!stands(*h) || (h->suspicious && h->liar && h->liar == liar_)) continue;
    if (best_ == nullptr || belief(*h) > belief(*best_)) best_ = h.get();
  }
}

Verdict HypothesisBank::take(const TimedMeasurement& m) {
  const Hypothesis* const judge = best_;
  Verdict told;
  feed(all_, m, m.time - last_, [&](Hypothesis& h, const Verdict& verdict) {
    if (judge == nullptr ? &h == all_.front().get() : &h == judge) told = verdict;
    if (&h == listener_ && verdict.met_track && !verdict.is_repeat()) note_of_listener(m, verdict);
  });
  heard_.insert(m.anchor_b);
  if (m.is_difference) heard_.insert(m.anchor_a);
  if (judge != nullptr && !told.is_repeat()) ++met_;
  last_ = std::max(last_, m.time);
  remember({m.time, m});
  choose();
  judge_anchors(m.time);
  rest(m.time);
  weed(m.time);
  return told;
}

void HypothesisBank::take(std::int64_t time, const InertialReading& sample) {
  // What began without the unit knows nothing of the attitude that it tells changes of.
  if (!fed_by_unit_ && best_ != nullptr && options_.motion == BodyMotion::kInertial) {
    restart_inertial();
    choose();
  }
  fed_by_unit_ = true;
  remember({time, sample});
  for (const auto& h : all_) h->take(time, sample);
}

void HypothesisBank::remember(const Heard& heard) {
  if (options_.anchors.size() > kMostSuspects) return;  // nobody is going to ask
  history_.push_back(heard);
  while (history_.size() > 1 &&
         (last_ - history_.front().time > kRemembered || history_.size() > kMostRemembered)) {
    history_.pop_front();
  }
}

void HypothesisBank::begin_anew() {
  // The one that knew better tells what was to be scored since then.
  const double leading = best_->score;
  std::vector<std::unique_ptr<Hypothesis>> others;
  for (auto& h : all_) {
    if (h->suspicious) others.push_back(std::move(h));
  }
  all_.clear();
  add_all();
  all_.push_back(best_->anew());
  std::int64_t last = history_.front().time;
  for (const Heard& heard : history_) {
    if (const auto* m = std::get_if<TimedMeasurement>(&heard.what)) {
      feed(all_, *m, m->time - last, [](Hypothesis&, const Verdict&) {});
      last = std::max(last, m->time);
    } else {
      for (const auto& h : all_) h->take(heard.time, std::get<InertialReading>(heard.what));
    }
  }
  const double gained = all_.back()->tracking() ? leading - all_.back()->score : leading;
  all_.pop_back();
  for (const auto& h : all_) {
    if (h->tracking()) h->score += gained;
  }
  std::ranges::move(others, std::back_inserter(all_));
  choose();
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
    if (record.count > enough && record.refused > liar && left > fewest && anchor != liar_) {
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
    if (!h->suspicious || !h->ignored.empty() || h->liar || !stands(*h)) continue;
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
  if (!best_->suspicious || (best_->ignored == ignored_ && best_->liar == liar_)) return;
  double other = -std::numeric_limits<double>::infinity();
  for (const auto& h : all_) {
    if (!h->suspicious && h->tracking()) other = std::max(other, h->score);
  }
  if (best_->score - other < hopeless) return;
  judged_ = time;
  ignored_ = best_->ignored;
  liar_ = best_->liar;
  begin_anew();
}

std::optional<Error> HypothesisBank::withheld(std::int64_t time) {
  constexpr std::int64_t longest = 2 * kSecond;
  if (settled_) return std::nullopt;
  // Which anchor lies, a body that stands may leave open for long; that none does is soon believed.
  const bool soon = time - begun_ <= longest || met_ < 5 * heard_.size();
  constexpr std::size_t share = 6;
  const bool misled = share * best_->refused > best_->met;
  if (soon && (misled || is_early(time))) return Error::NotYetLocated;
  if ((soon || best_->doubts()) && has_rival(time)) return Error::AmbiguousSolution;
  settled_ = !soon;
  return std::nullopt;
}

// One that does without an anchor may need a few more measurements to begin.
bool HypothesisBank::is_early(std::int64_t time) const {
  if (options_.motion == BodyMotion::kPlanarBody || options_.anchors.size() > kMostSuspects) {
    return false;
  }
  return met_ < 2 * heard_.size() ||
         (time - begun_ < kSecond / 2 &&
          std::ranges::any_of(
              all_, [](const auto& h) { return h->suspicious && !h->asleep && !h->tracking(); }));
}

bool HypothesisBank::has_rival(std::int64_t time) const {
  constexpr double apart = 0.5;  // [m]
  constexpr double sigmas = 2.5;
  const auto mine = best_->at(time);
  if (!mine) return false;
  // What one has foretold since it began: to begin later is no fault yet.
  const auto foretold = [](const Hypothesis& h) { return h.score + h.late; };
  return std::ranges::any_of(all_, [&](const auto& h) {
    if (!h->suspicious || !stands(*h)) return false;
    if (foretold(*best_) - foretold(*h) > kDecided) return false;
    const auto other = h->at(time);
    if (!other) return false;
    const double spread = std::sqrt(mine->covariance.trace() + other->covariance.trace());
    return (other->position - mine->position).norm() > apart + sigmas * spread;
  });
}

void HypothesisBank::rest(std::int64_t time) {
  constexpr double hopeless = 100;
  constexpr std::int64_t pause = 5 * kSecond;
  if (begun_ < 0 || time - begun_ < kSecond) return;
  for (auto& h : all_) {
    if (!h->suspicious || h.get() == best_) continue;
    if (h->asleep) {
      if (time >= *h->asleep) h = h->anew();
    } else if (best_ != nullptr && best_->score - h->score > hopeless) {
      if (h.get() == listener_) listener_ = nullptr;
      h->asleep = time + pause;
    }
  }
}

void HypothesisBank::restart_inertial() {
  std::erase_if(all_, [](const auto& h) { return h->inertial(); });
  const std::size_t before = all_.size();
  add_inertial();
  for (std::size_t i = before; i < all_.size(); ++i) all_[i]->ignored = ignored_;
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
      restart_inertial();
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
  if (best_ == nullptr) return std::unexpected(Error::NotYetLocated);
  if (const auto why = withheld(time)) return std::unexpected(*why);
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
      if (h->estimates_biases() != family || !stands(*h)) continue;
      if (h->suspicious && !best_->suspicious) continue;
      if (leader == nullptr || credit(*h) > credit(*leader)) leader = h.get();
    }
    for (const auto& h : all_) {
      if (h->estimates_biases() != family || !stands(*h)) continue;
      if (h->suspicious && !best_->suspicious) continue;
      const double weight = std::exp(credit(*h) - credit(*leader));
      if (weight < 1e-3) continue;
      // Of who lies there is no mean.
      const bool agree = h->ignored == best_->ignored && h->liar == best_->liar;
      if (!agree && best_->score - h->score > kDecided) continue;
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
  // What is no better known than that it is somewhere about is not known.
  constexpr double somewhere = 0.25;
  if (!(mixed.covariance.trace() < somewhere * somewhere * extent_ * extent_)) {
    return std::unexpected(Error::NotYetLocated);
  }
  return mixed;
}

std::optional<Vec3> HypothesisBank::place(Id tag) const {
  return best_ == nullptr ? std::nullopt : best_->place(tag);
}

}  // namespace uwbpos::host
