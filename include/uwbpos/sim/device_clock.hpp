// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The clock of a simulated device: what its counter shows at a true instant, and when it shows
/// a given count.
///
/// A clock of rate error \f$ e \f$ that showed \f$ n_0 \f$ ticks at \f$ t_0 \f$ shows
/// \f[ n(t) = n_0 + (1 + e)\,F\,(t - t_0), \qquad F = 128 \cdot 499.2\,\text{MHz} \tag{1} \f]
/// Its rate walks at random, \f$ de = q\,dW \f$, so that over \f$ \Delta \f$ (exactly, for
/// independent normals \f$ u, w \f$)
/// \f[ \delta e = q\sqrt\Delta\,u, \qquad
///     \int e\,dt = \left(e + \tfrac12 \delta e\right)\Delta + q\sqrt{\Delta^3/12}\,w \tag{2} \f]
/// Ticks are counted in 64-bit integers and a fraction; F is an integer number of hertz. Reading
/// up to an hour from `at` is good to 0.001 ps for rates up to 100 ppm, inverting up to 10 s from
/// it to 0.002 ps; advancing an hour at a time loses nothing.

#include <cmath>
#include <cstdint>

#include "uwbpos/sim/instant.hpp"
#include "uwbpos/sim/noise.hpp"
#include "uwbpos/time/device_time.hpp"

namespace uwbpos::sim {

/// Ticks of a perfect DW1000/DW3000 counter in a second.
inline constexpr std::int64_t kTicksPerSecond = 63'897'600'000;

/// A count that does not wrap.
struct Reading {
  std::int64_t ticks = 0;  ///< whole ticks
  double fraction = 0;     ///< of a tick, 0 ≤ fraction < 1
};

/// A device's clock: it showed `reading` at the instant `at`.
struct DeviceClock {
  double rate = 0;       ///< it runs at 1 + rate times the true rate
  double rate_walk = 0;  ///< the q of (2) [1/√s]
  Reading reading{};     ///< what it showed
  Instant at{};          ///< when
};

/// `reading` moved on by some ticks, not necessarily whole.
[[nodiscard]] inline Reading operator+(Reading reading, double ticks) {
  const double fraction = reading.fraction + ticks;
  const double whole = std::floor(fraction);
  return {reading.ticks + static_cast<std::int64_t>(whole), fraction - whole};
}

/// What the clock shows at an instant, by (1) with the rate of now.
[[nodiscard]] inline Reading read(const DeviceClock& clock, Instant instant) {
  const std::int64_t seconds = instant.seconds - clock.at.seconds;
  const double fraction = instant.fraction - clock.at.fraction;
  constexpr auto frequency = static_cast<double>(kTicksPerSecond);
  const Reading whole{clock.reading.ticks + seconds * kTicksPerSecond, clock.reading.fraction};
  return whole + (fraction + clock.rate * (static_cast<double>(seconds) + fraction)) * frequency;
}

/// The instant at which the clock shows the count `ticks`: (1) solved for t.
[[nodiscard]] inline Instant when(const DeviceClock& clock, std::int64_t ticks) {
  const double since = static_cast<double>(ticks - clock.reading.ticks) - clock.reading.fraction;
  return clock.at + since / (static_cast<double>(kTicksPerSecond) * (1 + clock.rate));
}

/// The count at an instant that the clock sees with an error of `error` seconds, rounded to
/// the nearest tick as a receiver's interpolated timestamp is.
[[nodiscard]] inline std::int64_t stamp(const DeviceClock& clock, Instant instant, double error) {
  const Reading seen = read(clock, instant) + (error * static_cast<double>(kTicksPerSecond) + 0.5);
  return seen.ticks;
}

/// The counter of 40 bits that shows a count.
[[nodiscard]] constexpr DeviceTime<> counter(std::int64_t ticks) {
  return DeviceTime<>{static_cast<std::uint64_t>(ticks)};
}

/// The clock moved on to a later instant, its rate having walked by (2). An instant that is not
/// later returns the clock as it was, and draws nothing.
[[nodiscard]] inline DeviceClock advance(DeviceClock clock, Instant instant, Random& random) {
  const double interval = instant - clock.at;
  if (!(interval > 0)) return clock;
  DeviceClock later = clock;
  later.at = instant;
  later.reading = read(clock, instant);
  if (clock.rate_walk > 0) {
    const double step = clock.rate_walk * std::sqrt(interval) * random.normal();
    const double wander =
        interval * (step / 2 + clock.rate_walk * std::sqrt(interval / 12) * random.normal());
    later.rate += step;
    later.reading = later.reading + wander * static_cast<double>(kTicksPerSecond);
  }
  return later;
}

}  // namespace uwbpos::sim

#include "uwbpos/core/macros_back.hpp"
