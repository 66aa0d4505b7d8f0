// SPDX-License-Identifier: MIT
// Positions from ranges.
#include "uwbpos/accuracy/dop.hpp"
#include "uwbpos/solve/bancroft.hpp"
#include "uwbpos/solve/exclude_outliers.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/pseudorange_least_squares.hpp"
#include "uwbpos/solve/toa_chan.hpp"
#include "uwbpos/solve/toa_linear.hpp"
#include "uwbpos/solve/toa_refine.hpp"
#include "uwbpos/solve/toa_three_anchors.hpp"

#include "bench.hpp"

namespace firmware::position {

using namespace uwbpos;

namespace {

template <int D, std::size_t N>
struct FromRanges {
  static constexpr int kRounds = 20;
  using Input = std::array<RangeTo<float, D>, N>;
  using Output = Result<Fix<float, D>>;
};

struct LeastSquares3 : FromRanges<3, 8> {
  static Output run(const Input& in) { return toa_least_squares(in); }
};
struct LeastSquares2 : FromRanges<2, 4> {
  static Output run(const Input& in) { return toa_least_squares(in); }
};
// From the last fix, 0.3 m away as a rule.
struct Refine3 {
  static constexpr int kRounds = 20;
  struct Input {
    std::array<RangeTo<float, 3>, 8> ranges;
    Vec<float, 3> last;
  };
  using Output = Result<Fix<float, 3>>;
  static Output run(const Input& in) { return toa_refine(in.ranges, in.last); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    const Vec<double, 3> tag = point_in_room(random);
    for (std::size_t i = 0; i < in.ranges.size(); ++i) {
      const Vec<double, 3> anchor = corner_of_room(random, i);
      const double range = (tag - anchor).norm() + random.normal(0, 0.1);
      in.ranges[i] = {anchor.cast<float>(), to_float(range), 0.1f};
    }
    for (int k = 0; k < 3; ++k) in.last[k] = to_float(tag[k] + random.normal(0, 0.2));
  }
#endif
};
struct Linear3 : FromRanges<3, 8> {
  static Output run(const Input& in) { return toa_linear(in); }
};
struct Chan3 : FromRanges<3, 8> {
  static Output run(const Input& in) { return toa_chan(in); }
};
struct ClosedForm3 : FromRanges<3, 4> {
  using Output = Result<Mirror<float, 3>>;
  static Output run(const Input& in) { return toa_closed_form(in); }
};
struct ThreeAnchors : FromRanges<2, 3> {
  using Output = Result<Vec<float, 2>>;
  static Output run(const Input& in) { return toa_three_anchors(in); }
};
struct OnAxes {
  static constexpr int kRounds = 20;
  struct Input {
    float d1, d2, d3, x2, y3;
  };
  using Output = Result<Vec<float, 2>>;
  static Output run(const Input& in) { return toa_on_axes(in.d1, in.d2, in.d3, in.x2, in.y3); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    const Vec<double, 2> tag = point_in_room(random).head<2>();
    const auto range = [&](const Vec<double, 2>& anchor) {
      return to_float((tag - anchor).norm() + random.normal(0, 0.1));
    };
    in = {range({0, 0}), range({20, 0}), range({0, 15}), 20, 15};
  }
#endif
};
struct Linear2 : FromRanges<2, 4> {
  static Output run(const Input& in) { return toa_linear(in); }
};
struct Chan2 : FromRanges<2, 4> {
  static Output run(const Input& in) { return toa_chan(in); }
};
struct ClosedForm2 : FromRanges<2, 3> {
  using Output = Result<Mirror<float, 2>>;
  static Output run(const Input& in) { return toa_closed_form(in); }
};
struct Locate3 : FromRanges<3, 8> {
  static Output run(const Input& in) { return locate(in); }
};
// Three tags among eight anchors, ten poses.
struct LocateRecorded : FromRanges<3, 8> {
  static Output run(const Input& in) { return locate(in, {.side = {0, 0, -1}}); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random&, int round) {
    const std::vector<Row> rows = recorded("lias_mid");
    const std::vector<Row> anchors = recorded("lias_anchors");
    const auto tag = static_cast<std::size_t>(round % 3);
    for (std::size_t i = 0; i < 8; ++i) {
      const Row& row = rows[static_cast<std::size_t>(round / 3) * 24 + 3 * i + tag];
      const Row& anchor = anchors[static_cast<std::size_t>(row[2])];
      in[i] = {
          {to_float(anchor[1]), to_float(anchor[2]), to_float(anchor[3])}, to_float(row[3]), 0.1f};
    }
  }
#endif
};
struct Locate2 : FromRanges<2, 4> {
  static Output run(const Input& in) { return locate(in); }
};

// Anchors on one ceiling, the tag below it.
struct LocateCeiling : FromRanges<3, 6> {
  static Output run(const Input& in) { return locate(in, {.side = {0, 0, -1}}); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    const Vec<double, 3> tag{random.uniform(0, 20), random.uniform(0, 15), random.uniform(0, 2)};
    for (std::size_t i = 0; i < in.size(); ++i) {
      Vec<double, 3> anchor = point_in_room(random);
      anchor[2] = 5;
      in[i] = {anchor.cast<float>(), to_float((tag - anchor).norm() + random.normal(0, 0.1)), 0.1f};
    }
  }
#endif
};

// Every other round one range is metres off.
struct Excluding3 : FromRanges<3, 8> {
  static constexpr int kRounds = 10;
  using Output = Result<ExclusionFix<float, 3>>;
  static Output run(const Input& in) { return locate_excluding(in); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int round) {
    firmware::make(in, random);
    if (round % 2 == 1) in[static_cast<std::size_t>(round) % 8].range += 4;
  }
#endif
};

struct Bancroft3 : FromRanges<3, 8> {
  using Output = Result<BancroftSolution<float, 3>>;
  static Output run(const Input& in) { return bancroft(in); }
};
struct WithBias3 : FromRanges<3, 8> {
  using Output = Result<BiasedFix<float, 3>>;
  static Output run(const Input& in) { return locate_with_bias(in); }
};
struct Dilution3 : FromRanges<3, 8> {
  using Output = Result<Dop<float>>;
  static Output run(const Input& in) {
    std::array<Vec<float, 3>, 8> anchors;
    for (std::size_t i = 0; i < 8; ++i) anchors[i] = in[i].anchor;
    return range_dop(anchors, Vec<float, 3>{7, 6, 2});
  }
};
struct PseudorangeDilution3 : FromRanges<3, 8> {
  using Output = Result<Dop<float>>;
  static Output run(const Input& in) {
    std::array<Vec<float, 3>, 8> anchors;
    for (std::size_t i = 0; i < 8; ++i) anchors[i] = in[i].anchor;
    return pseudorange_dop(anchors, Vec<float, 3>{7, 6, 2});
  }
};
struct Bound3 : FromRanges<3, 8> {
  using Output = Result<Mat<float, 3>>;
  static Output run(const Input& in) { return cramer_rao_bound(in, Vec<float, 3>{7, 6, 2}); }
};

}  // namespace

#define POSITION_CASES(X)                       \
  X(toa_least_squares_3d_8, LeastSquares3)      \
  X(toa_least_squares_2d_4, LeastSquares2)      \
  X(toa_refine_3d_8, Refine3)                   \
  X(toa_linear_3d_8, Linear3)                   \
  X(toa_chan_3d_8, Chan3)                       \
  X(toa_closed_form_3d_4, ClosedForm3)          \
  X(toa_linear_2d_4, Linear2)                   \
  X(toa_chan_2d_4, Chan2)                       \
  X(toa_closed_form_2d_3, ClosedForm2)          \
  X(toa_three_anchors_2d, ThreeAnchors)         \
  X(toa_on_axes_2d, OnAxes)                     \
  X(locate_3d_8, Locate3)                       \
  X(locate_3d_8_recorded, LocateRecorded)       \
  X(locate_2d_4, Locate2)                       \
  X(locate_ceiling_6, LocateCeiling)            \
  X(locate_excluding_3d_8, Excluding3)          \
  X(bancroft_3d_8, Bancroft3)                   \
  X(locate_with_bias_3d_8, WithBias3)           \
  X(range_dop_3d_8, Dilution3)                  \
  X(pseudorange_dop_3d_8, PseudorangeDilution3) \
  X(cramer_rao_bound_3d_8, Bound3)
FIRMWARE_UNIT(POSITION_CASES)

}  // namespace firmware::position
