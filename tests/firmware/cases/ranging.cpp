// SPDX-License-Identifier: MIT
// Timestamps to ranges, bias by power, heights.
#include "uwbpos/geometry/height.hpp"
#include "uwbpos/ranging/range_bias.hpp"

#include "cases/entries.hpp"

namespace {

using namespace uwbpos;
using Range = Result<Measured<float>>;

struct DsTwr {
  static constexpr int kRounds = 20;
  using Input = DsTwrStamps;
  using Output = Range;
  static Output run(const Input& in) { return ds_twr_range<float>(in); }
};

struct DsTwrSymmetric {
  static constexpr int kRounds = 20;
  using Input = DsTwrStamps;
  using Output = Range;
  static Output run(const Input& in) { return ds_twr_range_symmetric<float>(in); }
};

struct SsTwr {
  static constexpr int kRounds = 20;
  using Input = SsTwrStamps;
  using Output = Range;
  static Output run(const Input& in) {
    return ss_twr_range<float>(in, {.clock_offset = 3e-6f, .sigma_clock_offset = 20e-6f});
  }
};

// A range, the power that it came with, and the heights of its ends.
struct Reading {
  Measured<float> range;
  float power, anchor_height, tag_height;
};

template <class Words>
void transfer(Words& words, Reading& r) {
  firmware::transfer_all(words, r.range, r.power, r.anchor_height, r.tag_height);
}

struct OfReading {
  static constexpr int kRounds = 20;
  using Input = Reading;
  using Output = Range;
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    in = {{firmware::to_float(random.uniform(1, 30)), 0.01f},
          firmware::to_float(random.uniform(-100, -75)),
          2.5f,
          0.5f};
  }
#endif
};

struct Bias : OfReading {
  static Output run(const Input& in) {
    static constexpr RangeBiasPoint<float> kTable[] = {
        {-95, 0.11f}, {-89, 0.06f}, {-83, 0}, {-77, -0.08f}};
    return correct_range_bias(in.range, in.power, *RangeBias<float>::make(kTable));
  }
};

struct Height : OfReading {
  static Output run(const Input& in) {
    return horizontal_range(in.range, in.anchor_height, in.tag_height);
  }
};

}  // namespace

FIRMWARE_FUNCTION(ds_twr_range_asymmetric, DsTwr)
FIRMWARE_FUNCTION(ds_twr_range_symmetric_, DsTwrSymmetric)
FIRMWARE_FUNCTION(ss_twr_range_, SsTwr)
FIRMWARE_FUNCTION(correct_range_bias_, Bias)
FIRMWARE_FUNCTION(horizontal_range_, Height)

std::span<const firmware::Entry> firmware::ranging_entries() {
  static constexpr Entry kEntries[] = {
      FIRMWARE_ENTRY(ds_twr_range_asymmetric, DsTwr),
      FIRMWARE_ENTRY(ds_twr_range_symmetric_, DsTwrSymmetric), FIRMWARE_ENTRY(ss_twr_range_, SsTwr),
      FIRMWARE_ENTRY(correct_range_bias_, Bias), FIRMWARE_ENTRY(horizontal_range_, Height)};
  return kEntries;
}
