// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A case is a type with
///   `Input`, `Output`, `static Output run(const Input&)`, `kRounds`, how many inputs are recorded,
///   `kStateful` where a call changes what the next one does, and, on the host, `make`, which fills
///   an input, unless inputs.hpp has one for the type.
/// The host makes the inputs and records inputs and outputs; the target reads them, calls, compares
/// every word, and counts instructions and stack.

#include <new>

#ifndef FIRMWARE_TARGET
#include "inputs.hpp"
#endif

#include "entry.hpp"
#include "words.hpp"

namespace firmware {

/// True where calling twice is not the same as calling once.
template <class C>
inline constexpr bool kIsStateful = requires { C::kStateful; };

#ifdef FIRMWARE_TARGET

class Checker {
 public:
  explicit Checker(const Word* expected) : at_{expected} {}
  void word(Word& w) {
    ++words_;
    if (w != *at_++) ++different_;
  }
  [[nodiscard]] int words() const { return words_; }
  [[nodiscard]] int different() const { return different_; }

 private:
  const Word* at_;
  int words_ = 0;
  int different_ = 0;
};

template <class C, Function function>
Outcome check(const Recording& recorded) {
  Reader reader{recorded.inputs};
  Checker checker{recorded.outputs};
  Outcome outcome;
  std::uint64_t total = 0;
  for (int i = 0; i < recorded.rounds; ++i) {
    typename C::Input input{};
    typename C::Output output;
    transfer(reader, input);
    const Cost cost = measure(function, &input, &output, kIsStateful<C>);
    transfer(checker, output);
    total += cost.instructions;
    if (cost.instructions > outcome.most_instructions)
      outcome.most_instructions = cost.instructions;
    if (cost.stack > outcome.stack) outcome.stack = cost.stack;
  }
  outcome.words = checker.words();
  outcome.different = checker.different();
  outcome.mean_instructions =
      static_cast<std::uint32_t>(total / static_cast<std::uint32_t>(recorded.rounds));
  return outcome;
}

#else

/// Appends words to a table.
class Writer {
 public:
  explicit Writer(std::vector<Word>& to) : to_{to} {}
  void word(Word& w) { to_.push_back(w); }

 private:
  std::vector<Word>& to_;
};

template <class C, Function function>
void record(const char* symbol, std::vector<Word>& inputs, std::vector<Word>& outputs) {
  uwbpos::sim::Random random{symbol};
  Writer to_inputs{inputs};
  Writer to_outputs{outputs};
  for (int i = 0; i < C::kRounds; ++i) {
    auto input = typename C::Input{};
    if constexpr (requires { C::make(input, random, i); }) {
      C::make(input, random, i);
    } else {
      make(input, random);
    }
    transfer(to_inputs, input);
    typename C::Output output;
    function(&input, &output);
    transfer(to_outputs, output);
  }
}

#endif

}  // namespace firmware

/// The function to call, with a name that a linker knows.
#define FIRMWARE_FUNCTION(symbol, type)                                      \
  extern "C" [[gnu::noinline]] void symbol(const void* in, void* out) {      \
    new (out) type::Output(type::run(*static_cast<const type::Input*>(in))); \
  }
#ifdef FIRMWARE_TARGET
#define FIRMWARE_ENTRY(symbol, type) \
  firmware::Entry{#symbol, type::kRounds, firmware::check<type, symbol>},
#else
#define FIRMWARE_ENTRY(symbol, type) \
  firmware::Entry{#symbol, type::kRounds, firmware::record<type, symbol>},
#endif
/// All functions of a file of cases; `cases(X)` is X(symbol, type) for each, a line each.
#define FIRMWARE_UNIT(cases)                                               \
  cases(FIRMWARE_FUNCTION) std::span<const firmware::Entry> entries();     \
  std::span<const firmware::Entry> entries() {                             \
    static constexpr firmware::Entry kEntries[] = {cases(FIRMWARE_ENTRY)}; \
    return kEntries;                                                       \
  }
