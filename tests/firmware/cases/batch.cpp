// SPDX-License-Identifier: MIT
// Epochs by the register: four together and two alone, one of which misses an anchor.
#include "uwbpos/solve/batch.hpp"

#include <cmath>
#include <limits>

#include "bench.hpp"

namespace firmware::batch {

using namespace uwbpos;

namespace {

constexpr std::size_t kAnchors = 6;
constexpr std::size_t kEpochs = 6;

// What all epochs share, and anchor by anchor what each has; one number is missing.
struct Epochs {
  static constexpr int kRounds = 5;
  struct Input {
    std::array<Vec<float, 3>, kAnchors + 1> anchors;  // the last is the reference
    std::array<float, kAnchors * kEpochs> values;
  };
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, bool differences) {
    for (std::size_t i = 0; i <= kAnchors; ++i) {
      in.anchors[i] = corner_of_room(random, i).cast<float>();
    }
    for (std::size_t e = 0; e < kEpochs; ++e) {
      const Vec<double, 3> tag = point_in_room(random);
      const auto to = [&](std::size_t i) {
        return (tag - in.anchors[i].cast<double>()).norm() + random.normal(0, 0.05);
      };
      const double from = differences ? to(kAnchors) : 0.0;
      for (std::size_t i = 0; i < kAnchors; ++i)
        in.values[i * kEpochs + e] = to_float(to(i) - from);
    }
    in.values[2 * kEpochs + 1] = std::numeric_limits<float>::quiet_NaN();
  }
#endif
};

constexpr std::array<float, kAnchors> kSigmas{0.05f, 0.05f, 0.05f, 0.1f, 0.1f, 0.1f};

struct FromRanges : Epochs {
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) { Epochs::make(in, random, false); }
#endif
  static RangeBatch<float, 3> of(const Input& in) {
    return {std::span{in.anchors}.first(kAnchors), kSigmas, in.values};
  }
};

struct Fixes {
  std::uint32_t together;
  std::array<Result<Fix<float, 3>>, kEpochs> fixes;
};

struct LeastSquares : FromRanges {
  using Output = Fixes;
  static Output run(const Input& in) {
    Output out{};
    const auto together = toa_least_squares(of(in), std::span<Result<Fix<float, 3>>>{out.fixes});
    out.together = static_cast<std::uint32_t>(together.value_or(kEpochs + 1));
    return out;
  }
};
struct ClosedForm : FromRanges {
  struct Output {
    std::uint32_t together;
    std::array<Result<Mirror<float, 3>>, kEpochs> positions;
  };
  static Output run(const Input& in) {
    Output out{};
    const auto together =
        toa_closed_form(of(in), std::span<Result<Mirror<float, 3>>>{out.positions});
    out.together = static_cast<std::uint32_t>(together.value_or(kEpochs + 1));
    return out;
  }
};
struct Differences : Epochs {
  using Output = Fixes;
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) { Epochs::make(in, random, true); }
#endif
  static Output run(const Input& in) {
    Output out{};
    const DifferenceBatch<float, 3> batch{in.anchors[kAnchors],
                                          std::span{in.anchors}.first(kAnchors), 0.05f, in.values};
    const auto together = locate(batch, std::span<Result<Fix<float, 3>>>{out.fixes});
    out.together = static_cast<std::uint32_t>(together.value_or(kEpochs + 1));
    return out;
  }
};

}  // namespace

#define BATCH_CASES(X)                          \
  X(toa_least_squares_batch_3d_6, LeastSquares) \
  X(toa_closed_form_batch_3d_6, ClosedForm)     \
  X(locate_tdoa_batch_3d_6, Differences)
FIRMWARE_UNIT(BATCH_CASES)

}  // namespace firmware::batch
