// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A fix with a bias as words.

#include "uwbpos/solve/pseudorange_profile.hpp"

#include "words.hpp"

namespace uwbpos {

template <class Words, int D>
void transfer(Words& words, BiasedFix<float, D>& f) {
  firmware::transfer_all(words, f.position, f.bias, f.covariance, f.chi_squared,
                         f.degrees_of_freedom);
}
}  // namespace uwbpos
