// SPDX-License-Identifier: MIT

/// @file
/// Any ranges at all into every solver of ranges. An answer is finite, with a symmetric
/// covariance that no direction makes negative; everything else is a named error.

#include "uwbpos/solve/locate.hpp"

#include <array>
#include <cmath>
#include <optional>
#include <span>

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/accuracy/dop.hpp"
#include "uwbpos/solve/toa_chan.hpp"
#include "uwbpos/solve/toa_closed_form.hpp"
#include "uwbpos/solve/toa_least_squares.hpp"
#include "uwbpos/solve/toa_linear.hpp"

#include "bytes.hpp"

namespace {

using uwbpos::fuzz::Bytes;
using uwbpos::fuzz::require;

// More than any solver takes, so that the limit is met too.
constexpr std::size_t kMost = uwbpos::kMaxMeasurements + 2;

template <class S, int D>
void check_covariance(const uwbpos::Mat<S, D>& covariance) {
  // A few roundings of the two variances that bound the covariance.
  constexpr S kRounding = 64 * std::numeric_limits<S>::epsilon();
  for (int i = 0; i < D; ++i) {
    require(std::isfinite(covariance(i, i)) && covariance(i, i) >= 0, "variances are not negative");
    for (int j = 0; j < i; ++j) {
      const S mean = std::sqrt(covariance(i, i)) * std::sqrt(covariance(j, j));
      require(std::abs(covariance(i, j)) <= mean * (1 + kRounding), "correlations are within one");
      require(std::abs(covariance(i, j) - covariance(j, i)) <= mean * kRounding,
              "the covariance is symmetric");
    }
  }
}

template <class S, int D>
void check(const uwbpos::Result<uwbpos::Fix<S, D>>& fix, std::size_t ranges) {
  if (!fix) {
    require(!uwbpos::describe(fix.error()).empty(), "every error has a description");
    return;
  }
  for (const S coordinate : fix->position) require(std::isfinite(coordinate), "finite position");
  require(fix->chi_squared >= 0, "chi squared is not negative");
  require(fix->degrees_of_freedom == static_cast<int>(ranges) - D, "degrees of freedom");
  check_covariance<S, D>(fix->covariance);
}

template <class S, int D>
void run(Bytes bytes) {
  uwbpos::LocateOptions<S, D> options;
  const auto flags = bytes.take<std::uint8_t>();
  if ((flags & 1) != 0) {
    for (S& coordinate : options.side) coordinate = bytes.number(S(1));
  }
  if ((flags & 2) != 0) {
    options.prior.emplace();
    for (S& coordinate : *options.prior) coordinate = bytes.number(S(0.01));
  }
  std::array<uwbpos::RangeTo<S, D>, kMost> storage;
  std::array<uwbpos::Vec<S, D>, kMost> anchors;
  std::size_t count = 0;
  while (count < kMost && !bytes.empty()) {
    auto& range = storage[count];
    for (S& coordinate : range.anchor) coordinate = bytes.number(S(0.01));
    range.range = bytes.number(S(0.01));
    range.sigma = (flags & 4) != 0 ? bytes.number(S(0.001)) : S(0.1);
    anchors[count] = range.anchor;
    ++count;
  }
  const std::span ranges{storage.data(), count};

  const auto fix = uwbpos::locate(ranges, options);
  check<S, D>(fix, count);
  check<S, D>(uwbpos::toa_linear(ranges), count);
  check<S, D>(uwbpos::toa_chan(ranges), count);
  check<S, D>(uwbpos::toa_least_squares(ranges, {.initial = options.prior}), count);
  if (const auto mirror = uwbpos::toa_closed_form(ranges)) {
    for (const S coordinate : mirror->first) require(std::isfinite(coordinate), "first image");
    for (const S coordinate : mirror->second) require(std::isfinite(coordinate), "second image");
  }

  const uwbpos::Vec<S, D> position = fix ? fix->position : options.side;
  if (const auto bound = uwbpos::cramer_rao_bound(ranges, position)) {
    check_covariance<S, D>(*bound);
  }
  if (const auto dop = uwbpos::range_dop(std::span{anchors.data(), count}, position)) {
    require(std::isfinite(dop->gdop) && dop->gdop >= 0, "dilution of precision");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes{std::span{data, size}};
  switch (bytes.take<std::uint8_t>() & 3) {
    case 0:
      run<double, 2>(bytes);
      break;
    case 1:
      run<double, 3>(bytes);
      break;
    case 2:
      run<float, 2>(bytes);
      break;
    default:
      run<float, 3>(bytes);
  }
  return 0;
}
