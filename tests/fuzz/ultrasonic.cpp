// SPDX-License-Identifier: MIT

/// @file
/// Any counts, receivers and lengths at all into the ultrasonic methods. An answer is finite, its
/// lag and repair within their bounds, its covariance one; everything else is a named error.

#include "uwbpos/ranging/ultrasonic.hpp"

#include <array>
#include <cmath>
#include <cstdlib>
#include <span>

#include "uwbpos/solve/fsri.hpp"

#include "bytes.hpp"
#include "checks.hpp"

namespace {

using namespace uwbpos::fuzz;
using uwbpos::Vec;

// Few, because each more multiplies the repairs that a hopeless shot has tried.
constexpr std::size_t kMost = 5;

template <class S, int D>
void run(Bytes bytes) {
  const auto flags = bytes.take<std::uint8_t>();
  const auto known = take_options<S, D>(bytes, flags);
  uwbpos::FsriOptions<S, D> options;
  options.side = known.side;
  options.prior = known.prior;
  if ((flags & 4) != 0) options.wavelength = bytes.number(S(0.0001));
  if ((flags & 8) != 0) options.max_lag = bytes.number(S(0.001));
  if ((flags & 16) != 0) options.sigma = bytes.number(S(0.0001));
  if ((flags & 32) != 0) options.max_repair = bytes.take<std::uint8_t>() % 3;
  std::array<Vec<S, D>, kMost> receivers;
  std::array<S, kMost> lengths;
  std::size_t count = 0;
  while (count < kMost && !bytes.empty()) {
    for (S& coordinate : receivers[count]) coordinate = bytes.number(S(0.001));
    lengths[count] = std::abs(bytes.number(S(0.0005)));
    if ((flags & 64) != 0) {
      const auto length = uwbpos::ultrasonic_length<S>(bytes.take<std::uint32_t>());
      if (length) lengths[count] = length->value;
    }
    ++count;
  }
  const std::span points{receivers.data(), count};
  const std::span values{lengths.data(), count};
  const auto shot = uwbpos::fsri(points, values, options);
  if (shot) {
    for (const S coordinate : shot->position) require(std::isfinite(coordinate), "finite position");
    const S most = options.max_lag.value_or(S(5) * options.wavelength);
    require(shot->lag >= 0 && shot->lag <= most, "the lag is within its bounds");
    for (const int waves : shot->repair) {
      require(std::abs(waves) <= options.max_repair, "the repair is within its bounds");
    }
    require(std::isfinite(shot->residual) && shot->residual >= 0, "residual");
    require(shot->degrees_of_freedom == static_cast<int>(count) - D - 1, "degrees of freedom");
    check_covariance<S, D + 1>(shot->covariance);
  }
  check<S, D>(uwbpos::locate_conventional(points, values, S(0), options), count);
  if (const auto fix = uwbpos::locate_time_difference(points, values, options)) {
    for (const S coordinate : fix->position) require(std::isfinite(coordinate), "finite position");
    check_covariance<S, D + 1>(fix->covariance);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  with_scalar_and_dimension(Bytes{std::span{data, size}},
                            []<class S, int D>(Bytes bytes) { run<S, D>(bytes); });
  return 0;
}
