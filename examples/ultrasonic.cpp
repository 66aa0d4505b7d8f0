// SPDX-License-Identifier: MIT
// From the counters of three ultrasonic receivers on a bar to the emitter's position, in spite of
// thresholds crossed waves too late. The counts are those of Jiang et al. (2009), table 1.
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include <uwbpos/ranging/ultrasonic.hpp>
#include <uwbpos/sim/paper_table.hpp>
#include <uwbpos/sim/ultrasonic.hpp>
#include <uwbpos/solve/fsri.hpp>

int main() {
  using uwbpos::Vec;
  const auto receivers = uwbpos::sim::table_receivers<float>();
  const float temperature = 24.0F;
  const auto wavelength = uwbpos::ultrasonic_wavelength(temperature);
  if (!wavelength) return 1;
  int solved = 0;
  for (const auto& row : uwbpos::sim::kPaperTable) {
    std::array<float, 3> lengths;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto length =
          uwbpos::ultrasonic_length<float>(row.counts[i], {.temperature = temperature});
      if (!length) return 1;
      lengths[i] = length->value;
    }
    const auto shot = uwbpos::fsri(receivers, lengths, {.wavelength = *wavelength});
    if (!shot) {
      std::printf("refused: %s\n", std::string{uwbpos::describe(shot.error())}.c_str());
      continue;
    }
    ++solved;
    const float sigma = std::sqrt(shot->covariance(0, 0) + shot->covariance(1, 1));
    std::printf("x %5.1f cm, y %5.1f cm (± %.1f), lag %.2f cm, waves moved %d %d %d%s\n",
                static_cast<double>(100 * shot->position.x()),
                static_cast<double>(100 * shot->position.y()), static_cast<double>(100 * sigma),
                static_cast<double>(100 * shot->lag), shot->repair[0], shot->repair[1],
                shot->repair[2], shot->ambiguous ? ", ambiguous" : "");
  }

  // A fourth receiver leaves a residual to judge by, whatever the order of the lags.
  const auto bar = uwbpos::sim::paper_receivers();
  const std::array<Vec<double, 2>, 4> four{bar[0], bar[1], bar[2], Vec<double, 2>{-0.4, 0.4}};
  uwbpos::sim::Random random{"example"};
  int right = 0;
  for (int k = 0; k < uwbpos::sim::kPaperShots; ++k) {
    const Vec<double, 2> emitter = uwbpos::sim::paper_emitter(k);
    const auto lengths = uwbpos::sim::paper_shot<2, 4>(random, four, emitter).lengths;
    const auto shot = uwbpos::fsri(four, lengths, {.wavelength = uwbpos::sim::kPaperWave});
    right += shot && (shot->position - emitter).norm() < 0.006 ? 1 : 0;
  }
  std::printf("simulated, four receivers: %d of %d shots within 6 mm\n", right,
              uwbpos::sim::kPaperShots);
  return solved == 4 && right > 40 ? 0 : 1;
}
