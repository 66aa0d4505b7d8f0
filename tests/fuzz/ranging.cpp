// SPDX-License-Identifier: MIT

/// @file
/// Any timestamps at all through every kind of exchange, the clock tracker and the power-bias
/// table. A range is finite and within its bounds, or there is a named error.

#include <array>
#include <cmath>
#include <cstdint>
#include <span>

#include "uwbpos/ranging/ds_twr.hpp"
#include "uwbpos/ranging/range_bias.hpp"
#include "uwbpos/ranging/ss_twr.hpp"
#include "uwbpos/time/rate_tracker.hpp"

#include "bytes.hpp"

namespace {

using uwbpos::fuzz::Bytes;
using uwbpos::fuzz::require;

// Mostly an interval that an exchange has, sometimes any.
uwbpos::DeviceTime<> after(uwbpos::DeviceTime<> earlier, Bytes& bytes) {
  const auto kind = bytes.take<std::uint8_t>();
  if (kind < 128) return earlier + std::int64_t{bytes.take<std::uint16_t>()};
  if (kind < 240) return earlier + std::int64_t{bytes.take<std::uint32_t>()};
  return uwbpos::DeviceTime<>{bytes.take<std::uint64_t>()};
}

template <class S>
void check(const uwbpos::Result<uwbpos::Measured<S>>& range, S max_range) {
  if (!range) {
    require(!uwbpos::describe(range.error()).empty(), "every error has a description");
    return;
  }
  require(std::isfinite(range->value) && range->value <= max_range,
          "a finite range below the maximum");
  // Zero is what the square of a denormal sigma rounds to.
  require(std::isfinite(range->variance) && range->variance >= 0, "no negative variance");
}

template <class S>
void run(Bytes bytes) {
  uwbpos::TwrOptions<S> options;
  const auto flags = bytes.take<std::uint8_t>();
  if ((flags & 1) != 0) options.clock_offset = bytes.number(S(1e-9));
  if ((flags & 2) != 0) options.antenna_delay_a = bytes.number(S(1e-12));
  if ((flags & 4) != 0) options.antenna_delay_b = bytes.number(S(1e-12));
  if ((flags & 8) != 0) options.sigma_timestamp = bytes.number(S(1e-12));
  if ((flags & 16) != 0) options.max_range = bytes.number(S(1));

  uwbpos::DsTwrStamps stamps;
  stamps.poll_tx = uwbpos::DeviceTime<>{bytes.take<std::uint64_t>()};
  stamps.poll_rx = uwbpos::DeviceTime<>{bytes.take<std::uint64_t>()};
  stamps.resp_tx = after(stamps.poll_rx, bytes);
  // About as late as the reply, as a real round trip is.
  stamps.resp_rx = after(stamps.poll_tx + (stamps.resp_tx - stamps.poll_rx), bytes);
  stamps.final_tx = after(stamps.resp_rx, bytes);
  stamps.final_rx = after(stamps.resp_tx + (stamps.final_tx - stamps.resp_rx), bytes);
  const uwbpos::SsTwrStamps single{stamps.poll_tx, stamps.poll_rx, stamps.resp_tx, stamps.resp_rx};

  check<S>(uwbpos::ss_twr_range(single, options), options.max_range);
  check<S>(uwbpos::ds_twr_range(stamps, options), options.max_range);
  check<S>(uwbpos::ds_twr_range_symmetric(stamps, options), options.max_range);
  if (const auto offset = uwbpos::ds_twr_clock_offset<S>(stamps)) {
    require(std::isfinite(*offset), "a finite clock offset");
  }

  const std::array<uwbpos::RangeBiasPoint<S>, 3> points{
      {{bytes.number(S(0.01)), bytes.number(S(0.001))},
       {bytes.number(S(0.01)), bytes.number(S(0.001))},
       {bytes.number(S(0.01)), bytes.number(S(0.001))}}};
  if (const auto table = uwbpos::RangeBias<S>::make(points)) {
    const auto bias = table->at(bytes.number(S(0.01)));
    require(!bias || std::isfinite(*bias), "a finite bias");
  }

  uwbpos::RateTracker<S> tracker;
  std::int64_t host_microseconds = 0;
  while (!bytes.empty()) {
    stamps.poll_tx = after(stamps.poll_tx, bytes);
    stamps.poll_rx = after(stamps.poll_rx, bytes);
    host_microseconds += bytes.take<std::int32_t>() >> (bytes.take<std::uint8_t>() % 32);
    if (const auto rate = tracker.update(stamps.poll_tx, stamps.poll_rx, host_microseconds)) {
      require(std::isfinite(rate->value), "a finite rate");
      require(rate->variance >= 0 && std::isfinite(rate->variance), "a variance of the rate");
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
