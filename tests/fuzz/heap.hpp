// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A guard against the heap: AddressSanitizer, which fuzzers come with, tells of every call of its
/// allocator.

#include <cstddef>

#include <sanitizer/allocator_interface.h>

#include "uwbpos/core/eigen.hpp"

#include "bytes.hpp"

namespace uwbpos::fuzz {

/// Memory asked for while one of these lives ends the program when it dies: within the allocator
/// the fuzzer could not keep its input.
class NoHeap {
 public:
  NoHeap() {
    ++depth_;
    Eigen::internal::set_is_malloc_allowed(false);
  }
  ~NoHeap() {
    if (--depth_ == 0) Eigen::internal::set_is_malloc_allowed(true);
    require(!asked_, "no heap");
  }
  NoHeap(const NoHeap&) = delete;
  NoHeap& operator=(const NoHeap&) = delete;

  /// What the allocator calls.
  static void asked() { asked_ = asked_ || depth_ > 0; }

 private:
  static inline int depth_ = 0;
  static inline bool asked_ = false;
};

inline const int kHooks = __sanitizer_install_malloc_and_free_hooks(
    [](const volatile void*, std::size_t) { NoHeap::asked(); }, [](const volatile void*) {});

}  // namespace uwbpos::fuzz
