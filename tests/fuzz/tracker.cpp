// SPDX-License-Identifier: MIT

/// @file
/// Any sequence of measurements at all into trackers: ranges, differences, inertial samples,
/// heights, headings, speeds, turn rates, positions and velocities, near a body that drives in a
/// circle or absurd, in order, late, replayed, from other clocks. A pose is finite, its covariance
/// one; time goes on; every verdict has a name and is counted once; what is refused by name changes
/// nothing; a late measurement leaves the same bits as one in time; nothing touches the heap.

#include "uwbpos/filter/tracker.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <optional>
#include <span>
#include <type_traits>
#include <variant>

#include "uwbpos/filter/motion/constant_velocity.hpp"
#include "uwbpos/filter/motion/inertial.hpp"
#include "uwbpos/filter/motion/planar_body.hpp"
#include "uwbpos/filter/motion/planar_robot.hpp"

#include "bytes.hpp"
#include "checks.hpp"
#include "heap.hpp"

namespace {

using namespace uwbpos;
using fuzz::Bytes;
using fuzz::NoHeap;
using fuzz::require;

constexpr std::uint32_t kAnchors = 6;  // ids 1 … 6; others are unknown
constexpr std::uint32_t kTags = 2;     // ids 0 and 1, where there are tags
constexpr double kTurn = 0.4;          // of the body [rad/s]
constexpr double kRadius = 2;          // of its circle [m]

// Where the body is at a time, and how it moves: a circle at a height of a metre.
struct Truth {
  explicit Truth(std::int64_t time) {
    const double angle = std::fmod(static_cast<double>(time) * 1e-6, 1e5) * kTurn;
    position = {5 + kRadius * std::cos(angle), 4 + kRadius * std::sin(angle), 1};
    heading = angle + std::numbers::pi / 2;
    ahead = {std::cos(heading), std::sin(heading), 0};
  }
  [[nodiscard]] Vec<double, 3> tag(const Vec<double, 3>& lever) const {
    const Vec<double, 3> left{-ahead[1], ahead[0], 0};
    return position + lever[0] * ahead + lever[1] * left + Vec<double, 3>{0, 0, lever[2]};
  }

