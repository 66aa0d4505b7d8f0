// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The whole library but for the simulator (sim/).

#include "uwbpos/accuracy/cramer_rao.hpp"
#include "uwbpos/accuracy/dop.hpp"
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
#include "uwbpos/model/range_set.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/mirror_choice.hpp"
#include "uwbpos/solve/squared_ranges.hpp"
#include "uwbpos/solve/toa_chan.hpp"
#include "uwbpos/solve/toa_closed_form.hpp"
#include "uwbpos/solve/toa_least_squares.hpp"
#include "uwbpos/solve/toa_linear.hpp"
#include "uwbpos/solve/toa_roots.hpp"
#include "uwbpos/time/device_time.hpp"
