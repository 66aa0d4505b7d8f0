// SPDX-License-Identifier: MIT

/// @file
/// Any differences and pseudoranges at all into every solver of them. An answer is finite, with a
/// symmetric covariance that no direction makes negative; everything else is a named error.

#include <array>
#include <cmath>
#include <span>

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/accuracy/dop.hpp"
#include "uwbpos/solve/bancroft.hpp"
#include "uwbpos/solve/exclude_outliers.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/tdoa_chan.hpp"
#include "uwbpos/solve/tdoa_fang.hpp"

#include "bytes.hpp"
#include "checks.hpp"

namespace {

using namespace uwbpos::fuzz;
using uwbpos::Vec;

// More than any solver takes, so that the limit is met too.
constexpr std::size_t kMost = uwbpos::kMaxMeasurements + 2;

template <class S, int D>
void require_finite(const Vec<S, D>& position) {
  for (const S coordinate : position) require(std::isfinite(coordinate), "finite position");
}

template <class S, int D>
void run(Bytes bytes) {
  const auto flags = bytes.take<std::uint8_t>();
  const auto options = take_options<S, D>(bytes, flags);
  const S sigma = (flags & 4) != 0 ? bytes.number(S(0.001)) : S(0.1);
  Vec<S, D> reference;
  for (S& coordinate : reference) coordinate = bytes.number(S(0.01));
  std::array<uwbpos::DifferenceTo<S, D>, kMost> differences;
  std::array<uwbpos::PairDifference<S, D>, kMost> pairs;
  std::array<uwbpos::RangeTo<S, D>, kMost> ranges;
  std::array<Vec<S, D>, kMost> anchors;
  std::size_t count = 0;
  while (count < kMost && !bytes.empty()) {
    auto& anchor = anchors[count];
    for (S& coordinate : anchor) coordinate = bytes.number(S(0.01));
    const S measured = bytes.number(S(0.01));
    differences[count] = {anchor, measured};
    ranges[count] = {anchor, measured, sigma};
    const std::size_t other = bytes.take<std::uint8_t>() % (count + 1);
    pairs[count] = {other == count ? reference : anchors[other], anchor, measured, sigma};
    ++count;
  }
  const std::span shared{differences.data(), count};
  const std::span paired{pairs.data(), count};
  const std::span biased{ranges.data(), count};

  const auto fix = uwbpos::locate(reference, shared, sigma, options);
  check<S, D>(fix, count);
  check<S, D>(uwbpos::tdoa_chan(reference, shared, sigma), count);
  check<S, D>(uwbpos::locate(paired, options), count);
  if (const auto both = uwbpos::tdoa_fang(reference, shared)) {
    require_finite<S, D>(both->first);
    require_finite<S, D>(both->second);
  }
  if (const auto both = uwbpos::bancroft(biased)) {
    require_finite<S, D>(both->first.position);
    require_finite<S, D>(both->second.position);
  }
  if (const auto with_bias = uwbpos::locate_with_bias(biased, options)) {
    require_finite<S, D>(with_bias->position);
    require(std::isfinite(with_bias->bias), "finite bias");
    check_covariance<S, D + 1>(with_bias->covariance);
  }
  if (count < 12) {
    if (const auto kept = uwbpos::locate_excluding(paired, options)) {
      check_kept<S, D>(*kept, count);
    }
  }
  const Vec<S, D> position = fix ? fix->position : options.side;
  if (const auto bound = uwbpos::cramer_rao_bound(reference, shared, sigma, position)) {
    check_covariance<S, D>(*bound);
  }
  if (const auto bound = uwbpos::cramer_rao_bound(paired, position)) {
    check_covariance<S, D>(*bound);
  }
  if (const auto dop = uwbpos::pseudorange_dop(std::span{anchors.data(), count}, position)) {
    require(std::isfinite(dop->gdop) && dop->gdop >= 0, "dilution of precision");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  with_scalar_and_dimension(Bytes{std::span{data, size}},
                            []<class S, int D>(Bytes bytes) { run<S, D>(bytes); });
  return 0;
}