  Vec<double, 3> position;
  Vec<double, 3> ahead;
  double heading;
};

template <class S>
using Message =
    std::variant<TimedRange<S>, TimedDifference<S>, ImuSample<S>, TimedHeight<S>, TimedHeading<S>,
                 TimedSpeed<S>, TimedTurnRate<S>, TimedPosition<S>, TimedVelocity<S>>;

template <class S>
std::int64_t time_of(const Message<S>& message) {
  return std::visit([](const auto& m) { return m.time; }, message);
}

// Mostly near `truth`, sometimes far, sometimes any number.
template <class S>
S near(Bytes& bytes, double truth) {
  const auto kind = bytes.take<std::uint8_t>();
  if (kind < 200) return static_cast<S>(truth + 0.001 * (kind - 100));
  if (kind < 240) return static_cast<S>(truth) + S(0.25) * S(bytes.take<std::int8_t>());
  return bytes.number(S(0.01));
}

template <class S>
S sigma(Bytes& bytes, double usual) {
  return bytes.take<std::uint8_t>() < 240 ? static_cast<S>(usual) : bytes.number(S(0.001));
}

template <class A>
bool same_bits(const A& a, const A& b) {
  return a.size() == 0 || std::memcmp(&a[0], &b[0], sizeof(A)) == 0;
}

template <class S>
bool same_bits(const InertialState<S>& a, const InertialState<S>& b) {
  return same_bits(a.position, b.position) && same_bits(a.velocity, b.velocity) &&
         same_bits(a.gyro_bias, b.gyro_bias) &&
         same_bits(a.accelerometer_bias, b.accelerometer_bias) &&
         std::memcmp(&a.orientation, &b.orientation, sizeof a.orientation) == 0;
}

template <class Motion, int Biases>
bool same_track(const Track<Motion, Biases>& a, const Track<Motion, Biases>& b) {
  return a.time == b.time && a.used_at == b.used_at && a.position_variance == b.position_variance &&
         same_bits(a.state, b.state) && same_bits(a.bias, b.bias) &&
         same_bits(a.covariance.diagonal(), b.covariance.diagonal()) &&
         std::memcmp(a.covariance.factor().data(), b.covariance.factor().data(),
                     sizeof a.covariance.factor()) == 0;
}

template <class V>
void check_finite(const V& values, const char* what) {
  for (const auto value : values) require(std::isfinite(value), what);
}

template <class S, int D>
void check_pose(const MovingPoint<S, D>& pose) {
  check_finite(pose.position, "finite position");
  check_finite(pose.velocity, "finite velocity");
  fuzz::check_covariance<S, 2 * D>(pose.covariance);
}

template <class S>
void check_pose(const RobotPose<S>& pose) {
  check_finite(pose.pose.position, "finite position");
  fuzz::check_heading(pose.pose.heading);
  require(std::isfinite(pose.speed) && std::isfinite(pose.turn_rate), "finite speeds");
  fuzz::check_covariance<S, 3>(pose.pose.covariance);
  fuzz::check_covariance<S, 5>(pose.covariance);
}

template <class S>
void check_pose(const BodyPose<S>& pose) {
  check_finite(pose.pose.position, "finite position");
  fuzz::check_heading(pose.pose.heading);
  check_finite(pose.velocity, "finite velocity");
  require(std::isfinite(pose.turn_rate), "finite turn rate");
  fuzz::check_covariance<S, 6>(pose.covariance);
}

template <class S>
void check_pose(const InertialPose<S>& pose) {
  check_finite(pose.body.position, "finite position");
  check_finite(pose.body.velocity, "finite velocity");
  check_finite(pose.body.gyro_bias, "finite bias");
  check_finite(pose.body.accelerometer_bias, "finite bias");
  const Vec<S, 3> ahead = rotate<S>(pose.body.orientation, {S(1), S(0), S(0)});
  require(std::abs(norm<S, 3>(ahead) - S(1)) < S(1e-3), "an orientation turns and no more");
  fuzz::check_heading(pose.heading);
  require(std::isfinite(pose.heading_variance) && pose.heading_variance >= 0, "heading variance");
  fuzz::check_covariance<S, 9>(pose.covariance);
}

// What `Tracker::update` promises to refuse without a change.
bool changes_nothing(Error error) {
  switch (error) {
    case Error::UnknownAnchor:
    case Error::UnknownTag:
    case Error::NonPositiveSigma:
    case Error::NumericOverflow:
    case Error::NegativeRange:
    case Error::ImpossibleDifference:
    case Error::DuplicateAnchor:
    case Error::InvalidCovariance:
    case Error::InvalidOption:
    case Error::TimeNotIncreasing:
    case Error::TooOld:
    case Error::GapTooLong:
      return true;
    default:
      return false;
  }
}

// A tracker, and what is known of it from outside.
template <class Motion, TrackerSize Size>
class Watched {
 public:
  using S = typename Motion::Scalar;
  using Tracked = Tracker<Motion, Size>;

  explicit Watched(const TrackerOptions<Motion>& options) : tracker_{options} {}

  [[nodiscard]] Tracked& tracker() { return tracker_; }

  // Why there is no track yet: no place, or no heading of a motion that has one.
  [[nodiscard]] static bool is_beginning(Error error) {
    return error == Error::NotYetLocated ||
           (Motion::kHasHeading && error == Error::HeadingUndetermined);
  }

