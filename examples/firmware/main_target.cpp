// SPDX-License-Identifier: MIT
// On the microcontroller: the recorded exchanges from flash, the track to the UART.
#include "bare/board.hpp"
#include "exchanges.hpp"
#include "recorded_radio.hpp"

int main() {
  tag::RecordedRadio radio{kExchanges};
  return tag::run(radio, tag::settings(), [](char c) { bare::write(c); }) > 0 ? 0 : 1;
}
