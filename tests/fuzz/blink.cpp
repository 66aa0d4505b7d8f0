// SPDX-License-Identifier: MIT

/// @file
/// Any sync frames and blinks at all through a subnet of anchors, and what it makes of a blink
/// into `locate`. Differences are finite and within their bound, arrivals are used or counted as
/// refused, and whatever comes out suits a solver or is refused by name.

#include <array>
#include <cmath>
#include <cstdint>
#include <span>

#include "uwbpos/ranging/uplink_subnet.hpp"
#include "uwbpos/solve/locate.hpp"

#include "bytes.hpp"
#include "checks.hpp"
#include "heap.hpp"

namespace {

using namespace uwbpos;
using namespace uwbpos::fuzz;

// One less than an id can name, so that the limit and an unknown id are met too.
constexpr int kCapacity = 5;
constexpr double kTicks = 499.2e6 * 128;  // a second

template <class S, int D>
void run(Bytes bytes) {
  const auto flags = bytes.take<std::uint8_t>();
  Anchors<S, D, kCapacity> anchors;
  for (std::uint32_t id = 0; id < 6; ++id) {
    Vec<S, D> place;
    for (S& coordinate : place) {
      coordinate = (flags & 1) != 0 ? bytes.number(S(0.01)) : S(bytes.take<std::uint8_t>() % 16);
    }
    const int before = anchors.size();
    const auto added = anchors.add(bytes.take<std::uint8_t>() % 7U, place);
    require(anchors.size() == before + (added ? 1 : 0), "one more, or none");
    for (int i = 1; i < anchors.size(); ++i) {
      require(anchors[i - 1].id < anchors[i].id, "anchors stand by id");
    }
  }
  ClockSyncOptions<S> clocks;
  TdoaUplinkOptions<S> options;
  if ((flags & 2) != 0) clocks.wander = bytes.number(S(1e-12));
  if ((flags & 4) != 0) clocks.max_gap = bytes.take<std::int32_t>();
  if ((flags & 8) != 0) clocks.max_age = bytes.take<std::int64_t>();
  if ((flags & 16) != 0) options.sigma_timestamp = bytes.number(S(1e-12));
  if ((flags & 32) != 0) options.max_difference = bytes.number(S(1));
  if ((flags & 64) != 0) options.propagation_speed = bytes.number(S(1e6));
  const std::uint32_t control = bytes.take<std::uint8_t>() % 7U;
  auto subnet = UplinkSubnet<S, D, kCapacity>::make(anchors, control, clocks, options);
  if (!subnet) {
    require(subnet.error() == Error::UnknownAnchor || subnet.error() == Error::InvalidOption,
            "why there is no subnet");
    return;
  }

  // Clocks of some parts in a million, which jump now and then.
  std::array<std::int64_t, 7> offsets{};
  std::array<int, 7> rates{};
  for (auto& offset : offsets)
    offset = static_cast<std::int64_t>(bytes.take<std::uint64_t>() >> 24);
  for (int& rate : rates) rate = bytes.take<std::int8_t>();
  std::int64_t host = bytes.take<std::int32_t>();
  std::int64_t ticks = bytes.take<std::uint32_t>();
  const auto reads = [&](std::uint32_t id, std::int64_t at) {
    const std::int64_t drift = at / 1'000'000 * rates[id];
    return DeviceTime<>{static_cast<std::uint64_t>(at + drift + offsets[id])};
  };
  while (!bytes.empty()) {
    const auto kind = bytes.take<std::uint8_t>();
    const auto run = bytes.take<std::uint8_t>();
    const std::int64_t micros = run < 250 ? 1000 * std::int64_t{run} : bytes.take<std::int32_t>();
    ticks += static_cast<std::int64_t>(static_cast<double>(micros) * (kTicks / 1e6));
    host += micros;
    if (kind == 255) host = bytes.take<std::int64_t>() / 2;
    if (kind == 254)
      offsets[run % 7] = static_cast<std::int64_t>(bytes.take<std::uint64_t>() >> 24);
    if (kind < 128) {
      // A sync frame at every anchor, a part of a metre early or late.
      for (std::uint32_t id = 0; id < 7; ++id) {
        if ((kind >> id & 1) != 0 && run % 4 != 0) continue;
        Result<Vec<S, D>> there = anchors.find(id);
        double flight = 0;
        if (there) flight = double((*there - *anchors.find(control)).norm()) / 299792458.0;
        const std::int64_t late = bytes.take<std::int8_t>();
        const std::int64_t light =
            std::abs(flight) < 1 ? static_cast<std::int64_t>(flight * kTicks) : 0;
        const NoHeap guard;
        const auto rate =
            subnet->sync(id, reads(control, ticks), reads(id, ticks + light + late), host);
        if (!rate) continue;
        require(std::abs(rate->value) <= S(200e-6), "a rate within the bound");
        require(std::isfinite(rate->variance) && rate->variance >= 0, "a variance of the rate");
        require(subnet->rate(id).has_value(), "a rate that was told is known");
      }
      continue;
    }
    std::array<BlinkArrival, kCapacity + 1> arrivals;
    const std::size_t count = kind % (arrivals.size() + 1);
    for (std::size_t i = 0; i < count; ++i) {
      const auto id = bytes.take<std::uint8_t>();
      arrivals[i] = {id % 7U, reads(id % 7U, ticks + bytes.take<std::int16_t>() / 4)};
      if (id > 250) arrivals[i].stamp = DeviceTime<>{bytes.take<std::uint64_t>()};
    }
    const auto blink = [&] {
      const NoHeap guard;
      return subnet->differences(std::span{arrivals.data(), count}, host);
    }();
    if (!blink) {
      require(
          blink.error() == Error::TooFewMeasurements || blink.error() == Error::TooManyMeasurements,
          "why a blink gives nothing");
      continue;
    }
    require(blink->size > 0 && blink->size + blink->refused + 1 == static_cast<int>(count),
            "each arrival is used or refused");
    require(std::isfinite(blink->sigma) && blink->sigma >= 0, "the sigma of an arrival");
    require(anchors.contains(blink->reference_id), "the reference is an anchor");
    for (const auto& difference : blink->differences()) {
      require(std::abs(difference.difference) <= options.max_difference, "within the bound");
    }
    check<S, D>(locate(blink->reference, blink->differences(), blink->sigma),
                static_cast<std::size_t>(blink->size));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  with_scalar_and_dimension(Bytes{std::span{data, size}},
                            []<class S, int D>(Bytes bytes) { run<S, D>(bytes); });
  return 0;
}