  // Tells it and judges the answer, which is returned.
  typename Tracked::Told tell(const Message<S>& message) {
    const bool tracked = tracker_.tracking();
    const auto before = tracker_.track();
    const auto told = update(tracker_, message);
    ++told_;
    if (told) {
      if (told->event == TrackEvent::Used) ++used_;
      if (told->event == TrackEvent::Gathered) ++gathered_;
      if (told->event == TrackEvent::Started || told->event == TrackEvent::Reopened) ++begun_;
      require(tracker_.tracking() == (told->event != TrackEvent::Gathered),
              "a track is there unless measurements are gathered for one");
      const auto& i = told->innovation;
      require(std::isfinite(i.value) && std::isfinite(i.normalised_square) &&
                  i.normalised_square >= 0 && std::isfinite(i.variance) && i.variance >= 0,
              "an innovation is finite, its square and variance not negative");
    } else {
      const Error error = told.error();
      require(!describe(error).empty(), "every error has a description");
      ++refused_[static_cast<std::size_t>(error)];
      if (changes_nothing(error)) {
        require(tracker_.tracking() == tracked, "what is refused by name takes no track away");
        require(!tracked || same_track(before, tracker_.track()),
                "what is refused by name changes nothing");
      }
      if (error == Error::ClockJump) {
        require(!tracker_.tracking(), "after a jump of the clock nothing is known");
        last_.reset();
      }
    }
    check();
    return told;
  }

  // Measurements of one and the same truth leave the same bits in either order.
  void tell_both_ways(const Message<S>& first, const Message<S>& second) {
    Watched late = *this;
    const auto one = tell(first);
    const auto two = tell(second);
    const auto two_late = late.tell(second);
    const auto one_late = late.tell(first);
    for (const auto* told : {&one, &two, &two_late, &one_late}) {
      const bool known = *told || (*told).error() == Error::OutlierRejected ||
                         (*told).error() == Error::Unreachable;
      if (!known || (*told && (*told)->event != TrackEvent::Used)) return;
    }
    require(same_track(tracker_.track(), late.tracker_.track()),
            "a late measurement leaves the same bits as one in time");
  }

  // Moves on and asks.
  void ask(std::int64_t time) {
    Result<void> moved;
    {
      const NoHeap guard;
      moved = tracker_.predict_to(time);
    }
    if (!moved) {
      const Error error = moved.error();
      require(is_beginning(error) || error == Error::TimeNotIncreasing || error == Error::TrackLost,
              "why no pose is told");
    }
    if (moved) last_.reset();  // who asks may go back, to the last measurement
    check();
    if (!moved) return;
    const auto pose = tracker_.pose();
    require(pose && pose->time == std::max(time, tracker_.track().time), "the pose of that time");
  }

 private:
  static typename Tracked::Told update(Tracked& tracker, const Message<S>& message) {
    const NoHeap guard;
    return std::visit([&](const auto& m) { return tracker.update(m); }, message);
  }

  void check() {
    const NoHeap guard;
    const GateCounters& counters = tracker_.counters();
    std::uint32_t refused = 0;
    for (std::size_t k = 0; k < refused_.size(); ++k) {
      require(counters.refused(static_cast<Error>(k)) == refused_[k], "each refusal is counted");
      refused += refused_[k];
    }
    require(counters.used() == used_, "each use is counted");
    require(used_ + refused + gathered_ + begun_ == told_, "each measurement has one verdict");
    for (std::uint32_t id = 0; id <= kAnchors + 1; ++id) {
      const AnchorCounters heard = tracker_.counters(id);
      require(heard.used <= used_ && heard.used + heard.refused <= told_, "an anchor's counters");
      const auto bias = tracker_.bias(id, id % kTags);
      require(!bias || (std::isfinite(bias->value) && bias->variance >= 0), "a bias");
    }
    const auto pose = tracker_.pose();
    if (!pose) {
      const bool lost = pose.error() == Error::TrackLost;
      require(tracker_.tracking() ? lost : is_beginning(pose.error()), "why there is no pose");
      return;
    }
    check_pose(*pose);
    check_finite(tracker_.track().covariance.diagonal(), "finite variances");
    for (const S d : tracker_.track().covariance.diagonal()) require(d >= 0, "of no minus");
    require(pose->time >= tracker_.track().time, "a pose is not older than its track");
    require(!last_ || pose->time >= *last_, "time goes on");
    last_ = pose->time;
  }

