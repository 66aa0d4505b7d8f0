// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Numbers as text on host and target alike, in integer arithmetic; `Put` takes one character.

#include <cstdint>

namespace tag {

template <class Put>
void write_text(const Put& put, const char* text) {
  for (; *text != '\0'; ++text) put(*text);
}

/// Decimal, at least `width` wide, filled with `fill`.
template <class Put>
void write_number(const Put& put, std::int32_t number, int width = 0, char fill = ' ') {
  char digits[12];
  int count = 0;
  std::uint32_t rest =
      number < 0 ? 0u - static_cast<std::uint32_t>(number) : static_cast<std::uint32_t>(number);
  do {
    digits[count++] = static_cast<char>('0' + rest % 10);
    rest /= 10;
  } while (rest != 0);
  if (number < 0) digits[count++] = '-';
  for (int i = count; i < width; ++i) put(fill);
  while (count > 0) put(digits[--count]);
}

/// A float with `decimals` decimals, rounded half away from zero; below 2³¹ of the last of them.
template <class Put>
void write_fixed(const Put& put, float value, int decimals, int width) {
  float scaled = value;
  std::int32_t unit = 1;
  for (int i = 0; i < decimals; ++i) unit *= 10;
  scaled *= static_cast<float>(unit);
  const auto whole = static_cast<std::int32_t>(scaled < 0 ? scaled - 0.5f : scaled + 0.5f);
  const std::uint32_t size =
      whole < 0 ? 0u - static_cast<std::uint32_t>(whole) : static_cast<std::uint32_t>(whole);
  const auto front = static_cast<std::int32_t>(size / static_cast<std::uint32_t>(unit));
  const auto back = static_cast<std::int32_t>(size % static_cast<std::uint32_t>(unit));
  int taken = decimals + 1;
  std::int32_t bound = 10;
  for (taken += 1; bound <= front; bound *= 10) ++taken;
  taken += whole < 0 ? 1 : 0;
  for (int i = taken; i < width; ++i) put(' ');
  if (whole < 0) put('-');
  write_number(put, front);
  put('.');
  write_number(put, back, decimals, '0');
}

}  // namespace tag
