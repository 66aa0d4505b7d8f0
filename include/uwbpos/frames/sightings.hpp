// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// Fixes of several subnets, checked and brought to the map, and the joint fix of any of them.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "uwbpos/core/covariance.hpp"
#include "uwbpos/frames/subnet.hpp"

namespace uwbpos {

/// The most subnets that may hear a tag at once: four meet at a corner.
inline constexpr int kMaxHeard = 4;

/// A fix in a subnet's frame.
template <class S, int D>
struct SubnetFix {
  std::uint32_t subnet;  ///< id of the subnet that solved it
  Fix<S, D> fix;         ///< position and covariance in that subnet's frame
};

/// Fixes brought to the map, the transforms' slots their places among the subnets.
template <class S, int D>
struct Heard {
  std::array<Sighting<S, D>, kMaxHeard> sightings;  ///< the first `size` count
  int size;                                         ///< 1 … kMaxHeard
};

/// Checks fixes and brings them to the map. Errors: those of `fuse_fixes`.
template <class S, int D, int Capacity>
[[nodiscard]] Result<Heard<S, D>> sightings_of(const Subnets<S, D, Capacity>& subnets,
                                               std::span<const SubnetFix<S, D>> fixes) {
  if (fixes.empty()) return std::unexpected(Error::TooFewMeasurements);
  if (fixes.size() > kMaxHeard) return std::unexpected(Error::TooManyMeasurements);
  Heard<S, D> heard{};
  for (const SubnetFix<S, D>& f : fixes) {
    const Result<int> place = subnets.place(f.subnet);
    if (!place) return std::unexpected(place.error());
    for (int i = 0; i < heard.size; ++i) {
      if (heard.sightings[static_cast<std::size_t>(i)].slot == *place) {
        return std::unexpected(Error::DuplicateSubnet);
      }
    }
    if (!all_finite(f.fix.position) || !all_finite(f.fix.covariance) ||
        !std::isfinite(f.fix.chi_squared)) {
      return std::unexpected(Error::NotFinite);
    }
    if (!looks_like_covariance<S, D>(f.fix.covariance) ||
        !Ldlt<S, D>{f.fix.covariance}.positive_definite()) {
      return std::unexpected(Error::InvalidCovariance);
    }
    const Transform<S, D>& map_T_subnet = subnets[*place].map_T_subnet;
    heard.sightings[static_cast<std::size_t>(heard.size++)] = {
        .position = apply(map_T_subnet, f.fix.position),
        .noise = congruence(map_T_subnet.rotation, f.fix.covariance),
        .jacobian = point_jacobian(map_T_subnet, f.fix.position),
        .slot = *place};
  }
  return heard;
}

/// How two sightings may lie to each other for what their transforms are not known, the trace [m²]
/// of cov(J_a ξ_a − J_b ξ_b); zero where that is less than rounding leaves of it.
template <class S, int D, int Capacity>
[[nodiscard]] S systematic_variance(const Subnets<S, D, Capacity>& subnets, const Sighting<S, D>& a,
                                    const Sighting<S, D>& b) {
  const S own = congruence(a.jacobian, subnets.covariance(a.slot, a.slot)).trace() +
                congruence(b.jacobian, subnets.covariance(b.slot, b.slot)).trace();
  const S shared =
      product(product(a.jacobian, subnets.covariance(a.slot, b.slot)), transposed(b.jacobian))
          .trace();
  const S left = own - S(2) * shared;
  return left > S(1000) * std::numeric_limits<S>::epsilon() * own ? left : S(0);
}

/// What the first order leaves out of two sightings' difference [m²]: the square of θ²·r, θ the
/// turn of their subnets against each other and r the longer arm.
template <class S, int D, int Capacity>
[[nodiscard]] S second_order_variance(const Subnets<S, D, Capacity>& subnets,
                                      const Sighting<S, D>& a, const Sighting<S, D>& b) {
  constexpr int K = kTurnDof<D>;
  const Mat<S, kTransformDof<D>> difference =
      subnets.covariance(a.slot, a.slot) + subnets.covariance(b.slot, b.slot) -
      subnets.covariance(a.slot, b.slot) - subnets.covariance(b.slot, a.slot);
  const S turn = difference.template bottomRightCorner<K, K>().trace();
  S arms[2] = {};
  for (int k = D; k < D + K; ++k) {
    arms[0] += squared_norm<S, D>(a.jacobian.col(k));
    arms[1] += squared_norm<S, D>(b.jacobian.col(k));
  }
  return turn * turn * std::max(arms[0], arms[1]);
}

/// The joint fix of those sightings whose bit in `chosen` is set, at least one.
template <class S, int D, int Capacity>
[[nodiscard]] Result<JointFix<S, D>> joint_fix_of(const Subnets<S, D, Capacity>& subnets,
                                                  const Heard<S, D>& heard, unsigned chosen) {
  constexpr int K = kTransformDof<D>;
  std::array<Sighting<S, D>, kMaxHeard> sightings;
  std::array<int, kMaxHeard> places{};
  std::size_t count = 0;
  for (int i = 0; i < heard.size; ++i) {
    if ((chosen >> i & 1U) == 0) continue;
    sightings[count] = heard.sightings[static_cast<std::size_t>(i)];
    places[count] = sightings[count].slot;
    sightings[count].slot = static_cast<int>(count);
    ++count;
  }
  TransformErrors<S, D, kMaxHeard> errors;
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < count; ++j) {
      errors.covariance.template block<K, K>(static_cast<int>(i) * K, static_cast<int>(j) * K) =
          subnets.covariance(places[i], places[j]);
    }
  }
  return joint_fix<S, D, kMaxHeard>(std::span{sightings.data(), count}, errors);
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
