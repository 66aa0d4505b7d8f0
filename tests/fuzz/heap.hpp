// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A guard against the heap, for the one file that a fuzzer is. With AddressSanitizer its allocator
/// tells of every call; without, operator new is replaced.

#include <cstddef>
#include <cstdlib>
#include <new>

#include "uwbpos/core/eigen.hpp"

#include "bytes.hpp"

#if defined(__SANITIZE_ADDRESS__)
#define UWBPOS_FUZZ_HOOKS
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define UWBPOS_FUZZ_HOOKS
#endif
#endif
#ifdef UWBPOS_FUZZ_HOOKS
#include <sanitizer/allocator_interface.h>
#endif

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

#ifdef UWBPOS_FUZZ_HOOKS
inline const int kHooks = __sanitizer_install_malloc_and_free_hooks(
    [](const volatile void*, std::size_t) { NoHeap::asked(); }, [](const volatile void*) {});
#else
inline void* memory_of(std::size_t size) {
  NoHeap::asked();
  if (void* memory = std::malloc(size > 0 ? size : 1)) return memory;
  std::abort();
}
#endif

}  // namespace uwbpos::fuzz

#ifndef UWBPOS_FUZZ_HOOKS
void* operator new(std::size_t size) { return uwbpos::fuzz::memory_of(size); }
void* operator new[](std::size_t size) { return uwbpos::fuzz::memory_of(size); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
#endif
