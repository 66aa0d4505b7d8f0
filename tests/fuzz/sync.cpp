// SPDX-License-Identifier: MIT

/// @file
/// Any sync frames, blinks and packets at all through the clock tracker and both kinds of range
/// differences. What comes out is finite and within its bounds, or there is a named error.

#include <cmath>
#include <cstdint>
#include <span>

#include "uwbpos/ranging/tdoa_downlink.hpp"
#include "uwbpos/ranging/tdoa_uplink.hpp"
#include "uwbpos/time/clock_sync.hpp"

#include "bytes.hpp"

namespace {

using uwbpos::DeviceTime;
using uwbpos::fuzz::Bytes;
using uwbpos::fuzz::require;

// Mostly a step that frames are apart, sometimes a small one, sometimes any.
std::int64_t step(Bytes& bytes) {
  const auto kind = bytes.take<std::uint8_t>();
  if (kind < 160) return std::int64_t{bytes.take<std::uint16_t>()} << 20;
  if (kind < 220) return bytes.take<std::int32_t>();
  return static_cast<std::int64_t>(bytes.take<std::uint64_t>() >> 24);
}

template <class S>
uwbpos::ClockSync<S> tracker(Bytes& bytes) {
  uwbpos::ClockSyncOptions<S> options;
  const auto flags = bytes.take<std::uint8_t>();
  if ((flags & 1) != 0) options.sigma_timestamp = bytes.number(S(1e-12));
  if ((flags & 2) != 0) options.wander = bytes.number(S(1e-12));
  if ((flags & 4) != 0) options.max_clock_offset = bytes.number(S(1e-8));
  if ((flags & 8) != 0) options.max_excess = bytes.number(S(1e-9));
  if ((flags & 16) != 0) options.max_outliers = bytes.take<std::uint8_t>();
  if ((flags & 32) != 0) options.max_gap = bytes.take<std::int32_t>();
  if ((flags & 64) != 0) options.max_age = bytes.take<std::int32_t>();
  if ((flags & 128) != 0) options.reorder_window = bytes.take<std::int64_t>();
  return uwbpos::ClockSync<S>{options};
}

template <class S>
void run(Bytes bytes) {
  uwbpos::ClockSync<S> sync = tracker<S>(bytes);
  uwbpos::TdoaUplinkOptions<S> options;
  const auto flags = bytes.take<std::uint8_t>();
  if ((flags & 1) != 0) options.sigma_timestamp = bytes.number(S(1e-12));
  if ((flags & 2) != 0) options.max_difference = bytes.number(S(1));
  uwbpos::TdoaDownlinkOptions<S> down;
  if ((flags & 4) != 0) down.sigma_timestamp = bytes.number(S(1e-12));
  if ((flags & 8) != 0) down.max_interval = bytes.number(S(1e-3));
  if ((flags & 16) != 0) down.max_clock_offset = bytes.number(S(1e-6));
  if ((flags & 32) != 0) down.antenna_delay_b = bytes.number(S(1e-12));

  DeviceTime<> control{bytes.take<std::uint64_t>()};
  DeviceTime<> anchor{bytes.take<std::uint64_t>()};
  std::int64_t host = 0;
  while (!bytes.empty()) {
    // Both clocks run on alike, but for what one byte adds.
    const std::int64_t run = step(bytes);
    const auto kind = bytes.take<std::uint8_t>();
    anchor = anchor + run;
    control = control + (run + (kind < 200 ? std::int64_t{kind} : step(bytes)));
    host += kind < 230 ? 1 + run / 63'898 : bytes.take<std::int32_t>();
    if (kind == 255) host = bytes.take<std::int64_t>() / 2;

    if (const auto rate = sync.update(control, anchor, bytes.number(S(1e-10)), host)) {
      require(std::abs(rate->value) <= S(200e-6), "a rate within the bound");
      require(std::isfinite(rate->variance) && rate->variance >= 0, "a variance of the rate");
    }
    const DeviceTime<> stamp = anchor + std::int64_t{bytes.take<std::int32_t>()};
    const auto zero = uwbpos::control_arrival<S>(control + step(bytes), S(0), options);
    const auto one = uwbpos::anchor_arrival<S>(sync, stamp, host, bytes.number(S(1e-12)), options);
    if (zero && one) {
      require(std::isfinite(one->fraction), "a finite time");
      require(std::isfinite(one->variance) && one->variance >= 0, "a variance of the time");
      if (const auto d = uwbpos::tdoa_uplink_difference(*zero, *one, options)) {
        require(std::abs(d->value) <= options.max_difference, "a difference within the bound");
        require(d->variance >= d->shared_variance && std::isfinite(d->variance),
                "a variance of the difference");
      }
    }
    const uwbpos::DownlinkStamps stamps{stamp, stamp + run, anchor, control};
    const auto d = uwbpos::tdoa_downlink_difference<S>(
        stamps, {bytes.number(S(1e-8)), bytes.number(S(1e-18))}, bytes.number(S(1e-10)), down);
    if (d) {
      require(std::abs(d->value) <= down.max_difference, "a difference within the bound");
      require(std::isfinite(d->variance) && d->variance >= 0, "a variance of the difference");
    }
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes{std::span{data, size}};
  if ((bytes.take<std::uint8_t>() & 1) != 0) {
    run<float>(bytes);
  } else {
    run<double>(bytes);
  }
  return 0;
}
