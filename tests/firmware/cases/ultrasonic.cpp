// SPDX-License-Identifier: MIT
// Ultrasonic shots: counts, lengths, lag and whole waves.
#include "uwbpos/ranging/ultrasonic.hpp"

#include "uwbpos/solve/fsri.hpp"

#include "cases/biased_fix.hpp"
#include "cases/entries.hpp"

namespace uwbpos {

template <class Words, std::size_t N>
void transfer(Words& words, FsriShot<float, N>& s) {
  // Where there is no alternative it is NaN, of bits that are nobody's business.
  if (s.alternative[0] != s.alternative[0]) s.alternative.setZero();
  firmware::transfer_all(words, s.position, s.lag, s.repair, s.ambiguous, s.residual, s.covariance,
                         s.chi_squared, s.degrees_of_freedom, s.alternative);
}

}  // namespace uwbpos

namespace {

using namespace uwbpos;

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
      in[i] = firmware::to_float(distance + 0.018 + random.normal(0, 0.0001));
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

FIRMWARE_FUNCTION(ultrasonic_length_, Length)
FIRMWARE_FUNCTION(fsri_3, Shot<3>)
FIRMWARE_FUNCTION(fsri_4, Shot<4>)
FIRMWARE_FUNCTION(locate_conventional_, Conventional)
FIRMWARE_FUNCTION(locate_time_difference_, TimeDifference)

std::span<const firmware::Entry> firmware::ultrasonic_entries() {
  static constexpr Entry kEntries[] = {
      FIRMWARE_ENTRY(ultrasonic_length_, Length), FIRMWARE_ENTRY(fsri_3, Shot<3>),
      FIRMWARE_ENTRY(fsri_4, Shot<4>), FIRMWARE_ENTRY(locate_conventional_, Conventional),
      FIRMWARE_ENTRY(locate_time_difference_, TimeDifference)};
  return kEntries;
}
