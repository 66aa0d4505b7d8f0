// SPDX-License-Identifier: MIT

/// @file
/// The macros that a sketch has before it includes anything: those of Arduino.h and binary.h as the
/// cores for AVR, SAMD, SAM, mbed, STM32, ESP32 and RP2040 write them, each where it is at its
/// worst (function-like, or a number), pins as board variants name them, `I` of <complex.h>, and
/// single letters, which some vendors' register headers use. No header is included. headers.cmake
/// includes it before each header, and once more after it: whatever has changed meanwhile is then
/// redefined, which is an error.

// Mathematics, as integers would have it.
#define min(a, b) ((a) < (b) ? (a) : (b))
#define max(a, b) ((a) > (b) ? (a) : (b))
#define abs(x) ((x) > 0 ? (x) : -(x))
#define round(x) ((x) >= 0 ? (long)((x) + 0.5) : (long)((x) - 0.5))
#define radians(deg) ((deg) * DEG_TO_RAD)
#define degrees(rad) ((rad) * RAD_TO_DEG)
#define sq(x) ((x) * (x))
#define constrain(amt, low, high) ((amt) < (low) ? (low) : ((amt) > (high) ? (high) : (amt)))
#define isnan(x) ((x) != (x))
#define isinf(x) (!isnan(x) && isnan((x) - (x)))
#define isfinite(x) (!isnan((x) - (x)))
#define signbit(x) ((x) < 0)
#define _min(a, b) min(a, b)
#define _max(a, b) max(a, b)
#define _abs(x) abs(x)
#define _round(x) round(x)
#define PI 3.1415926535897932384626433832795
#define HALF_PI 1.5707963267948966192313216916398
#define TWO_PI 6.283185307179586476925286766559
#define DEG_TO_RAD 0.017453292519943295769236907684886
#define RAD_TO_DEG 57.295779513082320876798154814105
#define EULER 2.718281828459045235360287471352

// Bits, bytes, flash and interrupts.
#define bit(b) (1UL << (b))
#define bitRead(value, bit) (((value) >> (bit)) & 0x01)
#define bitSet(value, bit) ((value) |= (1UL << (bit)))
#define bitClear(value, bit) ((value) &= ~(1UL << (bit)))
#define bitToggle(value, bit) ((value) ^= (1UL << (bit)))
#define bitWrite(value, bit, on) ((on) ? bitSet(value, bit) : bitClear(value, bit))
#define lowByte(w) ((unsigned char)((w) & 0xff))
#define highByte(w) ((unsigned char)((w) >> 8))
#define word(...) makeWord(__VA_ARGS__)
#define _BV(b) (1UL << (b))
#define _NOP() ((void)0)
#define PSTR(s) (s)
#define F(string_literal) (PSTR(string_literal))
#define PROGMEM
#define interrupts() ((void)0)
#define noInterrupts() ((void)0)
#define cli() ((void)0)
#define sei() ((void)0)
#define clockCyclesPerMicrosecond() 16
#define HIGH 0x1
#define LOW 0x0
#define INPUT 0x0
#define OUTPUT 0x1
#define INPUT_PULLUP 0x2
#define LSBFIRST 0
#define MSBFIRST 1
#define CHANGE 1
#define FALLING 2
#define RISING 3
#define DEFAULT 1
#define EXTERNAL 0
#define INTERNAL 3
#define SERIAL 0x0
#define DISPLAY 0x1
#define F_CPU 16000000L

// binary.h, and the pins of board variants.
#define B0 0
#define B00 0
#define B1 1
#define B01 1
#define B10 2
#define B11 3
#define B2 (2u)
#define B3 (3u)
#define B11111111 255
#define A0 (14u)
#define A1 (15u)
#define A2 (16u)
#define A3 (17u)
#define A10 (24u)
#define A11 (25u)
#define A20 (34u)
#define A21 (35u)
#define A22 (36u)
#define C0 (40u)
#define C1 (41u)
#define C2 (42u)
#define C3 (43u)
#define C4 (44u)
#define C5 (45u)
#define C6 (46u)
#define C7 (47u)
#define C8 (48u)
#define C9 (49u)
#define C10 (50u)
#define C11 (51u)
#define D0 (0u)
#define D1 (1u)
#define D2 (2u)
#define D3 (3u)
#define D13 (13u)
#define E0 (60u)
#define E1 (61u)
#define F2 (62u)
#define R0 (63u)
#define R1 (64u)
#define R2 (65u)
#define R3 (66u)
#define S1 (67u)
#define S2 (68u)
#define T0 (4u)
#define T1 (5u)
#define T2 (6u)
#define T3 (7u)
#define X4 (8u)
#define LED_BUILTIN (13u)
#define SDA (20u)
#define SCL (21u)
#define SS (10u)
#define MOSI (11u)
#define MISO (12u)
#define SCK (13u)

// Zephyr's and ESP-IDF's utilities.
#define MIN(a, b) ((a) < (b) ? (a) : (b))
#define MAX(a, b) ((a) > (b) ? (a) : (b))
#define CLAMP(x, low, high) MIN(MAX(x, low), high)
#define BIT(n) (1UL << (n))
#define ARRAY_SIZE(a) (sizeof(a) / sizeof((a)[0]))
#define KB(x) ((x) << 10)

// Single letters.
#define A 0xA
#define B 0xB
#define C 0xC
#define D 0xD
#define E 0xE
#define G 71
#define H 72
#define I _Complex_I
#define J 74
#define K 75
#define L 76
#define M 77
#define N 78
#define O 79
#define P 80
#define Q 81
#define R 82
#define S 83
#define T 84
#define U 85
#define V 86
#define W 87
#define X 88
#define Y 89
#define Z 90
