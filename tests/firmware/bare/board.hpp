// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What the boards of cmake/cortex-m.cmake have in common as QEMU has them: a UART to print on,
/// semihosting to end with a status, SysTick, which with `-icount` counts instructions, and a stack
/// that can be painted.

#include <cstddef>
#include <cstdint>

namespace bare {

inline volatile std::uint32_t& device_register(std::uint32_t address) {
  return *reinterpret_cast<volatile std::uint32_t*>(address);
}

#if defined(BOARD_m0)
// nRF51: enable, start, transmit.
inline void start_uart() {
  device_register(0x40002500) = 4;
  device_register(0x40002008) = 1;
}
inline void write(char c) {
  device_register(0x4000211C) = 0;
  device_register(0x4000251C) = static_cast<unsigned char>(c);
  while (device_register(0x4000211C) == 0) {
  }
}
#else
#if defined(BOARD_m33)
inline constexpr std::uint32_t kUart = 0x50200000;
#else
inline constexpr std::uint32_t kUart = 0x40004000;
#endif
// CMSDK: baud rate divider, transmitter on.
inline void start_uart() {
  device_register(kUart + 16) = 16;
  device_register(kUart + 8) = 1;
}
inline void write(char c) {
  while ((device_register(kUart + 4) & 1u) != 0) {
  }
  device_register(kUart) = static_cast<unsigned char>(c);
}
#endif

inline void write(const char* text) {
  for (; *text != '\0'; ++text) write(*text);
}

/// Ends the emulation with this status (SYS_EXIT_EXTENDED).
[[noreturn]] inline void leave(int status) {
  const std::uint32_t block[2] = {0x20026u, static_cast<std::uint32_t>(status)};
  register int operation __asm__("r0") = 0x20;
  register const void* argument __asm__("r1") = block;
  __asm__ volatile("bkpt 0xAB" : "+r"(operation) : "r"(argument) : "memory");
  for (;;) {
  }
}

/// SysTick, 24 bits, downwards, at the processor's clock.
inline void start_ticks() {
  device_register(0xE000E014) = 0xFFFFFF;
  device_register(0xE000E018) = 0;
  device_register(0xE000E010) = 5;
  while (device_register(0xE000E018) == 0) {
  }
}
/// Ticks since the start.
inline std::uint32_t ticks() { return 0xFFFFFF - device_register(0xE000E018); }

}  // namespace bare
