// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// A whole simulated run: anchors in a hall, a body that carries tags along a path, their radios,
/// and the exchanges between them, one after the other.
///
/// \code
/// sim::Scenario scenario{.anchors = *sim::hang_anchors({}, 8, sim::Placement::Perimeter),
///                        .path = route, .radio = sim::dw1000_radio(), .seed = 7};
/// auto run = sim::Simulation::start(scenario);
/// while (const auto shot = run->next()) use(*shot);
/// \endcode
///
/// In epoch k, which begins at k / epoch_rate, every tag asks every anchor, tag by tag, anchors
/// in the order of their ids, one in each slot. A tag is the initiator A, an anchor the
/// responder B. Devices, links and frames draw from streams of their own: another radio noise
/// does not move the walls, and one more epoch does not change those before it.

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/geometry/anchors.hpp"
#include "uwbpos/sim/blockage.hpp"
#include "uwbpos/sim/exchange.hpp"
#include "uwbpos/sim/hall.hpp"
#include "uwbpos/sim/instant.hpp"
#include "uwbpos/sim/noise.hpp"
#include "uwbpos/sim/path.hpp"
#include "uwbpos/sim/radio.hpp"
#include "uwbpos/sim/route.hpp"

namespace uwbpos::sim {

/// The most tags that a body carries.
inline constexpr int kMaxTags = 8;
/// The most walls in its way.
inline constexpr int kMaxWalls = 64;

/// A tag on the body.
struct Tag {
  std::uint32_t id = 0;  ///< what logs call it
  /// Lever arm [m] in the body's frame: x forward, y left, z up.
  Vec<double, 3> lever = Vec<double, 3>::Zero();
};

/// Everything that a run is made of. A plain struct of fixed size.
struct Scenario {
  Anchors<double, 3> anchors{};  ///< the responders
  Path path = Route{};           ///< of the body
  /// The first `tag_count` of `tags`; one tag of id 0 in the body's centre unless told.
  std::array<Tag, kMaxTags> tags{};
  int tag_count = 1;                    ///< 1 … kMaxTags
  Radio radio = dw1000_radio();         ///< of tags and anchors alike
  Blockage blockage{};                  ///< how links come and go
  std::array<Wall, kMaxWalls> walls{};  ///< of which the first `wall_count` stand
  int wall_count = 0;                   ///< 0 … kMaxWalls
  double epoch_rate = 10;               ///< epochs in a second
  double slot = 2e-3;                   ///< from one exchange to the next within an epoch [s]
  Instant start{};                      ///< true time of the first epoch
  std::uint64_t seed = 1;               ///< of everything random
};

/// One exchange of a run, and the truth at `exchange.time`, when its poll was sent.
struct Shot {
  std::int64_t epoch = 0;                          ///< counted from zero
  std::uint32_t tag_id = 0;                        ///< the initiator
  std::uint32_t anchor_id = 0;                     ///< the responder
  Exchange exchange{};                             ///< stamps, and the truth that belongs to them
  BodyState body{};                                ///< where the body was
  Vec<double, 3> tag = Vec<double, 3>::Zero();     ///< where the tag's antenna was [m]
  Vec<double, 3> anchor = Vec<double, 3>::Zero();  ///< where the anchor's is [m]
};

/// Number of epochs that a scenario's path lasts, one at least.
[[nodiscard]] inline std::int64_t epoch_count(const Scenario& scenario) {
  // A path that ends with an epoch's period to rounding does not begin another.
  const double epochs = std::ceil(duration(scenario.path) * scenario.epoch_rate - 1e-6);
  return epochs < 1 ? 1 : static_cast<std::int64_t>(epochs);
}

/// A run in progress. About 30 kB, the scenario among it; never allocates.
class Simulation {
 public:
  /// Draws the devices. Errors: TooFewMeasurements (no anchors); InvalidOption (counts beyond
  /// their arrays, rates, times or probabilities outside their domain, a path that never ends,
  /// slots that do not fit an epoch or exchanges that do not fit a slot).
  [[nodiscard]] static Result<Simulation> start(const Scenario& scenario) {
    if (scenario.anchors.empty()) return std::unexpected(Error::TooFewMeasurements);
    if (!is_valid(scenario)) return std::unexpected(Error::InvalidOption);
    return Simulation{scenario};
  }

