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
#include "uwbpos/solve/exclude_outliers.hpp"
#include "uwbpos/solve/toa_chan.hpp"
#include "uwbpos/solve/toa_closed_form.hpp"
#include "uwbpos/solve/toa_least_squares.hpp"
#include "uwbpos/solve/toa_linear.hpp"
#include "uwbpos/solve/toa_refine.hpp"
#include "uwbpos/solve/toa_three_anchors.hpp"

#include "bytes.hpp"
#include "checks.hpp"

namespace {

using namespace uwbpos::fuzz;

// More than any solver takes, so that the limit is met too.
constexpr std::size_t kMost = uwbpos::kMaxMeasurements + 2;

template <class S, int D>
void run(Bytes bytes) {
  const auto flags = bytes.take<std::uint8_t>();
  const auto options = take_options<S, D>(bytes, flags);
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
  check<S, D>(uwbpos::toa_refine(ranges, options.prior ? *options.prior : options.side), count);
  if (const auto mirror = uwbpos::toa_closed_form(ranges)) {
    for (const S coordinate : mirror->first) require(std::isfinite(coordinate), "first image");
    for (const S coordinate : mirror->second) require(std::isfinite(coordinate), "second image");
  }

  if constexpr (D == 2) {
    if (count >= 3) {
      if (const auto bare = uwbpos::toa_three_anchors<S>({ranges[0], ranges[1], ranges[2]})) {
        for (const S coordinate : *bare) require(std::isfinite(coordinate), "three anchors");
      }
    }
  }

  if (count < 12) {
    if (const auto kept = uwbpos::locate_excluding(ranges, options)) {
      check_kept<S, D>(*kept, count);
    }
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
  with_scalar_and_dimension(Bytes{std::span{data, size}},
                            []<class S, int D>(Bytes bytes) { run<S, D>(bytes); });
  return 0;
}
