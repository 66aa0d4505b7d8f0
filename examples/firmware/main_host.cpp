// SPDX-License-Identifier: MIT
// The same on the host: the recorded exchanges, the track to standard output.
#include <cstdio>

#include "exchanges.hpp"
#include "recorded_radio.hpp"

int main() {
  tag::RecordedRadio radio{kExchanges};
  return tag::run(radio, tag::settings(), [](char c) { std::putchar(c); }) > 0 ? 0 : 1;
}
