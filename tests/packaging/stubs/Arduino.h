// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// As much of an Arduino core as the example needs, on the host: Serial writes to standard output.

#include <cstdio>
#include <cstring>

struct StandardOutput {
  void begin(unsigned long) {}
  void print(const char* text) { std::fputs(text, stdout); }
  void print(double number, int digits) { std::printf("%.*f", digits, number); }
  void println(const char* text) { std::puts(text); }
};
inline StandardOutput Serial;

inline void pinMode(int, int) {}
inline void digitalWrite(int, int) {}
inline void delay(unsigned long) {}

#include "embedded/arduino_macros.hpp"
