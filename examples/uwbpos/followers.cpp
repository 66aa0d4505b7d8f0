// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <numbers>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

#include "uwbpos/filter/tracker.hpp"

#include "failure.hpp"
#include "hypothesis.hpp"

namespace uwbpos::host {
namespace {

constexpr int kMostAnchors = 256;
constexpr double kLie = 3;  // a lie is metres long

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

// A tracker of one motion, with `Biases` for links, or one for an anchor that lies.
template <class Motion, int Biases>
class Follower final : public Hypothesis {
 public:
  Follower(const BankOptions& bank, const TrackerOptions<Motion>& options, const RadioNoise& noise,
           std::optional<Id> suspected)
      : bank_{bank}, options_{options}, noise_{noise} {
    liar = suspected;  // NOLINT(cppcoreguidelines-prefer-member-initializer): a base's
    if (Biases > 0) {
      options_.model.bias_sigma = liar ? kLie : noise.bias * bank.sigma;
      options_.model.bias_time = liar ? noise.lie_time : noise.bias_time;
    }
    make();
  }

  Verdict take(const TimedMeasurement& m) override {
    Verdict verdict;
    verdict.met_track = tracker_->tracking();
    const std::optional<Id> unheard = ignored_anchor(m);
    if (unheard || (liar && names(m, *liar))) verdict.disbelieved = unheard ? unheard : liar;
    std::optional<TimedMeasurement> told_of{m};
    // One that may lie by anything tells nothing of where to begin.
    if (unheard || (verdict.disbelieved && !verdict.met_track)) {
      told_of = without(m, *verdict.disbelieved);
      if (!told_of || ignored_anchor(*told_of)) {
        if (unheard) verdict.refused = Error::OutlierRejected;
        return verdict;
      }
    }
    if (keeps_early() && !verdict.met_track) early_.push_back({m.time, *told_of});
    const auto told = feed(*told_of, verdict.met_track ? now() : std::nullopt);
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
  [[nodiscard]] bool estimates_biases() const override { return Biases > 0 && !liar; }
  [[nodiscard]] std::optional<Measured<double>> lie() const override {
    if (!liar) return std::nullopt;
    const auto told = tracker_->bias(*liar);
    return told ? std::optional{*told} : std::nullopt;
  }
  [[nodiscard]] std::unique_ptr<Hypothesis> anew() const override {
    auto twin = std::make_unique<Follower>(bank_, options_, noise_, liar);
    twin->ignored = ignored;
    twin->suspicious = suspicious;
    twin->handicap = handicap;
    return twin;
  }

 private:
  static constexpr TrackerSize kSize{.anchors = kMostAnchors,
                                     .tags = 16,
                                     .biases = Biases,
                                     .window = kDriven<Motion> ? 512 : 128,
                                     .stride = 32,
                                     .bias_by_link = Biases > 1};
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

  static bool names(const TimedMeasurement& m, Id anchor) {
    return m.anchor_b == anchor || (m.is_difference && m.anchor_a == anchor);
  }

  [[nodiscard]] std::optional<Id> ignored_anchor(const TimedMeasurement& m) const {
    if (ignored.contains(m.anchor_b)) return m.anchor_b;
    if (m.is_difference && ignored.contains(m.anchor_a)) return m.anchor_a;
    return std::nullopt;
  }

  // What is left of two differences of one time to an anchor that is not believed: that of their
  // other anchors, (d_b - d_x) - (d_a - d_x). Nothing for the first of them, and for a range.
  std::optional<TimedMeasurement> without(const TimedMeasurement& m, Id anchor) {
    if (!m.is_difference) return std::nullopt;
    TimedMeasurement from = m;  // from `anchor`
    if (m.anchor_b == anchor) {
      std::swap(from.anchor_a, from.anchor_b);
      from.value = -m.value;
    }
    const auto same = [&](const TimedMeasurement& other) {
      return other.anchor_a == anchor && other.time == m.time && other.tag == m.tag &&
             other.anchor_b != from.anchor_b;
    };
    if (!half_ || !same(*half_)) {
      half_ = from;
      return std::nullopt;
    }
    TimedMeasurement rest = from;
    rest.anchor_a = half_->anchor_b;
    rest.value = from.value - half_->value;
    rest.sigma = std::hypot(from.sigma, half_->sigma);
    if (m.shared) rest.sigma /= std::numbers::sqrt2;  // the arrival that both share goes
    rest.shared = true;                               // with others of its time, that of `half_`
    return rest;
  }

  [[nodiscard]] bool keeps_early() const { return bank_.network && Motion::kHasHeading; }

  void make() {
    tracker_ = std::make_unique<Following>(options_);
    const auto expect = [](const Result<void>& added, const char* what) {
      if (!added) throw Failure{std::string{what} + ": " + std::string{describe(added.error())}};
    };
    for (const auto& [id, position] : bank_.anchors) {
      expect(tracker_->add_anchor(id, position), "anchors for --filter");
    }
    if constexpr (Biases == 1) expect(tracker_->expect_bias(*liar), "anchors for --filter");
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
    const double sigma = noise_.white * m.sigma;
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
  RadioNoise noise_;
  std::unique_ptr<Following> tracker_;
  std::deque<Early> early_;
  std::optional<TimedMeasurement> half_;  // of `without`: the first of its time
};

template <class Motion>
TrackerOptions<Motion> options_for(const BankOptions& bank, const Motion& motion) {
  TrackerOptions<Motion> options;
  options.model.motion = motion;
  constexpr int D = Motion::kDimension;
  // Some epochs may be lost.
  constexpr double epochs = 3.5e6;
  const double gap = std::min(epochs * bank.period, static_cast<double>(kLongestTrackGap));
  options.max_gap = std::max(options.max_gap, static_cast<std::int64_t>(gap));
  if (bank.prior) options.locate.prior = bank.prior->head<D>();
  if constexpr (D == 3) {
    if (bank.side) options.locate.side = *bank.side;
  }
  if constexpr (requires { options.model.motion.height; }) {
    options.model.motion.height = bank.height;
  }
  return options;
}

// One for a liar, else of links.
template <int Biases, class Motion>
std::unique_ptr<Hypothesis> make(const BankOptions& bank, const TrackerOptions<Motion>& options,
                                 const RadioNoise& noise, std::optional<Id> liar = std::nullopt) {
  return std::make_unique<Follower<Motion, Biases>>(bank, options, noise, liar);
}

template <class Motion>
std::unique_ptr<Hypothesis> make_liar_or_none(const BankOptions& bank,
                                              const TrackerOptions<Motion>& options,
                                              const RadioNoise& noise, std::optional<Id> liar) {
  return liar ? make<1>(bank, options, noise, liar) : make<0>(bank, options, noise);
}

}  // namespace

std::unique_ptr<Hypothesis> follower(const BankOptions& bank,
                                     const ConstantVelocity<double, 2>& motion,
                                     const RadioNoise& noise, std::optional<Id> liar) {
  return make_liar_or_none(bank, options_for(bank, motion), noise, liar);
}

std::unique_ptr<Hypothesis> follower(const BankOptions& bank,
                                     const ConstantVelocity<double, 3>& motion,
                                     const RadioNoise& noise, std::optional<Id> liar) {
  return make_liar_or_none(bank, options_for(bank, motion), noise, liar);
}

std::unique_ptr<Hypothesis> follower(const BankOptions& bank, const Inertial<double>& motion,
                                     const RadioNoise& noise, const Measured<double>& heading,
                                     std::optional<Id> liar) {
  auto options = options_for(bank, motion);
  options.heading = heading;
  return make_liar_or_none(bank, options, noise, liar);
}

std::unique_ptr<Hypothesis> follower(const BankOptions& bank, const PlanarBody<double>& motion,
                                     const RadioNoise& noise, double gate_sigmas) {
  constexpr int most = 32;  // links whose bias is estimated
  auto options = options_for(bank, motion);
  options.model.gate.sigmas = gate_sigmas;
  return noise.bias > 0 ? make<most>(bank, options, noise) : make<0>(bank, options, noise);
}

}  // namespace uwbpos::host
