// SPDX-License-Identifier: MIT
// Frames, subnets and fixes brought to one map.
#include "uwbpos/frames/fit_transform.hpp"
#include "uwbpos/frames/fuse_fixes.hpp"
#include "uwbpos/frames/make_transform.hpp"

#include "bench.hpp"

namespace firmware::frames {

using namespace uwbpos;

namespace {

#ifndef FIRMWARE_TARGET
template <int N>
Mat<float, N> some_covariance(sim::Random& random, double sigma) {
  Mat<float, N> p = Mat<float, N>::Zero();
  for (int i = 0; i < N; ++i) p(i, i) = to_float(sigma * sigma * random.uniform(0.5, 2));
  for (int j = 0; j < N; ++j) {
    for (int i = 0; i < j; ++i) {
      p(i, j) = p(j, i) = to_float(random.uniform(-0.2, 0.2)) * std::sqrt(p(i, i) * p(j, j));
    }
  }
  return p;
}

template <int D>
Transform<float, D> some_transform(sim::Random& random) {
  Vec<float, D> place = point_in_room(random).head<D>().template cast<float>();
  auto made = *transform_from_yaw(to_float(random.uniform(-3, 3)), place,
                                  some_covariance<kTransformDof<D>>(random, 0.02));
  if constexpr (D == 3) made = corrected(made, {0, 0, 0, 0.4f, -0.7f, 0.2f});
  return made;
}
#endif

struct FromYaw {
  static constexpr int kRounds = 10;
  struct Input {
    float yaw;
    Vec<float, 2> translation;
    Mat<float, 3> covariance;
    Measured<float> height;
  };
  using Output = Result<Transform<float, 3>>;
  static Output run(const Input& in) {
    const auto level = transform_from_yaw(in.yaw, in.translation, in.covariance);
    if (!level) return std::unexpected(level.error());
    return in_space(*level, in.height);
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    in = {to_float(random.uniform(-3, 3)),
          point_in_room(random).head<2>().cast<float>(),
          some_covariance<3>(random, 0.02),
          {3, 1e-4f}};
  }
#endif
};

struct Chained {
  static constexpr int kRounds = 10;
  struct Input {
    Transform<float, 3> a_T_b, b_T_c;
    Fix<float, 3> fix;
  };
  struct Output {
    Fix<float, 3> there;
    Transform<float, 3> back;
  };
  static Output run(const Input& in) {
    const auto a_T_c = compose(in.a_T_b, in.b_T_c);
    return {apply(a_T_c, in.fix), inverse(a_T_c)};
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    in = {some_transform<3>(random),
          some_transform<3>(random),
          {point_in_room(random).cast<float>(), some_covariance<3>(random, 0.1), 2, 3}};
  }
#endif
};

// Five points known in both frames; in the last round they lie in line.
template <int D>
struct Fitted {
  static constexpr int kRounds = 10;
  using Input = std::array<SharedPoint<float, D>, 5>;
  using Output = Result<FittedTransform<float, D>>;
  static Output run(const Input& in) { return fit_transform(in); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int round) {
    const auto a_T_b = some_transform<D>(random);
    for (std::size_t i = 0; i < in.size(); ++i) {
      Vec<float, D> point = point_in_room(random).head<D>().template cast<float>();
      if (round + 1 == kRounds) point = Vec<float, D>::Constant(static_cast<float>(i));
      in[i] = {point, apply(a_T_b, point), 0.05f};
      for (int k = 0; k < D; ++k) in[i].in_a[k] += to_float(random.normal(0, 0.05));
    }
  }
#endif
};

// A tag that three subnets hear, whose transforms learn; every sixth time one contradicts.
struct Fused {
  static constexpr int kRounds = 24;
  static constexpr bool kStateful = true;
  static constexpr std::size_t kHeard = 3;
  using Input = std::array<SubnetFix<float, 2>, kHeard>;
  struct Output {
    Result<MapFix<float, 2>> alone, learned;
    std::array<Transform<float, 2>, kHeard> map_T_subnet{};
  };
  static Transform<float, 2> surveyed(std::uint32_t id) {
    const Vec<float, 3> variances{0.01f, 0.01f, 1e-4f};
    return *transform_from_yaw(static_cast<float>(id),
                               Vec<float, 2>{5.0f * static_cast<float>(id), 1},
                               Mat<float, 3>{variances.asDiagonal()});
  }
  static Subnets<float, 2, 4>& subnets() {
    static auto instance = [] {
      Subnets<float, 2, 4> some;
      for (std::uint32_t id = 0; id < kHeard; ++id) {
        static_cast<void>(some.add({id, 10 + id, surveyed(id)}));
      }
      return some;
    }();
    return instance;
  }
  static Output run(const Input& in) {
    Output told{fuse_fixes(subnets(), in), fuse_and_learn(subnets(), in)};
    for (int i = 0; i < static_cast<int>(kHeard); ++i) {
      told.map_T_subnet[static_cast<std::size_t>(i)] = subnets()[i].map_T_subnet;
    }
    return told;
  }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int round) {
    const Vec<float, 2> tag = point_in_room(random).head<2>().cast<float>();
    for (std::uint32_t id = 0; id < kHeard; ++id) {
      // Each subnet lies a little beside where it was surveyed.
      const Vec<float, 2> at = apply(inverse(surveyed(id)), tag) + Vec<float, 2>{0.1f, -0.05f};
      in[id] = {id, {at, some_covariance<2>(random, 0.1), 2, 3}};
      for (int k = 0; k < 2; ++k) in[id].fix.position[k] += to_float(random.normal(0, 0.1));
    }
    if (round % 6 == 5) in[1].fix.position[0] += 3;
  }
#endif
};

}  // namespace

#define FRAMES_CASES(X)            \
  X(transform_from_yaw_, FromYaw)  \
  X(transform_chain_3d, Chained)   \
  X(fit_transform_2d_5, Fitted<2>) \
  X(fit_transform_3d_5, Fitted<3>) \
  X(fuse_and_learn_2d_3, Fused)
FIRMWARE_UNIT(FRAMES_CASES)

}  // namespace firmware::frames