  /// The next exchange, complete or not (`exchange.frames`); nothing after the last.
  [[nodiscard]] std::optional<Shot> next() {
    if (epoch_ == epochs_) return std::nullopt;
    const auto tag = static_cast<std::size_t>(tag_);
    const auto anchor = static_cast<std::size_t>(anchor_);
    const int place = tag_ * scenario_.anchors.size() + anchor_;
    const double since =
        static_cast<double>(epoch_) / scenario_.epoch_rate + place * scenario_.slot;
    const Instant begin = scenario_.start + since;

    const Tag& mount = scenario_.tags[tag];
    const Anchor<double, 3>& fixed = scenario_.anchors[anchor_];
    const Motion moving = tag_motion(state_at(scenario_.path, since), mount.lever);
    Link& link = links_[tag * kMaxAnchors + anchor];
    link = update(link, scenario_.blockage, begin, link_stream_);
    const std::span<const Wall> walls{scenario_.walls.data(),
                                      static_cast<std::size_t>(scenario_.wall_count)};
    const double excess = link.excess + wall_excess(walls, moving.position, fixed.position);

    Shot shot;
    shot.epoch = epoch_;
    shot.tag_id = mount.id;
    shot.anchor_id = fixed.id;
    shot.anchor = fixed.position;
    shot.exchange = exchange(begin, tag_devices_[tag], moving, anchor_devices_[anchor],
                             {fixed.position}, excess, scenario_.radio, frame_stream_);
    shot.body = state_at(scenario_.path, shot.exchange.time - scenario_.start);
    shot.tag = tag_motion(shot.body, mount.lever).position;
    step();
    return shot;
  }

  /// The radio of a tag, by its place in the scenario, as it is now.
  [[nodiscard]] const Device& tag_device(int tag) const {
    return tag_devices_[static_cast<std::size_t>(tag)];
  }
  /// The radio of an anchor, by its place in `anchors`, as it is now.
  [[nodiscard]] const Device& anchor_device(int anchor) const {
    return anchor_devices_[static_cast<std::size_t>(anchor)];
  }

  /// What is being run.
  [[nodiscard]] const Scenario& scenario() const { return scenario_; }

 private:
  static constexpr std::size_t kMaxAnchors = Anchors<double, 3>::kCapacity;

  explicit Simulation(const Scenario& scenario)
      : scenario_{scenario},
        link_stream_{scenario.seed, "links"},
        frame_stream_{scenario.seed, "frames"},
        epochs_{epoch_count(scenario)} {
    Random random{scenario.seed, "devices"};
    for (Device& device : tag_devices_) {
      device = make_device(scenario.radio, scenario.start, random);
    }
    for (Device& device : anchor_devices_) {
      device = make_device(scenario.radio, scenario.start, random);
    }
  }

  static bool is_valid(const Scenario& s) {
    const Radio& radio = s.radio;
    const auto share = [](double x) { return 0 <= x && x <= 1; };
    const auto length = [](double x) { return 0 <= x && x < 1e9; };
    const double longest = radio.reply + radio.final_reply + 2 * radio.reply_jitter +
                           3 * static_cast<double>(radio.tx_grid) / kTicksPerSecond;
    const int slots = s.tag_count * s.anchors.size();
    return 1 <= s.tag_count && s.tag_count <= kMaxTags && 0 <= s.wall_count &&
           s.wall_count <= kMaxWalls && share(radio.loss) && share(s.blockage.probability) &&
           length(s.blockage.mean_duration) && length(s.blockage.minimum_excess) &&
           length(s.blockage.mean_excess) && length(radio.max_rate) && radio.max_rate < 1e-2 &&
           length(radio.rate_walk) && length(radio.sigma_rx) && length(radio.sigma_tx) &&
           length(radio.reply_jitter) && radio.reply_jitter <= radio.reply &&
           radio.reply_jitter <= radio.final_reply && length(radio.reply) &&
           length(radio.final_reply) && length(radio.sigma_clock_offset) &&
           std::isfinite(radio.antenna_delay) && length(radio.antenna_delay_spread) &&
           radio.tx_grid >= 1 && radio.propagation_speed > 0 && s.epoch_rate > 0 &&
           s.slot > longest && slots * s.slot <= 1 / s.epoch_rate && length(duration(s.path)) &&
           duration(s.path) * s.epoch_rate < 1e12;
  }

  void step() {
    if (++anchor_ < scenario_.anchors.size()) return;
    anchor_ = 0;
    if (++tag_ < scenario_.tag_count) return;
    tag_ = 0;
    ++epoch_;
  }

  Scenario scenario_;
  std::array<Device, kMaxTags> tag_devices_{};
  std::array<Device, kMaxAnchors> anchor_devices_{};
  std::array<Link, kMaxTags * kMaxAnchors> links_{};
  Random link_stream_;
  Random frame_stream_;
  std::int64_t epochs_;
  std::int64_t epoch_ = 0;
  int tag_ = 0;
  int anchor_ = 0;
};

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
