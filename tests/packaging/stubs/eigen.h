// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Stands for the header of the same name in the Arduino library "Bolder Flight Systems Eigen".

#include <Eigen/Core>
