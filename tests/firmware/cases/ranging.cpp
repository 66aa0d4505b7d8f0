// SPDX-License-Identifier: MIT
// Timestamps to ranges, bias by power, heights.
#include "uwbpos/geometry/height.hpp"
#include "uwbpos/ranging/ds_twr.hpp"
#include "uwbpos/ranging/range_bias.hpp"
#include "uwbpos/ranging/ss_twr.hpp"

#include "bench.hpp"

namespace firmware::ranging {

using namespace uwbpos;

namespace {
using Range = Result<Measured<float>>;

// Options as a calibration left them: no constants that a compiler could fold.
struct Exchange {
  DsTwrStamps stamps;
  TwrOptions<float> options;
};

struct DsTwr {
  static constexpr int kRounds = 20;
  using Input = Exchange;
  using Output = Range;
  static Output run(const Input& in) { return ds_twr_range(in.stamps, in.options); }
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    firmware::make(in.stamps, random);
    in.options.antenna_delay_a = to_float(random.uniform(-0.5e-9, 0));
    in.options.antenna_delay_b = to_float(random.uniform(-0.5e-9, 0));
  }
#endif
};

// Replies of 20 ms to 4 s; in every fourth round a stamp of another exchange.
struct DsTwrLong : DsTwr {
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int round) {
    DsTwr::make(in, random, round);
    DsTwrStamps& s = in.stamps;
    const std::int64_t reply_b = std::llround(random.uniform(1.3e9, 2.5e11));
    const std::int64_t reply_a = std::llround(random.uniform(1.3e9, 2.5e11));
    s.resp_tx = s.resp_tx + reply_b;
    s.resp_rx = s.resp_rx + reply_b;
    s.final_tx = s.final_tx + (reply_b + reply_a);
    s.final_rx = s.final_rx + (reply_b + reply_a);
    const std::int64_t age = std::llround(random.uniform(1e3, 1e12));
    if (round % 16 == 3) s.poll_rx = s.poll_rx - age;
    if (round % 16 == 7) s.resp_rx = s.resp_rx + age;
    if (round % 16 == 11) s.final_tx = s.final_tx - age;
    if (round % 16 == 15) s.final_rx = s.final_rx - age;
  }
#endif
};

struct DsTwrSymmetric {
  static constexpr int kRounds = 20;
  using Input = DsTwrStamps;
  using Output = Range;
  static Output run(const Input& in) { return ds_twr_range_symmetric<float>(in); }
};

struct ClockOffset : DsTwrSymmetric {
  using Output = Result<float>;
  static Output run(const Input& in) { return ds_twr_clock_offset<float>(in); }
};

struct SsTwr {
  static constexpr int kRounds = 20;
  using Input = SsTwrStamps;
  using Output = Range;
  static Output run(const Input& in) {
    return ss_twr_range<float>(in, {.clock_offset = 3e-6f, .sigma_clock_offset = 20e-6f});
  }
};

// Intervals survive in the 32 bits that were logged.
struct SsTwrRecorded : SsTwr {
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random&, int round) {
    const Row row = recorded("hanyang_static_los")[static_cast<std::size_t>(round)];
    const auto stamp = [&](std::size_t column) {
      return DeviceTime<32>{static_cast<std::uint64_t>(row[column])};
    };
    in = {};
    in.resp_tx = in.poll_rx + (stamp(5) - stamp(4));
    in.resp_rx = in.poll_tx + (stamp(6) - stamp(3));
  }
#endif
};

// A range, the power that it came with, and the heights of its ends.
struct Reading {
  Measured<float> range;
  float power, anchor_height, tag_height;
};

struct OfReading {
  static constexpr int kRounds = 20;
  using Input = Reading;
  using Output = Range;
#ifndef FIRMWARE_TARGET
  static void make(Input& in, sim::Random& random, int) {
    in = {
        {to_float(random.uniform(1, 30)), 0.01f}, to_float(random.uniform(-100, -75)), 2.5f, 0.5f};
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

#define RANGING_CASES(X)                     \
  X(ds_twr_range_asymmetric, DsTwr)          \
  X(ds_twr_range_long, DsTwrLong)            \
  X(ds_twr_range_symmetric_, DsTwrSymmetric) \
  X(ds_twr_clock_offset_, ClockOffset)       \
  X(ss_twr_range_, SsTwr)                    \
  X(ss_twr_range_recorded, SsTwrRecorded)    \
  X(correct_range_bias_, Bias)               \
  X(horizontal_range_, Height)
FIRMWARE_UNIT(RANGING_CASES)

}  // namespace firmware::ranging
