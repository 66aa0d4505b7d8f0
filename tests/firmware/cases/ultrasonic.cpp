// SPDX-License-Identifier: MIT
// Ultrasonic shots: counts, lengths, lag and whole waves.
#include "uwbpos/ranging/ultrasonic.hpp"

#include "uwbpos/solve/fsri.hpp"

#include "bench.hpp"

namespace uwbpos {

template <class Words, std::size_t N>
void transfer(Words& words, FsriShot<float, N>& s) {
  // Where there is no alternative it is NaN, of bits that are nobody's business.
  if (s.alternative[0] != s.alternative[0]) s.alternative.setZero();
  firmware::transfer_all(words, s.position, s.lag, s.repair, s.ambiguous, s.residual, s.covariance,
                         s.chi_squared, s.degrees_of_freedom, s.alternative);
}

}  // namespace uwbpos

namespace firmware::ultrasonic {

using namespace uwbpos;

namespace {

std::array<Vec<float, 2>, 4> receivers() {
  return {Vec<float, 2>{0, 0}, Vec<float, 2>{0.4f, 0}, Vec<float, 2>{0.8f, 0},
          Vec<float, 2>{-0.4f, 0.4f}};
}

struct Length {
  static constexpr int kRounds = 20;
  using Input = std::uint32_t;
  using Output = Result<Measured<float>>;
  static Output run(const Input& in) { return ultrasonic_length<float>(in); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    in = static_cast<std::uint32_t>(random.integer(3000, 80000));
  }
#endif
};

struct Sound {
  static constexpr int kRounds = 20;
  using Input = float;
  using Output = std::array<Result<float>, 3>;
  static Output run(const Input& in) {
    return {speed_of_sound(in), temperature_from_speed_of_sound(330 + in / 2),
            ultrasonic_wavelength(in)};
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) { in = to_float(random.uniform(-70, 80)); }
#endif
};

// N receivers, a lag of two waves, and every other round one receiver a wave late.
template <std::size_t N>
struct Shot {
  static constexpr int kRounds = 6;
  using Input = std::array<float, N>;
  using Output = Result<FsriShot<float, N>>;
  static std::array<Vec<float, 2>, N> places() {
    std::array<Vec<float, 2>, N> some;
    for (std::size_t i = 0; i < N; ++i) some[i] = receivers()[i];
    return some;
  }
  static Output run(const Input& in) { return fsri(places(), in); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int round) {
    const Vec<double, 2> emitter{random.uniform(-0.5, 1.5), random.uniform(0.8, 2.5)};
    for (std::size_t i = 0; i < N; ++i) {
      const double distance = (emitter - receivers()[i].template cast<double>()).norm();
      in[i] = to_float(distance + 0.018 + random.normal(0, 0.0001));
    }
    if (round % 2 == 1) in[N - 1] += FsriOptions<float>{}.wavelength;
  }
#endif
};

struct Conventional : Shot<3> {
  using Output = Result<Fix<float, 2>>;
  static Output run(const Input& in) { return locate_conventional(places(), in, 0.018f); }
};
struct TimeDifference : Shot<3> {
  using Output = Result<BiasedFix<float, 2>>;
  static Output run(const Input& in) { return locate_time_difference(places(), in); }
};

}  // namespace

#define ULTRASONIC_CASES(X)             \
  X(ultrasonic_length_, Length)         \
  X(speed_of_sound_, Sound)             \
  X(fsri_3, Shot<3>)                    \
  X(fsri_4, Shot<4>)                    \
  X(locate_conventional_, Conventional) \
  X(locate_time_difference_, TimeDifference)
FIRMWARE_UNIT(ULTRASONIC_CASES)

}  // namespace firmware::ultrasonic
