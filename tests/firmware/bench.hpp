// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// A case is a type with
///   `Input`, `Output`, `static Output run(const Input&)`, `kRounds`, how many inputs are recorded,
///   and `kStateful` where a call changes what the next one does.
/// The host makes the inputs and records inputs and outputs; the target reads them, calls, compares
/// every word, and counts instructions and stack.

#include <cstddef>
#include <cstdint>
#include <new>

#include "words.hpp"

namespace firmware {

/// What the host has recorded of a case.
struct Recording {
  const char* symbol;
  int rounds;
  const Word* inputs;
  const Word* outputs;
};

/// What a case did. `different`: words that are not as recorded.
struct Outcome {
  int words = 0;
  int different = 0;
  std::uint32_t most_instructions = 0;
  std::uint32_t mean_instructions = 0;
  std::uint32_t stack = 0;
};

/// A case as the programs know it.
struct Entry {
  const char* symbol;  ///< of the function to call
  int rounds;
#ifdef FIRMWARE_TARGET
  Outcome (*check)(const Recording&);
#else
  void (*record)(const char* symbol, std::vector<Word>& inputs, std::vector<Word>& outputs);
#endif
};

template <class C>
using Function = void (*)(const typename C::Input&, typename C::Output&);

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

/// What a call took.
struct Cost {
  std::uint32_t instructions;
  std::uint32_t stack;
};

/// Calls `function(input, output)`, once or, to count finer than a tick, many times.
Cost measure(void (*function)(const void*, void*), const void* input, void* output, bool once);

template <class C, Function<C> function>
Outcome check(const Recording& recorded) {
  Reader reader{recorded.inputs};
  Checker checker{recorded.outputs};
  Outcome outcome;
  std::uint32_t total = 0;
  for (int i = 0; i < recorded.rounds; ++i) {
    typename C::Input input;
    typename C::Output output;
    transfer(reader, input);
    const auto call = [](const void* in, void* out) {
      function(*static_cast<const typename C::Input*>(in), *static_cast<typename C::Output*>(out));
    };
    const Cost cost = measure(call, &input, &output, kIsStateful<C>);
    transfer(checker, output);
    total += cost.instructions;
    if (cost.instructions > outcome.most_instructions)
      outcome.most_instructions = cost.instructions;
    if (cost.stack > outcome.stack) outcome.stack = cost.stack;
  }
  outcome.words = checker.words();
  outcome.different = checker.different();
  outcome.mean_instructions = total / static_cast<std::uint32_t>(recorded.rounds);
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

/// Fills the input of one round; made by inputs.hpp.
template <class C>
void make_input(typename C::Input& input, uwbpos::sim::Random& random, int round);

template <class C, Function<C> function>
void record(const char* symbol, std::vector<Word>& inputs, std::vector<Word>& outputs) {
  uwbpos::sim::Random random{symbol};
  Writer to_inputs{inputs};
  Writer to_outputs{outputs};
  for (int i = 0; i < C::kRounds; ++i) {
    auto input = typename C::Input{};
    make_input<C>(input, random, i);
    transfer(to_inputs, input);
    typename C::Output output;
    function(input, output);
    transfer(to_outputs, output);
  }
}

#endif

}  // namespace firmware

/// The function to call, with a name that a linker knows, and its entry.
#define FIRMWARE_FUNCTION(symbol, type)                                                \
  extern "C" [[gnu::noinline]] void symbol(const type::Input& in, type::Output& out) { \
    new (&out) type::Output(type::run(in));                                            \
  }
#ifdef FIRMWARE_TARGET
#define FIRMWARE_ENTRY(symbol, type) \
  firmware::Entry { #symbol, type::kRounds, firmware::check<type, symbol> }
#else
#define FIRMWARE_ENTRY(symbol, type) \
  firmware::Entry { #symbol, type::kRounds, firmware::record<type, symbol> }
#endif
