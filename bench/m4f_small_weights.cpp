// SPDX-License-Identifier: MIT
// Instructions of a layer of 50 × 50 with weights in float, float16 and int8, by SysTick. Not part
// of any build: for an emulated Cortex-M4F whose SysTick counts instructions (QEMU's mps2-an386
// with -icount shift=0: one tick is 40), with that board's start-up and
//   -mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard -mfp16-format=ieee -O2 -fno-math-errno
//   -ffp-contract=off -DNDEBUG
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>

#include "uwbpos/filter/bias_network.hpp"

namespace {

constexpr std::size_t kWide = 50;
using Values = std::array<float, kWide>;

// As DenseLayer does it, with conversions.
template <class Weight>
struct SmallLayer {
  std::array<std::array<Weight, kWide>, kWide> weights;
  Values scales;
  Values biases;

  template <std::size_t From, std::size_t Count>
  [[gnu::always_inline]] void block(const Values& in, const std::array<std::size_t, kWide>& places,
                                    std::size_t count, Values& out) const {
    std::array<float, Count> sums{};
    for (std::size_t j = 0; j < count; ++j) {
      const float x = in[places[j]];
      const Weight* w = weights[places[j]].data() + From;
#pragma GCC unroll 32
      for (std::size_t k = 0; k < Count; ++k) sums[k] += x * static_cast<float>(w[k]);
    }
#pragma GCC unroll 32
    for (std::size_t k = 0; k < Count; ++k) {
      out[From + k] = sums[k] * scales[From + k] + biases[From + k];
    }
  }

  [[gnu::noinline]] void operator()(const Values& in, Values& out) const {
    std::array<std::size_t, kWide> places;
    std::size_t count = 0;
    for (std::size_t i = 0; i < kWide; ++i) {
      if (in[i] != 0) places[count++] = i;
    }
    block<0, 24>(in, places, count, out);
    block<24, 24>(in, places, count, out);
    block<48, 2>(in, places, count, out);
  }
};

struct FloatLayer {
  uwbpos::DenseLayer<float, kWide, kWide> layer;
  [[gnu::noinline]] void operator()(const Values& in, Values& out) const { out = layer(in); }
};

FloatLayer in_float;
SmallLayer<__fp16> in_float16;
SmallLayer<std::int8_t> in_int8;

template <class Layer>
void count(const char* name, const Layer& layer) {
  volatile std::uint32_t* const systick = reinterpret_cast<std::uint32_t*>(0xE000E010);
  constexpr int calls = 200;
  constexpr int tick = 40;  // [instructions]
  Values in;
  Values out;
  for (std::size_t i = 0; i < kWide; ++i) in[i] = 0.1f * static_cast<float>(i + 1);
  systick[1] = 0xffffff;
  systick[2] = 0;
  systick[0] = 5;
  layer(in, out);  // until the counter has begun
  const std::uint32_t before = systick[2];
  for (int i = 0; i < calls; ++i) {
    layer(in, out);
    asm volatile("" ::: "memory");
  }
  const std::uint32_t after = systick[2];
  std::printf("%-8s %d instructions\n", name, static_cast<int>(before - after) * tick / calls);
}

}  // namespace

int main() {
  count("float", in_float);
  count("float16", in_float16);
  count("int8", in_int8);
  return 0;
}
