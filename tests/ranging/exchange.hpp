// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Exchanges computed in long double (64 bits of mantissa) from the definition of the methods, for
/// tests to compare with. Independent of the simulator in sim/.

#include <cmath>
#include <cstdint>

#include "uwbpos/core/constants.hpp"
#include "uwbpos/ranging/ds_twr.hpp"
#include "uwbpos/ranging/ss_twr.hpp"
#include "uwbpos/sim/noise.hpp"

namespace uwbpos::test {

using Real = long double;

inline constexpr Real kTick = 1 / (128 * 499.2e6L);
inline constexpr Real kAir = 299702547.0L;

/// A number of any precision, said to become a long double.
template <class S>
constexpr Real real(S value) {
  return static_cast<Real>(value);
}

inline Real uniform(sim::Random& random, double low, double high) {
  return real(random.uniform(low, high));
}

/// Noise of standard deviation `sigma` [s] in ticks.
inline Real noise_ticks(sim::Random& random, double sigma) {
  return real(random.normal(0, sigma)) / kTick;
}

/// What happens, in true time [s]: A is initiator, B responder.
struct Scene {
  Real range;
  Real reply_b;
  Real reply_a;
  Real rate_a;
  Real rate_b;

  [[nodiscard]] Real time_of_flight() const { return range / kAir; }
};

/// Stamps in ticks, as real numbers; phases shift A's and B's clocks.
struct RealStamps {
  Real poll_tx, poll_rx, resp_tx, resp_rx, final_tx, final_rx;
};

inline RealStamps real_stamps(const Scene& s, Real phase_a = 0, Real phase_b = 0) {
  const Real flight = s.time_of_flight();
  const Real t3 = flight + s.reply_b;
  const Real t4 = t3 + flight;
  const Real t5 = t4 + s.reply_a;
  const auto a = [&](Real t) { return phase_a + (t + s.rate_a * t) / kTick; };
  const auto b = [&](Real t) { return phase_b + (t + s.rate_b * t) / kTick; };
  return {a(0), b(flight), b(t3), a(t4), a(t5), b(t5 + flight)};
}

/// Nearest tick, modulo the counter.
inline DeviceTime<> stamp(Real ticks) {
  return DeviceTime<>{static_cast<std::uint64_t>(std::llround(ticks))};
}

inline DsTwrStamps stamps(const RealStamps& r) {
  return {stamp(r.poll_tx), stamp(r.poll_rx),  stamp(r.resp_tx),
          stamp(r.resp_rx), stamp(r.final_tx), stamp(r.final_rx)};
}

/// Stamps with random phases, anywhere in the counter's range: wraps fall inside exchanges.
inline DsTwrStamps random_stamps(const Scene& s, sim::Random& random) {
  return stamps(real_stamps(s, uniform(random, 0, 0x1p40), uniform(random, 0, 0x1p40)));
}

inline SsTwrStamps single(const DsTwrStamps& s) {
  return {s.poll_tx, s.poll_rx, s.resp_tx, s.resp_rx};
}

/// Estimates from intervals [ticks] by the definitions of math.md §2, as ranges [m].
struct RealIntervals {
  Real round_a, reply_a, round_b, reply_b;

  [[nodiscard]] Real single(Real clock_offset) const {
    return ((round_a - reply_b) + clock_offset * reply_b) / 2 * kTick * kAir;
  }
  [[nodiscard]] Real symmetric() const {
    return ((round_a - reply_b) + (round_b - reply_a)) / 4 * kTick * kAir;
  }
  [[nodiscard]] Real asymmetric() const {
    // (Ra·Rb − Da·Db) has 76 bits; in this form every product fits a long double's 64.
    const Real x = round_a - reply_b;
    const Real y = round_b - reply_a;
    return (x * round_b + y * reply_b) / (round_a + round_b + reply_a + reply_b) * kTick * kAir;
  }
};

inline RealIntervals intervals(const RealStamps& r) {
  return {r.resp_rx - r.poll_tx, r.final_tx - r.resp_rx, r.final_rx - r.resp_tx,
          r.resp_tx - r.poll_rx};
}

inline RealIntervals intervals(const DsTwrStamps& s) {
  return {static_cast<Real>(s.resp_rx - s.poll_tx), static_cast<Real>(s.final_tx - s.resp_rx),
          static_cast<Real>(s.final_rx - s.resp_tx), static_cast<Real>(s.resp_tx - s.poll_rx)};
}

/// The range in seconds of flight times the speed in air.
inline Real metres(Real seconds) { return seconds * kAir; }

/// The clocks' ratio as single-sided ranging defines it: counted in B's time.
inline Real offset_in_b(const Scene& s) { return (s.rate_b - s.rate_a) / (1 + s.rate_b); }

/// A reply from 0.1 ms to 4 s, even in its logarithm.
inline Real random_reply(sim::Random& random) {
  return 1e-4L * std::pow(4e4L, real(random.uniform()));
}

}  // namespace uwbpos::test
