// SPDX-License-Identifier: MIT

/// @file
/// Any numbers at all into what takes numbers one by one: heights, ultrasonic counts and
/// temperatures, wrapped counters, angles, the library's own functions, bias networks. An answer is
/// finite, within its bounds, and that of the standard library where there is one; everything else
/// is a named error.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/core/exponential.hpp"
#include "uwbpos/core/quaternion.hpp"
#include "uwbpos/core/trigonometry.hpp"
#include "uwbpos/filter/bias_network.hpp"
#include "uwbpos/filter/link_features.hpp"
#include "uwbpos/geometry/height.hpp"
#include "uwbpos/ranging/ultrasonic.hpp"
#include "uwbpos/time/unwrap.hpp"

#include "bytes.hpp"
#include "checks.hpp"
#include "heap.hpp"

namespace {

using namespace uwbpos;
using namespace uwbpos::fuzz;

template <class T>
bool named(const Result<T>& result) {
  if (!result) require(!describe(result.error()).empty(), "every error has a description");
  return result.has_value();
}

template <class S>
void heights(Bytes& bytes) {
  const Measured<S> slant{bytes.number(S(0.01)), bytes.number(S(0.001))};
  const S above = bytes.number(S(0.01));
  const S below = bytes.number(S(0.01));
  const auto flat = horizontal_range(slant, above, below);
  if (!named(flat)) return;
  require(flat->value >= 0 && flat->value <= slant.value, "no longer than the slant range");
  require(std::isfinite(flat->variance) && flat->variance >= 0, "a variance");
  require(slant.variance > 0 || !(flat->variance > 0), "an exact range stays one");
}

template <class S>
void ultrasound(Bytes& bytes) {
  UltrasonicOptions<S> options;
  const auto flags = bytes.take<std::uint8_t>();
  if ((flags & 1) != 0) options.temperature = bytes.number(S(0.01));
  if ((flags & 2) != 0) options.tick = bytes.number(S(1e-8));
  if ((flags & 4) != 0) options.circuit_delay = bytes.number(S(1e-6));
  if ((flags & 8) != 0) options.sigma_time = bytes.number(S(1e-7));
  if ((flags & 16) != 0) options.sigma_temperature = bytes.number(S(0.01));
  if ((flags & 32) != 0) options.max_length = bytes.number(S(0.1));
  const auto length = ultrasonic_length<S>(bytes.take<std::uint32_t>() % 300'000, options);
  if (named(length)) {
    require(length->value > 0 && length->value <= options.max_length, "within the longest");
    require(std::isfinite(length->variance) && length->variance >= 0, "a length's variance");
  }
  const auto speed = speed_of_sound(options.temperature);
  if (named(speed)) {
    require(*speed > 290 && *speed < 373, "a speed of sound");
    const auto back = temperature_from_speed_of_sound(*speed);
    require(back && std::abs(*back - options.temperature) < S(0.01), "there and back again");
  }
  const S any = bytes.number(S(0.02));
  const auto temperature = temperature_from_speed_of_sound(any);
  require(!named(temperature) || (*temperature > -61 && *temperature < 71), "a temperature");
  const auto wave = ultrasonic_wavelength(options.temperature, any * S(100));
  require(!named(wave) || (std::isfinite(*wave) && *wave >= 0), "a wavelength");
}

template <unsigned Bits>
void counters(Bytes& bytes) {
  const DeviceTime<Bits> earlier{bytes.take<std::uint64_t>()};
  const auto run = static_cast<std::int64_t>(bytes.take<std::uint64_t>() >> 24);
  const DeviceTime<Bits> later = earlier + run;
  const std::int64_t off = bytes.take<std::int32_t>() % (DeviceTime<Bits>::kWrap / 2);
  const std::int64_t host = std::max<std::int64_t>(run + off, 1);
  const auto found = unwrap_interval(later, earlier, host);
  require(found.nearest > 0 && (found.nearest - run) % DeviceTime<Bits>::kWrap == 0,
          "whole wraps apart");
  require(run == 0 || found.nearest == run, "the interval that the host is nearest to");
  if (found.other) {
    require(*found.other > 0 && std::abs(*found.other - found.nearest) == DeviceTime<Bits>::kWrap,
            "the other is a wrap away");
  }
}

template <class S>
void angles(Bytes& bytes) {
  const S x = bytes.number(S(0.01));
  const S y = bytes.number(S(0.01));
  const S wrapped = wrap_angle(x);
  require(std::isfinite(x) ? wrapped > -std::numbers::pi_v<S> && wrapped <= std::numbers::pi_v<S>
                           : std::isnan(wrapped),
          "an angle wraps");
  // Beside the standard library's in double, as near as is promised of float.
  const auto exact = double(x);
  if (std::abs(x) <= S(8192)) {
    require(std::abs(double(sine(x)) - std::sin(exact)) <= 1e-7, "a sine");
    require(std::abs(double(cosine(x)) - std::cos(exact)) <= 1e-7, "a cosine");
  }
  if (std::isfinite(x)) require(std::abs(sine(x)) <= 1 && std::abs(cosine(x)) <= 1, "within one");
  if (std::isfinite(x) && std::isfinite(y)) {
    require(std::abs(double(arctangent(y, x)) - std::atan2(double(y), exact)) <= 3e-7,
            "an arctangent");
    const S turn = angle_difference(x, y);
    require(
        !std::isfinite(x - y) || (turn > -std::numbers::pi_v<S> && turn <= std::numbers::pi_v<S>),
        "a turn wraps");
  }
  if (std::abs(x) < S(80)) {
    require(std::abs(double(exponential(x)) / std::exp(exact) - 1) <= 2e-7, "an exponential");
  }
  require(!(std::isfinite(x) && x >= 0) || std::abs(double(logarithm_of_one_plus(x)) -
                                                    std::log1p(exact)) <= 2e-7 * std::log1p(exact),
          "a logarithm");

  const Vec<S, 3> a{x, y, bytes.number(S(0.01))};
  const Vec<S, 3> b{bytes.number(S(0.01)), bytes.number(S(0.01)), bytes.number(S(0.01))};
  const auto direction = [](const Vec<S, 3>& v) {
    const Vec<S, 3> shorter = v / v.cwiseAbs().maxCoeff();  // its square fits
    return Vec<S, 3>{shorter / norm<S, 3>(shorter)};
  };
  if (all_finite(a) && all_finite(b) && !a.isZero(S(0)) && !b.isZero(S(0))) {
    const Vec<S, 3> turned = rotate<S>(quaternion_between<S>(a, b), direction(a));
    require(dot<S, 3>(turned, direction(b)) >= S(1) - S(1e-3), "one direction to the other");
  }
}

template <class S>
void network(Bytes& bytes) {
  constexpr std::size_t anchors = 2;
  constexpr std::size_t inputs = kLinkGeometry + anchors + 1;
  BiasNetwork<S, inputs, 6, 5> net{};
  const auto fill = [&](auto& layer) {
    for (auto& row : layer.weights) {
      for (S& weight : row) weight = S(0.02) * S(bytes.take<std::int8_t>());
    }
    for (S& bias : layer.biases) bias = S(0.02) * S(bytes.take<std::int8_t>());
  };
  for (std::size_t i = 0; i < inputs; ++i) {
    net.lowest[i] = S(-1) - S(bytes.take<std::uint8_t>() % 16);
    net.highest[i] = S(1) + S(i);
    net.inverse_deviation[i] = S(0.5);
  }
  fill(net.first);
  fill(net.second);
  fill(net.output);
  const auto odd = bytes.take<std::uint8_t>();
  if (odd < 64) net.second.weights[odd % 6][odd % 5] = bytes.number(S(1));
  while (!bytes.empty()) {
    const Vec<S, 3> offset{bytes.number(S(0.01)), bytes.number(S(0.01)), bytes.number(S(0.01))};
    const S yaw = bytes.number(S(0.001));
    const Quaternion<S> attitude = quaternion_from_yaw<S>(std::isfinite(yaw) ? yaw : S(0));
    const auto ids = bytes.take<std::uint8_t>();
    auto link =
        link_features<anchors, 1>(offset, rotation_matrix<S>(attitude), ids % 4U, ids / 4U % 2U);
    const S codes = link[kLinkGeometry] + link[kLinkGeometry + 1] + link[kLinkGeometry + 2];
    require(codes >= 0 && codes <= 2, "one number of an anchor, one of a tag");
    const auto bias = net(link);
    if (!named(bias)) continue;
    require(std::isfinite(*bias), "a finite bias");
    // What lies beyond training counts as its end.
    for (std::size_t i = 0; i < inputs; ++i) {
      link[i] = std::clamp(link[i], net.lowest[i], net.highest[i]);
    }
    const auto clamped = net(link);
    require(clamped && *clamped == *bias, "inputs are clamped");
  }
}

template <class S>
void run(Bytes bytes, std::uint8_t kind) {
  const NoHeap guard;
  if (kind == 0) return network<S>(bytes);
  while (!bytes.empty()) {
    if (kind == 1) heights<S>(bytes);
    if (kind == 2) ultrasound<S>(bytes);
    if (kind == 3) angles<S>(bytes);
    if (kind == 4) counters<40>(bytes);
    if (kind == 5) counters<32>(bytes);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes{std::span{data, size}};
  const auto kind = bytes.take<std::uint8_t>();
  if ((kind & 1) != 0) {
    run<float>(bytes, kind / 2 % 6);
  } else {
    run<double>(bytes, kind / 2 % 6);
  }
  return 0;
}