  Tracked tracker_;
  std::array<std::uint32_t, kErrorCount> refused_{};
  std::uint32_t told_ = 0;
  std::uint32_t used_ = 0;
  std::uint32_t gathered_ = 0;
  std::uint32_t begun_ = 0;
  std::optional<std::int64_t> last_;
};

template <class Motion>
TrackerOptions<Motion> options_from(Bytes& bytes) {
  using S = typename Motion::Scalar;
  TrackerOptions<Motion> options;
  const auto flags = bytes.take<std::uint16_t>();
  options.locate = fuzz::take_options<S, Motion::kDimension>(bytes, flags & 3);
  if constexpr (Motion::kDimension == 3) {
    if ((flags & 1) == 0) options.locate.side = {S(0), S(0), S(-1)};
  } else {
    options.model.motion.height = S(1);
  }
  if ((flags & 4) != 0) options.model.gate.max_speed = bytes.number(S(0.1));
  if ((flags & 8) != 0) options.model.gate.sigmas = bytes.number(S(0.01));
  if ((flags & 16) != 0) options.model.bias_sigma = bytes.number(S(0.01));
  if ((flags & 32) != 0) options.model.bias_time = bytes.number(S(0.1));
  if ((flags & 64) != 0) options.speed_sigma = bytes.number(S(0.1));
  // Half a minute at most, which a pose is told over in three hundred steps.
  if ((flags & 128) != 0) options.max_gap = bytes.take<std::int32_t>() / 64;
  if ((flags & 256) != 0) options.patience = bytes.take<std::int64_t>();
  if ((flags & 512) != 0) options.fix_window = bytes.take<std::int64_t>();
  if ((flags & 1024) != 0) options.heading = {bytes.number(S(0.01)), bytes.number(S(0.001))};
  if ((flags & 2048) != 0) options.model.gate.max_acceleration = bytes.number(S(0.1));
  if ((flags & 4096) != 0) {
    auto& motion = options.model.motion;
    if constexpr (requires { motion.acceleration; }) motion.acceleration = bytes.number(S(0.01));
    if constexpr (requires { motion.slip; }) motion.slip = bytes.number(S(0.01));
    if constexpr (requires { motion.height; }) motion.height = bytes.number(S(0.01));
    if constexpr (requires { motion.gyro_sigma; }) motion.gyro_sigma = bytes.number(S(0.01));
    if constexpr (requires { motion.gravity; }) motion.gravity = bytes.number(S(0.001));
    if constexpr (requires { motion.tilt_sigma; }) motion.tilt_sigma = bytes.number(S(0.01));
    if constexpr (requires { motion.blind_turn; }) motion.blind_turn = bytes.number(S(0.01));
    if constexpr (requires { motion.gyro_noise; }) motion.gyro_noise = bytes.number(S(0.01));
  }
  return options;
}

// Mostly on by up to a fifth of a second, sometimes back, sometimes far, sometimes anywhere.
std::int64_t stepped(std::int64_t time, Bytes& bytes) {
  const auto kind = bytes.take<std::uint8_t>();
  std::int64_t step = 0;
  if (kind < 200) {
    step = std::int64_t{kind} * 1000;
  } else if (kind < 220) {
    step = (200 - std::int64_t{kind}) * 7000;
  } else if (kind < 240) {
    step = (std::int64_t{kind} - 219) * 400'000;
  } else if (kind < 252) {
    step = bytes.take<std::int32_t>();
  } else {
    return bytes.take<std::int64_t>();
  }
  return __builtin_add_overflow(time, step, &time) ? step : time;
}

template <class S>
Vec<double, 3> lever_of(std::uint32_t tag, bool tags) {
  return tags && tag == 1 ? Vec<double, 3>{-0.3, 0.1, 0.2} : Vec<double, 3>::Zero();
}

template <class Motion, TrackerSize Size>
class Feeder {
 public:
  using S = typename Motion::Scalar;

