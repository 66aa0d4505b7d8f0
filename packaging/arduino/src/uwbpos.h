// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What a sketch includes. The IDE finds the library with Eigen by its header eigen.h, not by
/// Eigen/Core; it is included here, where the sketch's macros cannot reach it.

#include <Arduino.h>
// Arduino.h comes first, so that its macros are there to be set aside.
#include "uwbpos/core/macros_off.hpp"
// Nothing of the sketch in here.
#include <eigen.h>
// Back to the sketch.
#include "uwbpos/core/macros_back.hpp"
// Every header of the library does the same for itself.
#include "uwbpos/uwbpos.hpp"
