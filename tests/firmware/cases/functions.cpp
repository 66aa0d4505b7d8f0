// SPDX-License-Identifier: MIT
// What has a C library's name elsewhere, rotations, clocks.
#include "uwbpos/core/angle.hpp"
#include "uwbpos/core/exponential.hpp"
#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/core/trigonometry.hpp"
#include "uwbpos/time/clock.hpp"

#include "bench.hpp"

namespace firmware::functions {

using namespace uwbpos;

namespace {

// Some turns forth and back; every fifth angle is beyond what is reduced exactly.
struct Turns {
  static constexpr int kRounds = 60;
  using Input = std::array<float, 2>;
  using Output = std::array<float, 4>;
  static Output run(const Input& in) {
    return {sine(in[0]), cosine(in[0]), arctangent(in[0], in[1]), wrap_angle(in[0])};
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int round) {
    const double reach = round % 5 == 4 ? 1e5 : 10;
    in = {to_float(random.uniform(-reach, reach)), to_float(random.normal(0, reach))};
  }
#endif
};

struct Powers {
  static constexpr int kRounds = 60;
  using Input = float;
  using Output = std::array<float, 2>;
  static Output run(const Input& in) { return {exponential(in), logarithm_of_one_plus(in * in)}; }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int round) {
    in = to_float(random.uniform(-100, 90) * (round % 2 == 0 ? 1 : 0.01));
  }
#endif
};

struct Rotations {
  static constexpr int kRounds = 20;
  using Input = std::array<Vec<float, 3>, 3>;
  struct Output {
    Quaternion<float> turned;
    Vec<float, 3> rotated;
    Quaternion<float> between;
  };
  static Output run(const Input& in) {
    const Quaternion<float> turned =
        multiply(quaternion_from_turn(in[0]), quaternion_from_yaw(in[1][0]));
    return {turned, rotate(conjugate(turned), in[2]), quaternion_between(in[1], in[2])};
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    for (Vec<float, 3>& v : in) {
      for (int i = 0; i < 3; ++i) v[i] = to_float(random.normal());
    }
  }
#endif
};

struct Clocks {
  static constexpr int kRounds = 20;
  struct Input {
    Clock<float> a, b;
    float time;
  };
  using Output = std::array<float, 3>;
  static Output run(const Input& in) {
    return {clock_reading(in.a, in.time), true_time(in.a, in.time), relative_rate(in.b, in.a)};
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    for (Clock<float>* clock : {&in.a, &in.b}) {
      *clock = {to_float(random.uniform(-1, 1)), to_float(random.uniform(-2e-5, 2e-5))};
    }
    in.time = to_float(random.uniform(0, 100));
  }
#endif
};

}  // namespace

#define FUNCTIONS_CASES(X)         \
  X(sine_cosine_arctangent, Turns) \
  X(exponential_logarithm, Powers) \
  X(quaternions, Rotations)        \
  X(clock_reading_, Clocks)
FIRMWARE_UNIT(FUNCTIONS_CASES)

}  // namespace firmware::functions