  explicit Feeder(Bytes bytes) : bytes_{bytes}, watched_{options_from<Motion>(bytes_)} {
    const auto flags = bytes_.take<std::uint8_t>();
    const double xs[kAnchors] = {0, 10, 10, 0, 5, 10};
    const double ys[kAnchors] = {0, 0, 8, 8, 0, 4};
    for (std::uint32_t id = 1; id <= kAnchors; ++id) {
      Vec<S, 3> place{static_cast<S>(xs[id - 1]), static_cast<S>(ys[id - 1]),
                      static_cast<S>(2.2 + 0.2 * (id % 3))};
      if (id == kAnchors && (flags & 1) != 0) {
        for (S& coordinate : place) coordinate = bytes_.number(S(0.01));
      }
      const auto added = watched_.tracker().add_anchor(id, place);
      anchors_[id] = added ? place.template cast<double>().eval() : Vec<double, 3>::Zero().eval();
      if (!added) require(added.error() == Error::NotFinite, "why an anchor is not added");
    }
    tags_ = (flags & 2) != 0;
    if (tags_) {
      for (std::uint32_t tag = 0; tag < kTags; ++tag) {
        (void)watched_.tracker().add_tag(tag, lever_of<S>(tag, true).template cast<S>().eval());
      }
    }
    if ((flags & 4) != 0) time_ = bytes_.take<std::int64_t>();
  }

  void run() {
    while (!bytes_.empty()) step();
  }

 private:
  void step() {
    const auto kind = bytes_.take<std::uint8_t>();
    const std::int64_t time = stepped(time_, bytes_);
    if (kind < 48) {
      // Several ranges at once: what a track begins with.
      const auto which = bytes_.take<std::uint8_t>();
      for (std::uint32_t id = 1; id <= kAnchors; ++id) {
        if ((which >> id & 1) == 0) tell(range(time, id, which & 1, false));
      }
    } else if (kind < 64) {
      // A blink: differences that share an arrival.
      const auto which = bytes_.take<std::uint8_t>();
      for (std::uint32_t id = 2; id <= kAnchors; ++id) {
        if ((which >> id & 1) == 0) tell(difference(time, 1, id, which & 1, true, false));
      }
    } else if (kind < 80) {
      watched_.ask(time);
    } else if (kind < 96) {
      const Message<S> again = past_[kind % past_.size()];
      tell(again);
      return;
    } else if (kind < 112) {
      const Message<S> first = any(time, bytes_.take<std::uint8_t>());
      const std::int64_t later = stepped(time, bytes_);
      const Message<S> second = any(later, bytes_.take<std::uint8_t>());
      if (watched_.tracker().tracking() && time > watched_.tracker().track().time && later > time) {
        watched_.tell_both_ways(first, second);
      }
    } else {
      tell(any(time, kind));
    }
    // A clock that is far off for one message is so for that one; one that jumps stays there.
    if (kind % 4 != 3 || std::abs(static_cast<double>(time) - static_cast<double>(time_)) < 1e7) {
      time_ = time;
    }
  }

  void tell(const Message<S>& message) {
    const auto told = watched_.tell(message);
    past_[next_++ % past_.size()] = message;
    if (!told || bytes_.take<std::uint8_t>() % 8 != 0) return;
    const bool tracked = watched_.tracker().tracking();
    const auto again = watched_.tell(message);
    // One that came late may have been dropped by now; with a track, it is then too old.
    if (!tracked) return;
    const bool late = time_of(message) < watched_.tracker().track().time;
    require(!again && (late || again.error() == Error::TimeNotIncreasing), "a repeat is known");
  }

  [[nodiscard]] Vec<double, 3> anchor(std::uint32_t id) const {
    return id < anchors_.size() ? anchors_[id] : Vec<double, 3>::Zero().eval();
  }

  Message<S> range(std::int64_t time, std::uint32_t id, std::uint32_t tag, bool loose) {
    const Vec<double, 3> way = Truth{time}.tag(lever_of<S>(tag, tags_)) - anchor(id);
    const double truth = std::sqrt(way.squaredNorm());
    TimedRange<S> m{time, id, near<S>(bytes_, truth)};
    m.tag = tag;
    if (loose) m.sigma = sigma<S>(bytes_, 0.1);
    return m;
  }

