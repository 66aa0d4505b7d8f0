// SPDX-License-Identifier: MIT
// From reset to main on any Cortex-M: FPU on, .data and .bss, constructors; faults are reported.
#include <cstdint>

#include "bare/board.hpp"

extern "C" {
extern std::uint32_t data_in_rom[], data_begin[], data_end[], bss_begin[], bss_end[], stack_top[];
extern void (*constructors_begin[])();
extern void (*constructors_end[])();
int main();

// newlib's math sets it where -fno-math-errno does not reach.
int* __errno() {
  static int number;
  return &number;
}

[[noreturn]] void fault_handler() {
  bare::write("\nfault\n");
  bare::leave(99);
}

[[noreturn]] void reset_handler() {
#ifdef __ARM_FP
  *reinterpret_cast<volatile std::uint32_t*>(0xE000ED88u) |= 0xFu << 20;  // CPACR
  __asm__ volatile("dsb\n isb" ::: "memory");
#endif
  const std::uint32_t* from = data_in_rom;
  for (std::uint32_t* to = data_begin; to != data_end; ++to) *to = *from++;
  for (std::uint32_t* to = bss_begin; to != bss_end; ++to) *to = 0;
  for (auto constructor = constructors_begin; constructor != constructors_end; ++constructor) {
    (*constructor)();
  }
  bare::start_uart();
  bare::leave(main());
}

// Stack, reset, and faults of every kind; no interrupt is enabled.
__attribute__((section(".vectors"), used)) const void* const vectors[16] = {
    stack_top,
    reinterpret_cast<const void*>(reset_handler),
    reinterpret_cast<const void*>(fault_handler),
    reinterpret_cast<const void*>(fault_handler),
    reinterpret_cast<const void*>(fault_handler),
    reinterpret_cast<const void*>(fault_handler),
    reinterpret_cast<const void*>(fault_handler),
    reinterpret_cast<const void*>(fault_handler),
};
}
