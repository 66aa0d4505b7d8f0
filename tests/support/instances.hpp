// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The functions that many tests call and that take seconds to compile, declared here and compiled
/// once, in units that CMake writes. It also includes this file ahead of every test; none names it.

#include "uwbpos/frames/fit_transform.hpp"
#include "uwbpos/frames/fuse_fixes.hpp"
#include "uwbpos/solve/bancroft.hpp"
#include "uwbpos/solve/exclude_outliers.hpp"
#include "uwbpos/solve/fsri.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/pose_from_ranges.hpp"
#include "uwbpos/solve/tdoa_chan.hpp"
#include "uwbpos/solve/tdoa_fang.hpp"
#include "uwbpos/solve/toa_chan.hpp"
#include "uwbpos/solve/toa_closed_form.hpp"
#include "uwbpos/solve/toa_linear.hpp"

#define UWBPOS_SOLVERS_OF(S, D)                                                                    \
  UWBPOS_INSTANCE Result<ToaRoots<S, D>> toa_roots<S, D>(RangeSpan<S, D>);                         \
  UWBPOS_INSTANCE Result<Fix<S, D>> detail::locate_ranges<S, D>(RangeSpan<S, D>,                   \
                                                                const LocateOptions<S, D>&);       \
  UWBPOS_INSTANCE Result<PoseFix<S, D>> detail::solve_pose<S, D>(TagRangeSpan<S, D>,               \
                                                                 const PoseOptions<S, D>&);        \
  UWBPOS_INSTANCE Result<Fix<S, D>> detail::toa_linear<S, D>(RangeSpan<S, D>);                     \
  UWBPOS_INSTANCE Result<Fix<S, D>> detail::toa_chan<S, D>(RangeSpan<S, D>);                       \
  UWBPOS_INSTANCE Result<Mirror<S, D>> detail::toa_closed_form<S, D>(RangeSpan<S, D>);             \
  UWBPOS_INSTANCE Result<Fix<S, D>> detail::toa_least_squares<S, D>(                               \
      RangeSpan<S, D>, const LeastSquaresOptions<S, D>&);                                          \
  UWBPOS_INSTANCE Result<BancroftSolution<S, D>> detail::bancroft<S, D>(RangeSpan<S, D>);          \
  UWBPOS_INSTANCE Result<BiasedFix<S, D>> solve_pseudoranges<S, D>(const RangeSpan<S, D>&,         \
                                                                   const LocateOptions<S, D>&);    \
  UWBPOS_INSTANCE Result<BiasedFix<S, D>> solve_pseudoranges<S, D>(const DifferenceView<S, D>&,    \
                                                                   const LocateOptions<S, D>&);    \
  UWBPOS_INSTANCE Result<Fix<S, D>> detail::tdoa_chan<S, D>(const Vec<S, D>&,                      \
                                                            DifferenceSpan<S, D>, S);              \
  UWBPOS_INSTANCE Result<Mirror<S, D>> detail::tdoa_fang<S, D>(const Vec<S, D>&,                   \
                                                               DifferenceSpan<S, D>);              \
  UWBPOS_INSTANCE Result<Fix<S, D>> detail::tdoa_least_squares<S, D>(                              \
      const Vec<S, D>&, DifferenceSpan<S, D>, S, const LocateOptions<S, D>&);                      \
  UWBPOS_INSTANCE Result<Fix<S, D>> detail::tdoa_least_squares<S, D>(PairSpan<S, D>,               \
                                                                     const LocateOptions<S, D>&);  \
  UWBPOS_INSTANCE Result<FsriShot<S, kMaxFsriReceivers, D>> detail::solve_shot<S, D>(              \
      std::span<const Vec<S, D>>, std::span<const S>, const FsriOptions<S, D>&);                   \
  UWBPOS_INSTANCE Result<ExclusionFix<S, D>> detail::locate_excluding<RangeTo<S, D>, S, D>(        \
      RangeSpan<S, D>, const LocateOptions<S, D>&, const ExclusionOptions<S>&);                    \
  UWBPOS_INSTANCE Result<ExclusionFix<S, D>> detail::locate_excluding<PairDifference<S, D>, S, D>( \
      PairSpan<S, D>, const LocateOptions<S, D>&, const ExclusionOptions<S>&);

#define UWBPOS_FRAMES_OF(S, D)                                                               \
  UWBPOS_INSTANCE Result<FittedTransform<S, D>> detail::fit_transform<S, D>(                 \
      std::span<const SharedPoint<S, D>>, const FitTransformOptions<S>&);                    \
  UWBPOS_INSTANCE Result<Transform<S, D>> transform_from_rotation<S, D>(                     \
      const Mat<S, D>&, const Vec<S, D>&, const Mat<S, kTransformDof<D>>&);                  \
  UWBPOS_INSTANCE Mat<S, D> orthonormalised<S, D>(Mat<S, D>);                                \
  UWBPOS_INSTANCE Result<JointFix<S, D>> joint_fix<S, D, 4>(std::span<const Sighting<S, D>>, \
                                                            TransformErrors<S, D, 4>&);      \
  UWBPOS_INSTANCE Result<MapFix<S, D>> fuse_heard<S, D, 4>(                                  \
      const Subnets<S, D, 4>&, std::span<const SubnetFix<S, D>>, const Heard<S, D>&,         \
      const FuseOptions<S>&);                                                                \
  UWBPOS_INSTANCE Result<MapFix<S, D>> fuse_and_learn<S, D, 4>(                              \
      Subnets<S, D, 4>&, std::span<const SubnetFix<S, D>>, const FuseOptions<S>&);

#define UWBPOS_INSTANCES(S, D) UWBPOS_SOLVERS_OF(S, D) UWBPOS_FRAMES_OF(S, D)

#ifndef UWBPOS_INSTANCE
#define UWBPOS_INSTANCE extern template
namespace uwbpos {
UWBPOS_INSTANCES(float, 2)
UWBPOS_INSTANCES(float, 3)
UWBPOS_INSTANCES(double, 2)
UWBPOS_INSTANCES(double, 3)
}  // namespace uwbpos
#endif
