// SPDX-License-Identifier: MIT
// A flight whose ranges and differences are biased by how the antennas see each other, as files to
// train a network from or to score one on:
//   flights DIRECTORY [FLIGHT [SECONDS [SIGMA [PEAK_TO_PEAK]]]]
// writes anchors.csv, ranges.csv, tdoa.csv, truth.tum and attitude.tum, ten epochs a second. One
// FLIGHT number, one path; the antennas and anchors are the same in all. Without a DIRECTORY it
// tells how much of the bias constants can take away.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <vector>

#include <uwbpos/core/angle.hpp>
#include <uwbpos/sim/antenna_pattern.hpp>
#include <uwbpos/sim/flight.hpp>
#include <uwbpos/sim/noise.hpp>

namespace {

using namespace uwbpos;
using Spot = Vec<double, 3>;

constexpr std::size_t kAnchorCount = 8;

struct Place {
  std::array<Spot, kAnchorCount> anchors;
  std::array<sim::Antenna, kAnchorCount> antennas;
  sim::Antenna tag;  // as the body lies
};

// `peak_to_peak` of a link: half of it from either antenna.
Place make_place(double peak_to_peak) {
  sim::Random random{"antennas of the hall"};
  Place place;
  for (std::size_t i = 0; i < kAnchorCount; ++i) {
    place.anchors[i] = {i % 2 == 0 ? 0.0 : 10.0, i / 2 % 2 == 0 ? 0.0 : 8.0, i < 4 ? 0.3 : 3.5};
    place.antennas[i] = {sim::random_antenna_pattern(peak_to_peak / 2, random),
                         sim::random_rotation(random)};
  }
  place.tag.pattern = sim::random_antenna_pattern(peak_to_peak / 2, random);
  return place;
}

struct Epoch {
  double t;
  Spot position;
  Quaternion<double> attitude;
  std::array<double, kAnchorCount> range;  // true
  std::array<double, kAnchorCount> bias;
};

std::vector<Epoch> fly(const Place& place, std::uint64_t number, double seconds) {
  constexpr double rate = 10;
  sim::Random random{number, "path"};
  const sim::Flight flight = sim::random_flight({1, 1, 0.5}, {9, 7, 3}, random);
  std::vector<Epoch> epochs;
  for (int k = 0; k < static_cast<int>(seconds * rate); ++k) {
    const double t = k / rate;
    Epoch epoch{t, flight.position(t), flight.attitude(t), {}, {}};
    sim::Antenna tag = place.tag;
    tag.map_q_antenna = epoch.attitude;
    for (std::size_t i = 0; i < kAnchorCount; ++i) {
      const Spot offset = place.anchors[i] - epoch.position;
      epoch.range[i] = norm<double, 3>(offset);
      epoch.bias[i] = sim::link_bias(tag, place.antennas[i], offset);
    }
    epochs.push_back(epoch);
  }
  return epochs;
}

void pose_line(std::FILE* file, double t, const Spot& p, const Quaternion<double>& q) {
  std::fprintf(file, "%.3f %.5f %.5f %.5f %.7f %.7f %.7f %.7f\n", t, p[0], p[1], p[2], q[1], q[2],
               q[3], q[0]);
}

struct File {
  explicit File(const std::filesystem::path& path) : stream{std::fopen(path.c_str(), "w")} {}
  ~File() {
    if (stream != nullptr) std::fclose(stream);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  std::FILE* stream;
};

int write(const std::filesystem::path& directory, std::uint64_t number, double seconds,
          double sigma, double peak_to_peak) {
  const Place place = make_place(peak_to_peak);
  std::error_code ignored;
  std::filesystem::create_directories(directory, ignored);
  const File anchors{directory / "anchors.csv"};
  const File ranges{directory / "ranges.csv"};
  const File tdoa{directory / "tdoa.csv"};
  const File truth{directory / "truth.tum"};
  const File attitude{directory / "attitude.tum"};
  for (const File* f : {&anchors, &ranges, &tdoa, &truth, &attitude}) {
    if (f->stream != nullptr) continue;
    std::fprintf(stderr, "%s: cannot be written\n", directory.c_str());
    return 1;
  }
  std::fputs("anchor_id,x_m,y_m,z_m\n", anchors.stream);
  for (std::size_t i = 0; i < kAnchorCount; ++i) {
    const Spot& p = place.anchors[i];
    std::fprintf(anchors.stream, "%zu,%.3f,%.3f,%.3f\n", i, p[0], p[1], p[2]);
  }
  std::fputs("t_s,anchor_id,range_m,sigma_m,true_bias_m\n", ranges.stream);
  std::fputs("t_s,anchor_id_a,anchor_id_b,difference_m,sigma_m,true_bias_m\n", tdoa.stream);
  sim::Random range_noise{number, "ranges"};
  sim::Random arrival_noise{number, "arrivals"};
  // An inertial unit knows up and down to half a degree and north to two, and drifts slowly.
  sim::Random unit{number, "attitude"};
  const double degree = degrees_to_radians(1.0);
  const std::array<sim::SlowWander, 3> drift{sim::random_wander(0.5 * degree, 0.1, 1, unit),
                                             sim::random_wander(0.5 * degree, 0.1, 1, unit),
                                             sim::random_wander(2 * degree, 0.05, 0.3, unit)};
  for (const Epoch& e : fly(place, number, seconds)) {
    pose_line(truth.stream, e.t, e.position, e.attitude);
    const Spot turn{drift[0].at(e.t), drift[1].at(e.t), drift[2].at(e.t)};
    pose_line(attitude.stream, e.t, Spot::Zero(),
              multiply<double>(quaternion_from_turn<double>(turn), e.attitude));
    const double arrival = arrival_noise.normal(0, sigma);
    for (std::size_t i = 0; i < kAnchorCount; ++i) {
      std::fprintf(ranges.stream, "%.3f,%zu,%.4f,%.4f,%.5f\n", e.t, i,
                   e.range[i] + e.bias[i] + range_noise.normal(0, sigma), sigma, e.bias[i]);
      if (i == 0) continue;
      const double bias = e.bias[i] - e.bias[0];
      const double noise = arrival_noise.normal(0, sigma) - arrival;
      std::fprintf(tdoa.stream, "%.3f,0,%zu,%.4f,%.4f,%.5f\n", e.t, i,
                   e.range[i] - e.range[0] + bias + noise, std::numbers::sqrt2 * sigma, bias);
    }
  }
  return 0;
}

double root_mean_square(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

int tell() {
  const double peak_to_peak = 0.3;
  const Place place = make_place(peak_to_peak);
  std::vector<double> raw;
  std::vector<double> less_medians;
  const auto seen = fly(place, 1, 120);
  const auto unseen = fly(place, 2, 120);
  for (std::size_t i = 0; i < kAnchorCount; ++i) {
    std::vector<double> of_link;
    for (const Epoch& e : seen) of_link.push_back(e.bias[i]);
    std::ranges::nth_element(of_link, of_link.begin() + static_cast<long>(of_link.size() / 2));
    const double median = of_link[of_link.size() / 2];
    for (const Epoch& e : unseen) {
      raw.push_back(e.bias[i]);
      less_medians.push_back(e.bias[i] - median);
    }
  }
  std::printf(
      "bias of %.1f m peak to peak, on an unseen flight: %.3f m rms, less a constant for "
      "each link %.3f m\n",
      peak_to_peak, root_mean_square(raw), root_mean_square(less_medians));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return tell();
  const auto number = [&](int place, double otherwise) {
    return argc > place ? std::strtod(argv[place], nullptr) : otherwise;
  };
  const double seconds = number(3, 120);
  const double sigma = number(4, 0.03);
  const double peak_to_peak = number(5, 0.3);
  if (!(seconds > 0) || seconds > 1e5 || !(sigma >= 0) || !(peak_to_peak > 0)) {
    std::fputs("flights DIRECTORY [FLIGHT [SECONDS [SIGMA [PEAK_TO_PEAK]]]]\n", stderr);
    return 2;
  }
  const auto flight = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  return write(argv[1], flight, seconds, sigma, peak_to_peak);
}
