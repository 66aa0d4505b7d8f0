// SPDX-License-Identifier: MIT
// Runs every case on the target and compares each word with the host's. One line a case:
// name, words, words that differ, instructions per call (most, mean), bytes of stack.
#include "bare/board.hpp"
#include "entry.hpp"
#include "recordings.hpp"
#include "text.hpp"
#include "units.hpp"

extern "C" std::uint32_t bss_end[];

namespace {

void put(char c) { bare::write(c); }

// Runs the same on every board: what a tick is in instructions.
std::uint32_t time_loop(std::uint32_t rounds) {
  const std::uint32_t begin = bare::ticks();
  __asm__ volatile(".syntax unified\n1: subs %0, %0, #1\n bne 1b" : "+l"(rounds) : : "cc");
  return bare::ticks() - begin;
}

// 256ths of an instruction.
std::uint32_t instructions_per_tick() {
  static std::uint32_t scale = 0;
  if (scale == 0) {
    bare::start_ticks();
    scale = 2u * 200'000u * 256u / time_loop(200'000);
  }
  return scale;
}

void do_nothing(const void*, void*) { __asm__ volatile(""); }

std::uint32_t call_times(firmware::Function function, const void* input, void* output,
                         std::uint32_t times) {
  bare::start_ticks();
  const std::uint32_t begin = bare::ticks();
  for (std::uint32_t i = 0; i < times; ++i) function(input, output);
  return bare::ticks() - begin;
}

constexpr std::uint32_t kPaint = 0xC0FFEE5Au;

[[gnu::noinline]] std::uint32_t* stack_floor() {
  std::uint32_t here;
  const auto at = reinterpret_cast<std::uintptr_t>(&here) & ~std::uintptr_t{3};
  const auto lowest = reinterpret_cast<std::uintptr_t>(bss_end);
  return reinterpret_cast<std::uint32_t*>(at - lowest > 24'000 ? at - 24'000 : lowest);
}

}  // namespace

namespace firmware {

[[gnu::noinline]] Cost measure(Function function, const void* input, void* output, bool once) {
  Cost cost;
  volatile std::uint32_t* const floor = stack_floor();
  std::uint32_t* top;
  __asm__ volatile("mov %0, sp" : "=r"(top));
  for (volatile std::uint32_t* p = floor; p < top; ++p) *p = kPaint;
  bare::start_ticks();
  const std::uint32_t begin = bare::ticks();
  function(input, output);
  const std::uint32_t first = bare::ticks() - begin;
  volatile std::uint32_t* p = floor;
  while (p < top && *p == kPaint) ++p;
  cost.stack = static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(top) -
                                          reinterpret_cast<std::uintptr_t>(p));
  const std::uint32_t scale = instructions_per_tick();
  if (once || first > 10'000) {
    cost.instructions = static_cast<std::uint32_t>(std::uint64_t{first} * scale / 256);
  } else {
    constexpr std::uint32_t kTimes = 64;
    const std::uint32_t all = call_times(function, input, output, kTimes);
    const std::uint32_t none = call_times(do_nothing, input, output, kTimes);
    cost.instructions =
        static_cast<std::uint32_t>(std::uint64_t{all - none} * scale / (256 * kTimes));
  }
  return cost;
}

}  // namespace firmware

namespace {

// Returns how many words differ.
int check(std::span<const firmware::Entry> entries,
          std::span<const firmware::Recording> recordings) {
  int wrong = 0;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const firmware::Outcome outcome = entries[i].check(recordings[i]);
    tag::write_text(put, "case ");
    tag::write_text(put, entries[i].symbol);
    for (const auto number :
         {static_cast<std::uint32_t>(outcome.words), static_cast<std::uint32_t>(outcome.different),
          outcome.most_instructions, outcome.mean_instructions, outcome.stack}) {
      put(' ');
      tag::write_number(put, static_cast<std::int32_t>(number));
    }
    put('\n');
    wrong += outcome.different;
  }
  return wrong;
}

}  // namespace

int main() {
  int wrong = 0;
#define FIRMWARE_CHECK(unit) wrong += check(firmware::unit::entries(), k_##unit);
  FIRMWARE_UNITS(FIRMWARE_CHECK)
  tag::write_text(put, wrong == 0 ? "all words as on the host\n" : "words differ\n");
  return wrong == 0 ? 0 : 1;
}
