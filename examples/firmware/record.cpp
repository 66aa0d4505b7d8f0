// SPDX-License-Identifier: MIT
// Simulates the robot's drive and writes the exchanges of its two tags as a header.
#include <cmath>
#include <cstdio>

#include <uwbpos/sim/exchange.hpp>

#include "recorded_radio.hpp"

namespace {

using namespace uwbpos;

// Round the hall at 1 m/s, seven and a half seconds of it.
constexpr double kSpeed = 1;
constexpr double kRadius = 3;
constexpr int kRounds = 60;
constexpr double kSlot = 0.015;  // an exchange each [s]

sim::Motion motion_of(double t, double side) {
  const double angle = kSpeed * t / kRadius;
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  // It looks along the circle; its left is towards the middle.
  const double radius = kRadius - side;
  return {{8 + radius * c, 6 + radius * s, 0.5},
          {-kSpeed * radius / kRadius * s, kSpeed * radius / kRadius * c, 0}};
}

}  // namespace

int main() {
  const tag::Settings& settings = tag::settings();
  const auto bias = RangeBias<float>::make(settings.power_bias);
  if (!bias) return 1;
  sim::Random random{"a delivery robot"};
  sim::Radio radio;
  radio.sigma_rx = 0.15e-9;
  radio.reply = 300e-6;
  radio.final_reply = 400e-6;
  radio.reply_jitter = 20e-6;
  radio.tx_grid = 512;
  sim::Device tags[2];
  sim::Device stations[tag::kStations];
  for (auto* device :
       {&tags[0], &tags[1], &stations[0], &stations[1], &stations[2], &stations[3]}) {
    device->antenna_delay = static_cast<double>(settings.antenna_delay);
    device->clock.rate = random.uniform(-10e-6, 10e-6);
  }
  std::puts(
      "#include \"recorded_radio.hpp\"\ninline constexpr tag::RecordedExchange kExchanges[] = {");
  double t = 0;
  for (int round = 0; round < kRounds; ++round) {
    for (std::uint32_t of = 0; of < 2; ++of) {
      for (std::uint32_t station = 0; station < tag::kStations; ++station, t += kSlot) {
        const sim::Motion here = motion_of(t, of == 0 ? 0.3 : -0.3);
        const sim::Motion there{settings.stations[station].cast<double>(), {0, 0, 0}};
        const double distance = (here.position - there.position).norm();
        const double power = -76 - 20 * std::log10(distance / 3) + random.normal(0, 0.5);
        const double late = static_cast<double>(bias->at(static_cast<float>(power)).value_or(0.0f));
        const auto result = sim::exchange(sim::Instant{} + t, tags[of], here, stations[station],
                                          there, late, radio, random);
        const auto s = sim::ds_stamps(result);
        if (!s) continue;
        std::printf("{%lld, %u, %u, {", static_cast<long long>(t * 1e6), of, station);
        for (const auto stamp :
             {s->poll_tx, s->poll_rx, s->resp_tx, s->resp_rx, s->final_tx, s->final_rx}) {
          std::printf("%lluu,", static_cast<unsigned long long>(stamp.ticks()));
        }
        std::printf("}, %.2ff},\n", power);
      }
    }
  }
  std::puts("};");
  return 0;
}
