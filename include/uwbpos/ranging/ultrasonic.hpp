// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Ultrasonic times of flight: speed of sound, and counter readings to lengths. Source: Jiang, Yan,
/// Zang, Zhao, J. Jilin Univ. (Eng. & Tech.) 39(1), 2009 (003).
/// \f[ v = v_0 \sqrt{T / T_0}, \qquad T = T_0 + \vartheta, \quad T_0 = 273.16\,\mathrm K, \quad
///     v_0 = 331.45\,\mathrm{m/s}, \qquad (1) \f]
/// \f[ L = v \, (n \, t_c - d), \qquad
///     \mathrm{var}\,L = v^2 \left( \sigma_t^2 + t_c^2 / 12 \right)
///                     + \left( L \, \sigma_\vartheta / 2T \right)^2. \qquad (2), (3) \f]
/// L is long by the lag of the receiver's threshold, which all receivers of a shot share: solve/
/// fsri.hpp finds it. The last term of (3) is common to all lengths of one temperature.

#include <cmath>
#include <cstdint>

#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"

namespace uwbpos {

/// Speed of sound in dry air at 0 °C [m/s], v₀ of (1).
template <class S>
inline constexpr S kSpeedOfSoundAtZero = S(331.45);

/// T₀ of (1) [K].
template <class S>
inline constexpr S kZeroCelsius = S(273.16);

/// The temperatures of air that are believed, −60 … 70 °C.
template <class S>
inline constexpr S kColdestAir = S(-60);
/// The other end.
template <class S>
inline constexpr S kHottestAir = S(70);

/// Speed of sound [m/s] in air of `temperature` [°C], by (1). O(1), no allocation.
/// Errors: NotFinite; TemperatureOutOfRange, not within −60 … 70 °C.
template <class S>
[[nodiscard]] Result<S> speed_of_sound(S temperature) {
  if (!std::isfinite(temperature)) return std::unexpected(Error::NotFinite);
  if (temperature < kColdestAir<S> || temperature > kHottestAir<S>) {
    return std::unexpected(Error::TemperatureOutOfRange);
  }
  return kSpeedOfSoundAtZero<S> * std::sqrt(S(1) + temperature / kZeroCelsius<S>);
}

/// Temperature [°C] of air in which sound travels at `speed` [m/s], the inverse of (1): measure a
/// known distance and have a thermometer. O(1), no allocation.
/// Errors: NotFinite; TemperatureOutOfRange, not within −60 … 70 °C.
template <class S>
[[nodiscard]] Result<S> temperature_from_speed_of_sound(S speed) {
  if (!std::isfinite(speed)) return std::unexpected(Error::NotFinite);
  const S ratio = speed / kSpeedOfSoundAtZero<S>;
  const S temperature = kZeroCelsius<S> * (ratio - S(1)) * (ratio + S(1));
  constexpr S kRounding = S(1e-3);
  if (!(speed > S(0)) || temperature < kColdestAir<S> - kRounding ||
      temperature > kHottestAir<S> + kRounding) {
    return std::unexpected(Error::TemperatureOutOfRange);
  }
  return temperature;
}

/// The counter, and how good times and temperatures are.
template <class S>
struct UltrasonicOptions {
  S temperature = S(24);       ///< of the air [°C]
  S tick = S(1.0 / 3.0e6);     ///< t_c, one count [s]
  S circuit_delay = S(0);      ///< d, of trigger and comparator together [s]
  S sigma_time = S(0);         ///< of one arrival, without the counter's rounding [s]
  S sigma_temperature = S(0);  ///< [K]
  S max_length = S(30);        ///< longer lengths are refused [m]
};

/// Length [m] of `count` ticks of flight by (2), and its variance [m²] by (3). O(1), no allocation.
/// Errors: NotFinite, an option; InvalidOption, a tick or a longest length that is not positive, a
/// negative delay; NonPositiveSigma, a negative sigma; TemperatureOutOfRange;
/// NegativeTimeOfFlight, a count within the circuit's delay; RangeBeyondMaximum; NumericOverflow, a
/// sigma whose square is none.
template <class S>
[[nodiscard]] Result<Measured<S>> ultrasonic_length(std::uint32_t count,
                                                    const UltrasonicOptions<S>& options = {}) {
  const UltrasonicOptions<S>& o = options;
  for (const S value : {o.tick, o.circuit_delay, o.sigma_time, o.sigma_temperature, o.max_length}) {
    if (!std::isfinite(value)) return std::unexpected(Error::NotFinite);
  }
  if (!(o.tick > S(0)) || o.circuit_delay < S(0) || !(o.max_length > S(0))) {
    return std::unexpected(Error::InvalidOption);
  }
  if (o.sigma_time < S(0) || o.sigma_temperature < S(0)) {
    return std::unexpected(Error::NonPositiveSigma);
  }
  const Result<S> speed = speed_of_sound(o.temperature);
  if (!speed) return std::unexpected(speed.error());
  const S flight = static_cast<S>(count) * o.tick - o.circuit_delay;
  if (!(flight > S(0))) return std::unexpected(Error::NegativeTimeOfFlight);
  const S length = *speed * flight;
  if (length > o.max_length) return std::unexpected(Error::RangeBeyondMaximum);
  const S time_variance = o.sigma_time * o.sigma_time + o.tick * o.tick / S(12);
  const S by_temperature =
      length * o.sigma_temperature / (S(2) * (kZeroCelsius<S> + o.temperature));
  const S variance = *speed * *speed * time_variance + by_temperature * by_temperature;
  if (!std::isfinite(variance)) return std::unexpected(Error::NumericOverflow);
  return Measured<S>{length, variance};
}

/// Wavelength [m] of a transducer's `frequency` [Hz] in air of `temperature` [°C]; 8.643 mm for
/// 40 kHz at 24 °C. O(1), no allocation.
/// Errors: those of `speed_of_sound`; NotFinite, InvalidOption for a frequency not above zero;
/// NumericOverflow, one so low that its waves have no length.
template <class S>
[[nodiscard]] Result<S> ultrasonic_wavelength(S temperature, S frequency = S(40000)) {
  if (!std::isfinite(frequency)) return std::unexpected(Error::NotFinite);
  if (!(frequency > S(0))) return std::unexpected(Error::InvalidOption);
  const Result<S> speed = speed_of_sound(temperature);
  if (!speed) return std::unexpected(speed.error());
  const S length = *speed / frequency;
  if (!std::isfinite(length)) return std::unexpected(Error::NumericOverflow);
  return length;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
