// SPDX-License-Identifier: MIT

/// @file
/// Any ranges of any tags into the solver of poses, any fixes into the pose of two tags, and what
/// comes out into twists and targets. An answer is finite, with a heading in (−π, π] and a
/// symmetric covariance that no direction makes negative; everything else is a named error.

#include <array>
#include <cmath>
#include <span>

#include "uwbpos/accuracy/pose_bound.hpp"
#include "uwbpos/pose/target.hpp"
#include "uwbpos/pose/twist.hpp"
#include "uwbpos/pose/two_tag.hpp"
#include "uwbpos/solve/pose_from_ranges.hpp"

#include "bytes.hpp"
#include "checks.hpp"

namespace {

using namespace uwbpos::fuzz;

// More than the solver takes, so that the limit is met too.
constexpr std::size_t kMost = uwbpos::kMaxMeasurements + 2;

template <class S, int D>
void run(Bytes bytes) {
  const auto flags = bytes.take<std::uint8_t>();
  const auto knowledge = take_options<S, D>(bytes, flags);
  uwbpos::PoseOptions<S, D> options{.side = knowledge.side, .prior = knowledge.prior};
  if ((flags & 8) != 0) options.heading = {bytes.number(S(0.001)), bytes.number(S(1e-4))};
  if ((flags & 16) != 0) options.height = {bytes.number(S(0.01)), bytes.number(S(1e-4))};
  if ((flags & 32) != 0) {
    options.robust = {(flags & 64) != 0 ? uwbpos::Loss::Huber : uwbpos::Loss::Cauchy,
                      bytes.number(S(0.001))};
  }
  std::array<uwbpos::Vec<S, D>, 4> arms;
  for (auto& arm : arms) {
    for (S& coordinate : arm) coordinate = bytes.number(S(1e-4));
  }
  std::array<uwbpos::TagRange<S, D>, kMost> storage;
  std::size_t count = 0;
  while (count < kMost && !bytes.empty()) {
    auto& range = storage[count++];
    range.lever_arm = arms[bytes.take<std::uint8_t>() & 3];
    for (S& coordinate : range.anchor) coordinate = bytes.number(S(0.01));
    range.range = bytes.number(S(0.01));
    range.sigma = (flags & 4) != 0 ? bytes.number(S(0.001)) : S(0.1);
  }
  const std::span ranges{storage.data(), count};
  if (const auto pose = uwbpos::pose_from_ranges(ranges, options)) {
    for (const S coordinate : pose->position) require(std::isfinite(coordinate), "position");
    check_heading(pose->heading);
    // A pose that is hardly determined has a matrix whose inverse is off by more than a few
    // roundings.
    check_correlations<S, D + 1>(pose->covariance);
  }
  const auto fix = uwbpos::solve_pose(ranges, options);
  if (!fix) {
    require(!describe(fix.error()).empty(), "every error has a description");
    return;
  }
  for (const S coordinate : fix->pose.position) require(std::isfinite(coordinate), "position");
  check_heading(fix->pose.heading);
  check_correlations<S, D + 1>(fix->pose.covariance);
  require(fix->chi_squared >= 0 && std::isfinite(fix->chi_squared), "chi squared");
  require(fix->degrees_of_freedom >= 0, "degrees of freedom");
  if (const auto bound = uwbpos::pose_bound(ranges, fix->pose.position, fix->pose.heading)) {
    check_correlations<S, D + 1>(*bound);
  }
}

template <class S>
uwbpos::Fix<S, 2> take_fix(Bytes& bytes) {
  uwbpos::Fix<S, 2> fix{};
  for (S& coordinate : fix.position) coordinate = bytes.number(S(0.001));
  fix.covariance(0, 0) = bytes.number(S(1e-5));
  fix.covariance(1, 1) = bytes.number(S(1e-5));
  fix.covariance(0, 1) = fix.covariance(1, 0) = bytes.number(S(1e-6));
  return fix;
}

template <class S>
void run_tags(Bytes bytes) {
  const auto left = take_fix<S>(bytes);
  const auto right = take_fix<S>(bytes);
  const auto pose = uwbpos::two_tag_pose(left, right, bytes.number(S(0.001)));
  if (!pose) return;
  check_heading(pose->heading);
  check_correlations<S, 3>(pose->covariance);
  uwbpos::Pose2<S> second = *pose;
  for (S& coordinate : second.position) coordinate += bytes.number(S(0.001));
  second.heading += bytes.number(S(0.001));
  if (const auto twist = uwbpos::twist_between(*pose, second, bytes.number(S(0.001)))) {
    require(std::isfinite(twist->turn_rate), "turn rate");
    check_correlations<S, 3>(twist->global_covariance);
    check_correlations<S, 3>(twist->body_covariance);  // the other one turned, with its rounding
  }
  if (const auto seen = uwbpos::bearing_to(
          second, uwbpos::Vec<S, 2>{bytes.number(S(0.01)), bytes.number(S(0.01))})) {
    check_heading(seen->bearing);
    require(std::isfinite(seen->distance) && seen->distance > 0, "distance");
    require(seen->distance_variance >= 0 && seen->bearing_variance >= 0, "variances");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes{std::span{data, size}};
  switch (bytes.take<std::uint8_t>() % 6) {
    case 0:
      run<double, 2>(bytes);
      break;
    case 1:
      run<double, 3>(bytes);
      break;
    case 2:
      run<float, 2>(bytes);
      break;
    case 3:
      run<float, 3>(bytes);
      break;
    case 4:
      run_tags<double>(bytes);
      break;
    default:
      run_tags<float>(bytes);
  }
  return 0;
}
