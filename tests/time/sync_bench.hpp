// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A control anchor and another, a known flight apart, as tests of synchronisation need them.

#include <cmath>
#include <cstdint>
#include <string_view>

#include <uwbpos/sim/device_clock.hpp>
#include <uwbpos/sim/instant.hpp>
#include <uwbpos/sim/noise.hpp>
#include <uwbpos/time/clock_sync.hpp>

namespace uwbpos::test {

/// A sync frame's stamps and when a host saw it.
struct SyncFrame {
  DeviceTime<> control_tx;
  DeviceTime<> anchor_rx;
  std::int64_t host;
};

/// Two clocks that walk, and a radio between them.
struct SyncBench {
  sim::DeviceClock control{.rate = 12e-6, .rate_walk = 0.1e-9};
  sim::DeviceClock anchor{.rate = -9e-6, .rate_walk = 0.1e-9};
  sim::Instant now{100, 0.25};
  double flight = 87e-9;
  double sigma = 0.15e-9;
  double host_latency = 4e-3;
  sim::Random random;

  explicit SyncBench(std::string_view name) : random{name} {
    for (sim::DeviceClock* clock : {&control, &anchor}) {
      clock->at = now;
      clock->reading.ticks = static_cast<std::int64_t>(random.bits() >> 24);
      clock->reading.fraction = random.uniform();
    }
  }

  /// Moves time on.
  void wait(double seconds) {
    now = now + seconds;
    control = sim::advance(control, now, random);
    anchor = sim::advance(anchor, now, random);
  }

  [[nodiscard]] std::int64_t host() {
    return std::llround((sim::to_seconds(now) + random.uniform(0, host_latency)) * 1e6);
  }

  /// A frame now, `late` seconds later at the anchor than it should be.
  [[nodiscard]] SyncFrame frame(double late = 0) {
    const std::int64_t tx = sim::read(control, now).ticks;
    const sim::Instant arrival = sim::when(control, tx) + (flight + late);
    return {sim::counter(tx), stamp_at(arrival), host()};
  }

  /// The anchor's stamp of something at an instant.
  [[nodiscard]] DeviceTime<> stamp_at(sim::Instant instant) {
    return sim::counter(sim::stamp(anchor, instant, sigma * random.normal()));
  }

  /// True rate of the control clock in the anchor's time.
  [[nodiscard]] double delta() const { return (control.rate - anchor.rate) / (1 + anchor.rate); }

  /// How far a conversion of `stamp` is off [s], when the stamp itself is free of noise.
  template <class S>
  [[nodiscard]] double error(const ControlTime<S>& time, sim::Instant instant) const {
    const sim::Reading truth = sim::read(control, instant);
    const auto whole = static_cast<double>(time.ticks - sim::counter(truth.ticks));
    return (whole + static_cast<double>(time.fraction) - truth.fraction) * kTickSeconds<double>;
  }

  /// The anchor's counter at an instant, without noise and rounded down; `left` ticks beyond it.
  [[nodiscard]] DeviceTime<> exact_stamp(double& left) const {
    const sim::Reading seen = sim::read(anchor, now);
    left = seen.fraction;
    return sim::counter(seen.ticks);
  }
};

/// Feeds a frame.
template <class S>
Result<Measured<S>> feed(ClockSync<S>& sync, const SyncBench& pair, const SyncFrame& frame) {
  return sync.update(frame.control_tx, frame.anchor_rx, static_cast<S>(pair.flight), frame.host);
}

}  // namespace uwbpos::test
