// SPDX-License-Identifier: MIT
// Positions from range differences.
#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/solve/exclude_outliers.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/tdoa_chan.hpp"
#include "uwbpos/solve/tdoa_fang.hpp"
#include "uwbpos/solve/tdoa_least_squares.hpp"

#include "bench.hpp"

namespace firmware::difference {

using namespace uwbpos;

namespace {

constexpr float kSigma = 0.1f;  // of an arrival [m]

template <int D, std::size_t N>
struct Blink {
  Vec<float, D> reference;
  std::array<DifferenceTo<float, D>, N> differences;
};

template <int D, std::size_t N>
struct FromBlink {
  static constexpr int kRounds = 20;
  using Input = Blink<D, N>;
  using Output = Result<Fix<float, D>>;
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    const Vec<double, D> tag = point_in_room(random).head<D>();
    const Vec<double, D> first = corner_of_room(random, 0).head<D>();
    const double arrival = (tag - first).norm() + random.normal(0, 0.1);
    in.reference = first.template cast<float>();
    for (std::size_t i = 0; i < N; ++i) {
      const Vec<double, D> anchor = corner_of_room(random, i + 1).template head<D>();
      in.differences[i] = {anchor.template cast<float>(),
                           to_float((tag - anchor).norm() + random.normal(0, 0.1) - arrival)};
    }
  }
#endif
};

struct Chan3 : FromBlink<3, 7> {
  static Output run(const Input& in) { return tdoa_chan(in.reference, in.differences, kSigma); }
};
struct Fang2 : FromBlink<2, 2> {
  using Output = Result<Mirror<float, 2>>;
  static Output run(const Input& in) { return tdoa_fang(in.reference, in.differences); }
};
struct Chan2 : FromBlink<2, 4> {
  static Output run(const Input& in) { return tdoa_chan(in.reference, in.differences, kSigma); }
};
struct Fang3 : FromBlink<3, 3> {
  using Output = Result<Mirror<float, 3>>;
  static Output run(const Input& in) { return tdoa_fang(in.reference, in.differences); }
};
struct LeastSquares3 : FromBlink<3, 7> {
  static Output run(const Input& in) {
    return tdoa_least_squares(in.reference, in.differences, kSigma);
  }
};
struct LeastSquares2 : FromBlink<2, 5> {
  static Output run(const Input& in) {
    return tdoa_least_squares(in.reference, in.differences, kSigma);
  }
};
struct Locate3 : FromBlink<3, 7> {
  static Output run(const Input& in) { return locate(in.reference, in.differences, kSigma); }
};

struct Bound3 : FromBlink<3, 7> {
  using Output = Result<Mat<float, 3>>;
  static Output run(const Input& in) {
    return cramer_rao_bound(in.reference, in.differences, kSigma, Vec<float, 3>{7, 6, 2});
  }
};

struct Pairs2 {
  static constexpr int kRounds = 20;
  using Input = std::array<PairDifference<float, 2>, 6>;
  using Output = Result<Fix<float, 2>>;
  static Output run(const Input& in) { return locate(in); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    const Vec<double, 2> tag = point_in_room(random).head<2>();
    Vec<double, 2> anchors[4];
    for (std::size_t i = 0; i < 4; ++i) anchors[i] = corner_of_room(random, i).head<2>();
    std::size_t count = 0;
    for (std::size_t a = 0; a < 4; ++a) {
      for (std::size_t b = a + 1; b < 4; ++b) {
        const double difference = (tag - anchors[b]).norm() - (tag - anchors[a]).norm();
        in[count++] = {anchors[a].cast<float>(), anchors[b].cast<float>(),
                       to_float(difference + random.normal(0, 0.15)), 0.15f};
      }
    }
  }
#endif
};

struct BoundOfPairs2 : Pairs2 {
  using Output = Result<Mat<float, 2>>;
  static Output run(const Input& in) { return cramer_rao_bound(in, Vec<float, 2>{7, 6}); }
};

// Every other round one difference is metres off.
struct Excluding2 : Pairs2 {
  static constexpr int kRounds = 10;
  using Output = Result<ExclusionFix<float, 2>>;
  static Output run(const Input& in) { return locate_excluding(in); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int round) {
    Pairs2::make(in, random, round);
    if (round % 2 == 1) in[static_cast<std::size_t>(round) % 6].difference += 4;
  }
#endif
};

}  // namespace

#define DIFFERENCE_CASES(X)                  \
  X(tdoa_chan_3d_7, Chan3)                   \
  X(tdoa_chan_2d_4, Chan2)                   \
  X(tdoa_fang_3d_3, Fang3)                   \
  X(tdoa_fang_2d_2, Fang2)                   \
  X(tdoa_least_squares_3d_7, LeastSquares3)  \
  X(tdoa_least_squares_2d_5, LeastSquares2)  \
  X(locate_tdoa_3d_7, Locate3)               \
  X(tdoa_pairs_2d_6, Pairs2)                 \
  X(locate_excluding_pairs_2d_6, Excluding2) \
  X(cramer_rao_bound_tdoa_3d_7, Bound3)      \
  X(cramer_rao_bound_pairs_2d_6, BoundOfPairs2)
FIRMWARE_UNIT(DIFFERENCE_CASES)

}  // namespace firmware::difference
