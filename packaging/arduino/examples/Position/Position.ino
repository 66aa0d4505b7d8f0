// SPDX-License-Identifier: MIT
// The position of a tag from its ranges to four anchors in the corners of a hall, once a second.
// Put your radio's ranges where `ranges` is filled; everything else stays.

#include <uwbpos.h>

using Range = uwbpos::RangeTo<float, 2>;  // anchor [m], range [m], sigma [m]

static Range ranges[] = {
    {{0, 0}, 5.03f, 0.05f}, {{10, 0}, 8.02f, 0.05f}, {{10, 8}, 8.09f, 0.05f}, {{0, 8}, 4.97f, 0.05f}};

void setup() {
  Serial.begin(115200);
  pinMode(LED_BUILTIN, OUTPUT);
}

void loop() {
  const auto fix = uwbpos::locate(ranges);
  digitalWrite(LED_BUILTIN, fix ? HIGH : LOW);
  if (fix) {
    Serial.print(F("x = "));
    Serial.print(fix->position.x(), 2);
    Serial.print(F(" m, y = "));
    Serial.print(fix->position.y(), 2);
    Serial.println(F(" m"));
  } else {
    Serial.println(uwbpos::describe(fix.error()).data());
  }
  delay(1000);
}