  Message<S> difference(std::int64_t time, std::uint32_t a, std::uint32_t b, std::uint32_t tag,
                        bool shared, bool loose) {
    const Vec<double, 3> at = Truth{time}.tag(lever_of<S>(tag, tags_));
    const Vec<double, 3> to = at - anchor(b);
    const Vec<double, 3> from = at - anchor(a);
    const double truth = std::sqrt(to.squaredNorm()) - std::sqrt(from.squaredNorm());
    TimedDifference<S> m{time, a, b, near<S>(bytes_, truth)};
    m.tag = tag;
    m.shared = shared;
    if (loose) m.sigma = sigma<S>(bytes_, 0.15);
    return m;
  }

  // One measurement of any kind.
  Message<S> any(std::int64_t time, std::uint8_t kind) {
    const Truth truth{time};
    const auto ids = bytes_.take<std::uint8_t>();
    const std::uint32_t id = ids % (kAnchors + 2);
    const std::uint32_t other = ids / 8 % (kAnchors + 2);
    const std::uint32_t tag = ids / 64 % (kTags + 1);
    switch (kind % 9) {
      case 0:
        return range(time, id, tag, true);
      case 1:
        return difference(time, other, id, tag, (kind & 128) != 0, true);
      case 2: {
        const double inward = kTurn * kTurn * kRadius;
        const double gravity = 9.80665;
        return ImuSample<S>{
            time,
            {near<S>(bytes_, 0), near<S>(bytes_, 0), near<S>(bytes_, kTurn)},
            {near<S>(bytes_, 0), near<S>(bytes_, inward), near<S>(bytes_, gravity)}};
      }
      case 3:
        return TimedHeight<S>{time, near<S>(bytes_, 1), sigma<S>(bytes_, 0.05)};
      case 4:
        return TimedHeading<S>{time, near<S>(bytes_, truth.heading), sigma<S>(bytes_, 0.05)};
      case 5:
        return TimedSpeed<S>{time, near<S>(bytes_, kTurn * kRadius), sigma<S>(bytes_, 0.05)};
      case 6:
        return TimedTurnRate<S>{time, near<S>(bytes_, kTurn), sigma<S>(bytes_, 0.02)};
      case 7: {
        TimedPosition<S> m{time, {}, Mat<S, 3>::Zero()};
        for (int k = 0; k < 3; ++k) {
          m.position[k] = near<S>(bytes_, truth.position[k]);
          const S deviation = sigma<S>(bytes_, 0.1);
          m.covariance(k, k) = deviation * deviation;
        }
        m.covariance(0, 1) = m.covariance(1, 0) = near<S>(bytes_, 0) * S(0.05);
        return m;
      }
      default: {
        const double speed = kTurn * kRadius;
        return TimedVelocity<S>{time,
                                {near<S>(bytes_, speed * truth.ahead[0]),
                                 near<S>(bytes_, speed * truth.ahead[1]), near<S>(bytes_, 0)},
                                sigma<S>(bytes_, 0.1)};
      }
    }
  }

  Bytes bytes_;
  Watched<Motion, Size> watched_;
  std::array<Vec<double, 3>, kAnchors + 1> anchors_{};
  std::array<Message<S>, 8> past_{};
  std::size_t next_ = 0;
  std::int64_t time_ = 1'000'000;
  bool tags_ = false;
};

// Windows are small, so that they are full soon; anchors do not all have a place for their bias.
template <class Motion>
void run(Bytes bytes) {
  Feeder<Motion, TrackerSize{.anchors = 6, .tags = 2, .window = 16, .stride = 4}>{bytes}.run();
}

template <class Motion>
void run_biased(Bytes bytes) {
  Feeder<
      Motion,
      TrackerSize{
          .anchors = 6, .tags = 2, .biases = 3, .window = 16, .stride = 8, .bias_by_link = true}>{
      bytes}
      .run();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes{std::span{data, size}};
  switch (bytes.take<std::uint8_t>() % 4) {
    case 0:
      run<PlanarRobot<float>>(bytes);
      break;
    case 1:
      run<PlanarBody<double>>(bytes);
      break;
    case 2:
      run_biased<ConstantVelocity<double, 3>>(bytes);
      break;
    default:
      run<Inertial<float>>(bytes);
  }
  return 0;
}
