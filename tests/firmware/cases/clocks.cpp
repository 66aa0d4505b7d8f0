// SPDX-License-Identifier: MIT
// Clocks that are followed, and the range differences that come of them.
#include "uwbpos/ranging/tdoa_downlink.hpp"
#include "uwbpos/ranging/tdoa_uplink.hpp"
#include "uwbpos/ranging/uplink_subnet.hpp"
#include "uwbpos/time/clock_sync.hpp"
#include "uwbpos/time/rate_tracker.hpp"

#ifndef FIRMWARE_TARGET
#include <variant>

#include "uwbpos/sim/downlink.hpp"
#include "uwbpos/sim/uplink.hpp"
#endif

#include "bench.hpp"

namespace firmware::clocks {

using namespace uwbpos;

namespace {

constexpr std::size_t kAnchors = 6;
constexpr std::uint32_t kControl = 4;

Vec<float, 3> anchor_place(std::uint32_t id) {
  return {static_cast<float>(id % 3) * 10, id < 3 ? 0.0f : 12.0f, id % 2 == 0 ? 5.0f : 2.0f};
}

#ifndef FIRMWARE_TARGET
sim::Site hall() {
  Anchors<double, 3> anchors;
  for (std::uint32_t id = 0; id < kAnchors; ++id) {
    static_cast<void>(anchors.add(id, anchor_place(id).cast<double>()));
  }
  sim::Site site;
  static_cast<void>(sim::add(site, *sim::make_subnet(anchors, kControl)));
  site.path = *sim::lawn_mower({2, 2, 1}, {18, 10, 1}, 4);
  site.radio = {
      .max_rate = 20e-6, .rate_walk = 0.1e-9, .sigma_rx = 0.15e-9, .tx_grid = 512, .loss = 0.1};
  return site;
}
#endif

// The two ends of polls, 32 bit and a host that reads a queue.
struct Rates {
  static constexpr int kRounds = 60;
  static constexpr bool kStateful = true;
  struct Input {
    DeviceTime<32> a, b;
    std::int64_t host;
  };
  using Output = Result<Measured<float>>;
  static Output run(const Input& in) {
    static RateTracker<float, 32> tracker;
    return tracker.update(in.a, in.b, in.host);
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random&, int round) {
    const Row row = recorded("hanyang_static_los")[static_cast<std::size_t>(round)];
    in = {DeviceTime<32>{static_cast<std::uint64_t>(row[3])},
          DeviceTime<32>{static_cast<std::uint64_t>(row[4])}, microseconds(row[0])};
  }
#endif
};

// Sync frames at one anchor, one in ten lost, one an echo, one of another epoch.
struct Synchronised {
  static constexpr int kRounds = 40;
  static constexpr bool kStateful = true;
  struct Input {
    DeviceTime<> control_tx, anchor_rx, stamp;
    float flight;
    std::int64_t host;
  };
  struct Output {
    Result<Measured<float>> rate;
    Result<ControlTime<float>> time{};
  };
  static Output run(const Input& in) {
    static ClockSync<float> sync;
    Output told{sync.update(in.control_tx, in.anchor_rx, in.flight, in.host)};
    told.time = sync.to_control(in.stamp, in.host);
    return told;
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random&, int round) {
    static auto simulated = sim::UplinkSimulation::start({hall()});
    for (;;) {
      const auto event = simulated->next();
      const auto* frame = std::get_if<sim::SyncFrame>(&*event);
      if (frame == nullptr || !frame->receptions[0].received) continue;
      const DeviceTime<> rx = frame->receptions[0].rx;
      const float distance = (anchor_place(0) - anchor_place(kControl)).norm();
      in = {frame->tx, rx, rx + 1'000'000, distance / kSpeedOfLightAir<float>, frame->host};
      break;
    }
    if (round == 20) in.anchor_rx = in.anchor_rx + 3000;
    if (round >= 30) in.anchor_rx = in.anchor_rx + 500'000'000;
  }
#endif
};

// A subnet that hears sync frames and, now and then, a blink.
struct Subnet {
  static constexpr int kRounds = 60;
  static constexpr bool kStateful = true;
  struct Input {
    bool blink;
    DeviceTime<> tx;
    std::int64_t host;
    std::array<bool, kAnchors> heard;
    std::array<DeviceTime<>, kAnchors> rx;
  };
  struct Output {
    std::array<Result<Measured<float>>, kAnchors> rates{};
    Result<BlinkDifferences<float, 3, kAnchors>> differences{};
  };
  static UplinkSubnet<float, 3, kAnchors>& subnet() {
    static auto instance = [] {
      Anchors<float, 3, kAnchors> anchors;
      for (std::uint32_t id = 0; id < kAnchors; ++id) {
        static_cast<void>(anchors.add(id, anchor_place(id)));
      }
      return *UplinkSubnet<float, 3, kAnchors>::make(anchors, kControl);
    }();
    return instance;
  }
  static Output run(const Input& in) {
    Output told;
    told.differences = std::unexpected(Error::TooFewMeasurements);
    std::array<BlinkArrival, kAnchors> arrivals;
    std::size_t count = 0;
    for (std::uint32_t id = 0; id < kAnchors; ++id) {
      if (!in.heard[id]) continue;
      if (!in.blink) told.rates[id] = subnet().sync(id, in.tx, in.rx[id], in.host);
      arrivals[count++] = {id, in.rx[id]};
    }
    if (in.blink) {
      told.differences = subnet().differences(std::span{arrivals.data(), count}, in.host);
    }
    return told;
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random&, int) {
    static auto simulated = sim::UplinkSimulation::start({hall()});
    const auto event = simulated->next();
    const auto* frame = std::get_if<sim::SyncFrame>(&*event);
    const auto* blink = std::get_if<sim::Blink>(&*event);
    in.blink = blink != nullptr;
    in.tx = frame != nullptr ? frame->tx : DeviceTime<>{};
    in.host = frame != nullptr ? frame->host : blink->host;
    for (std::size_t i = 0; i < kAnchors; ++i) {
      const auto& reception = frame != nullptr ? frame->receptions[i] : blink->receptions[0][i];
      in.heard[i] = reception.received;
      in.rx[i] = reception.rx;
    }
  }
#endif
};

struct Uplink {
  static constexpr int kRounds = 20;
  using Input = std::array<DeviceTime<>, 2>;
  using Output = Result<UplinkDifference<float>>;
  static Output run(const Input& in) {
    const auto reference = control_arrival(in[0], 250e-9f);
    const auto arrival = control_arrival(in[1], 253e-9f);
    if (!reference || !arrival) return std::unexpected(Error::NotFinite);
    return tdoa_uplink_difference(*reference, *arrival);
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int round) {
    in[0] = DeviceTime<>{random.bits()};
    in[1] = in[0] + random.integer(-4000, 4000) * (round % 10 == 9 ? 100 : 1);
  }
#endif
};

// Two packets in turn, heard by the tag.
struct Downlink {
  static constexpr int kRounds = 30;
  static constexpr bool kStateful = true;
  struct Input {
    DownlinkStamps stamps;
    float flight;
    std::int64_t host;
  };
  struct Output {
    Result<Measured<float>> rate;
    Result<Measured<float>> difference{};
  };
  static Output run(const Input& in) {
    static RateTracker<float> tracker;
    Output told{tracker.update(in.stamps.b_rx, in.stamps.b_tx, in.host)};
    told.difference = std::unexpected(Error::NotYetTracked);
    if (told.rate) told.difference = tdoa_downlink_difference(in.stamps, *told.rate, in.flight);
    return told;
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random&, int) {
    static auto simulated = sim::DownlinkSimulation::start({hall()});
    static std::optional<sim::Packet> first;
    for (;;) {
      const auto packet = simulated->next();
      if (packet->anchor == 0) first = *packet;
      if (packet->anchor != 1 || !first || first->sequence != packet->sequence) continue;
      const auto& heard = packet->heard[0];
      const auto& a = first->tags[0].reception;
      const auto& b = packet->tags[0].reception;
      if (!heard.valid || heard.sequence != first->sequence || !a.received || !b.received) continue;
      in = {{a.rx, b.rx, heard.rx, packet->tx},
            (anchor_place(0) - anchor_place(1)).norm() / kSpeedOfLightAir<float>,
            packet->host};
      return;
    }
  }
#endif
};

}  // namespace

#define CLOCKS_CASES(X)              \
  X(rate_tracker_recorded, Rates)    \
  X(clock_sync_, Synchronised)       \
  X(uplink_subnet_6, Subnet)         \
  X(tdoa_uplink_difference_, Uplink) \
  X(tdoa_downlink_difference_, Downlink)
FIRMWARE_UNIT(CLOCKS_CASES)

}  // namespace firmware::clocks
