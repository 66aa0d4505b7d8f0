// SPDX-License-Identifier: MIT
// Programs that firmware must not be, each linked to be refused: GUARD_heap, GUARD_exceptions,
// GUARD_streams.
#include <cstdio>

extern "C" int volatile some_number;
int volatile some_number = 3;

int main() {
  const int number = some_number;
#if defined(GUARD_heap)
  int* volatile kept = new int{number};
  return *kept;
#elif defined(GUARD_exceptions)
  if (number == 3) throw number;
#elif defined(GUARD_streams)
  std::printf("%d", number);
#endif
  return number;
}
