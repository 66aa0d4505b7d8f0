// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A radio that plays a recorded stream of exchanges from flash.

#include <span>

#include "tag.hpp"

namespace tag {

/// What the recording holds of an exchange.
struct RecordedExchange {
  std::int64_t time;
  std::uint32_t tag, station;
  std::uint64_t stamps[6];
  float power;
};

/// Plays from first to last, then ends.
class RecordedRadio final : public Radio {
 public:
  explicit RecordedRadio(std::span<const RecordedExchange> recording) : recording_{recording} {}

  std::optional<Exchange> next() override {
    if (place_ == recording_.size()) return std::nullopt;
    const RecordedExchange& r = recording_[place_++];
    const auto at = [&](int i) { return uwbpos::DeviceTime<>{r.stamps[i]}; };
    return Exchange{r.time, r.tag, r.station, {at(0), at(1), at(2), at(3), at(4), at(5)}, r.power};
  }

 private:
  std::span<const RecordedExchange> recording_;
  std::size_t place_ = 0;
};

}  // namespace tag
