// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What the compiler must be, said in one line before it says it in hundreds.

#if !defined(__cplusplus) || __cplusplus <= 202002L
#error "uwbpos needs C++23: add -std=c++23 (or gnu++23, gnu++2b) and leave out other -std options"
#elif !__has_include(<expected>)
#error "uwbpos needs <expected>: g++ or arm-none-eabi-g++ 12, clang 16 with libc++, or newer"
#endif
