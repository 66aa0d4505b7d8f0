// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The whole library but for the simulator (sim/).

#include "uwbpos/core/angle.hpp"
#include "uwbpos/core/constants.hpp"
#include "uwbpos/core/eigen.hpp"
#include "uwbpos/core/linalg.hpp"
#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"
#include "uwbpos/core/version.hpp"
#include "uwbpos/geometry/anchors.hpp"
#include "uwbpos/geometry/height.hpp"
#include "uwbpos/model/range.hpp"
#include "uwbpos/solve/range_set.hpp"
#include "uwbpos/solve/squared_ranges.hpp"
#include "uwbpos/solve/toa_chan.hpp"
#include "uwbpos/solve/toa_linear.hpp"
#include "uwbpos/time/device_time.hpp"
