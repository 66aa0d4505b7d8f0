// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// One tag's fixes from several subnets as one fix in the map, and borders that are crossed without
/// a jump.
///
/// The error of `map_T_subnet` moves all fixes of a subnet together: it is no noise to average, and
/// two subnets that hear one tag measure the difference of theirs. `fuse_fixes` weighs by all
/// covariances (frames/joint_fix.hpp); `fuse_and_learn` also keeps what the overlap tells of the
/// transforms. So when the tag leaves the old subnet, the new one has been brought to where the old
/// one was. What stays is the error that both have in common, and every fix's covariance holds it.

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <type_traits>

#include "uwbpos/frames/sightings.hpp"

namespace uwbpos {

/// A tag in the map.
template <class S, int D>
struct MapFix {
  /// In the map; covariance with the transforms' errors, χ² and degrees of freedom those of the
  /// fixes used and of their agreement.
  Fix<S, D> fix;
  S disagreement;                    ///< χ² of all fixes given against each other
  int disagreement_dof;              ///< D · (heard − 1), what it should be near
  int heard;                         ///< fixes given
  int fused;                         ///< fixes used; if fewer, the others contradicted them
  std::array<bool, kMaxHeard> used;  ///< which ones, in the order given
  std::uint32_t leading;             ///< id of the subnet with the best fix among those used
};

/// How fixes of several subnets become one.
template <class S>
struct FuseOptions {
  /// Fixes that disagree by more than what lies this many deviations out (4: one in 30,000) are
  /// not fused.
  S gate = S(4);
  /// Of two that contradict, this subnet's is kept unless its variance exceeds `preference` times
  /// the other's: give `leading` of the tag's last fix, so that it does not jump to and fro.
  std::optional<std::uint32_t> preferred = std::nullopt;
  S preference = S(4);  ///< at least 1
  /// For how many successive fixes an error persists (obstacles, multipath): transforms learn as
  /// if from that many fewer fixes. At least 1.
  S correlated_fixes = S(10);
};

/// `fuse_fixes` of checked fixes.
template <class S, int D, int Capacity>
[[nodiscard]] Result<MapFix<S, D>> fuse_heard(const Subnets<S, D, Capacity>& subnets,
                                              std::span<const SubnetFix<S, D>> fixes,
                                              const Heard<S, D>& heard,
                                              const FuseOptions<S>& options) {
  std::array<S, kMaxHeard> variance{};
  for (int i = 0; i < heard.size; ++i) {
    const Result<JointFix<S, D>> alone = joint_fix_of(subnets, heard, 1U << i);
    if (!alone) return std::unexpected(alone.error());
    variance[static_cast<std::size_t>(i)] = alone->covariance.trace();
  }
  unsigned chosen = (1U << heard.size) - 1U;
  Result<JointFix<S, D>> joint = joint_fix_of(subnets, heard, chosen);
  if (!joint) return std::unexpected(joint.error());
  const S disagreement = joint->chi_squared;
  if (std::isnan(disagreement)) return std::unexpected(Error::NumericOverflow);
  int fused = heard.size;
  while (fused > 1 &&
         !(joint->chi_squared <= chi_squared_gate(joint->degrees_of_freedom, options.gate))) {
    // The one whose absence leaves the least: χ² of the others, and of two fixes, which alone have
    // none, the variance of the one that stays.
    int odd = -1;
    S least = S(0);
    for (int i = 0; i < heard.size; ++i) {
      const unsigned others = chosen & ~(1U << i);
      if (others == chosen) continue;
      const Result<JointFix<S, D>> without = joint_fix_of(subnets, heard, others);
      if (!without) return std::unexpected(without.error());
      S left = without->chi_squared;
      if (fused == 2) {
        left = without->covariance.trace();
        const auto stays = static_cast<std::size_t>(std::countr_zero(others));
        if (fixes[stays].subnet == options.preferred) left /= options.preference;
      }
      if (odd < 0 || left < least) {
        odd = i;
        least = left;
      }
    }
    chosen &= ~(1U << odd);
    --fused;
    joint = joint_fix_of(subnets, heard, chosen);
    if (!joint) return std::unexpected(joint.error());
  }

  MapFix<S, D> result{
      .fix = {joint->position, joint->covariance, joint->chi_squared, joint->degrees_of_freedom},
      .disagreement = disagreement,
      .disagreement_dof = D * (heard.size - 1),
      .heard = heard.size,
      .fused = fused,
      .used = {},
      .leading = 0};
  std::size_t best = fixes.size();
  for (std::size_t i = 0; i < fixes.size(); ++i) {
    if ((chosen >> i & 1U) == 0) continue;
    result.used[i] = true;
    result.fix.chi_squared += fixes[i].fix.chi_squared;
    result.fix.degrees_of_freedom += fixes[i].fix.degrees_of_freedom;
    if (best == fixes.size() || variance[i] < variance[best]) best = i;
  }
  result.leading = fixes[best].subnet;
  if (!all_finite(result.fix.position) || !all_finite(result.fix.covariance) ||
      !std::isfinite(result.fix.chi_squared)) {
    return std::unexpected(Error::NumericOverflow);
  }
  // Of variances too far apart for the scalar, turned into the map, none may be left.
  if (!Ldlt<S, D>{result.fix.covariance}.positive_definite()) {
    return std::unexpected(Error::InvalidCovariance);
  }
  return result;
}

/// Whether every option lies in its domain.
template <class S>
[[nodiscard]] bool valid(const FuseOptions<S>& options) {
  return options.gate > S(0) && options.preference >= S(1) && options.correlated_fixes >= S(1) &&
         std::isfinite(options.correlated_fixes);
}

/// One tag's fixes of one moment, one from each subnet that heard it, as one in the map: any
/// contiguous range of `SubnetFix<S, D>`. Fixes that contradict each other are not fused: of three
/// or four the odd one is left out, of two the one with the larger covariance; `MapFix` says so.
/// O(n³·D³) for n fixes, no allocation.
/// Errors: TooFewMeasurements, none; TooManyMeasurements, more than `kMaxHeard`; UnknownSubnet;
/// DuplicateSubnet; NotFinite; InvalidCovariance, one that is none, or whose variances are too far
/// apart to be turned into the map; InvalidOption; NumericOverflow, numbers beyond the scalar.
template <class S, int D, int Capacity>
[[nodiscard]] Result<MapFix<S, D>> fuse_fixes(
    const Subnets<S, D, Capacity>& subnets,
    std::type_identity_t<std::span<const SubnetFix<S, D>>> fixes,
    const std::type_identity_t<FuseOptions<S>>& options = {}) {
  if (!valid(options)) return std::unexpected(Error::InvalidOption);
  const Result<Heard<S, D>> heard = sightings_of<S, D>(subnets, fixes);
  if (!heard) return std::unexpected(heard.error());
  return fuse_heard<S, D>(subnets, fixes, *heard, options);
}

/// `fuse_fixes`, after which the transforms learn from the fixes that agree, if there are two or
/// more; what was returned is from before. Call it for every tag and moment, and a border gets
/// smoother with every crossing. O((Capacity·D)³) more, and twice as much stack as `Subnets` takes.
/// No allocation. What cannot be learned for lack of digits is left; errors are those of
/// `fuse_fixes`.
template <class S, int D, int Capacity>
[[nodiscard]] Result<MapFix<S, D>> fuse_and_learn(
    Subnets<S, D, Capacity>& subnets, std::type_identity_t<std::span<const SubnetFix<S, D>>> fixes,
    const std::type_identity_t<FuseOptions<S>>& options = {}) {
  if (!valid(options)) return std::unexpected(Error::InvalidOption);
  const Result<Heard<S, D>> heard = sightings_of<S, D>(subnets, fixes);
  if (!heard) return std::unexpected(heard.error());
  const Result<MapFix<S, D>> result = fuse_heard<S, D>(subnets, fixes, *heard, options);
  if (!result || result->fused < 2) return result;

  std::array<Sighting<S, D>, kMaxHeard> agreeing;
  std::size_t count = 0;
  for (std::size_t i = 0; i < fixes.size(); ++i) {
    if (result->used[i]) agreeing[count++] = heard->sightings[i];
  }
  const std::span<Sighting<S, D>> teachers{agreeing.data(), count};
  bool worth_it = false;
  for (std::size_t i = 0; i < count; ++i) {
    Sighting<S, D>& a = teachers[i];
    const Sighting<S, D>& b = teachers[i > 0 ? 0 : 1];
    // Not once they make up less than a thousandth of the variance of the fixes' differences.
    worth_it = worth_it || systematic_variance(subnets, a, b) > S(1e-3) * a.noise.trace();
    a.noise *= options.correlated_fixes;
    a.noise.diagonal().array() += second_order_variance(subnets, a, b);
  }
  if (!worth_it) return result;
  TransformErrors<S, D, Capacity> errors = subnets.errors();
  if (!joint_fix<S, D, Capacity>(teachers, errors)) return result;
  if (!subnets.absorb(errors)) return result;
  return result;
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
