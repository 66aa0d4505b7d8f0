// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The one place that includes Eigen, so that it can be guarded in one place.

#include <Eigen/Core>
