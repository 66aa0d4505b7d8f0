// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// The singular value decomposition of Eigen, apart from core/eigen.hpp because it costs as much
/// to compile as all the rest. Of fixed size it does not allocate.

#include <Eigen/SVD>

#include "uwbpos/core/eigen.hpp"

// End of what Eigen may see.
#include "uwbpos/core/macros_back.hpp"
