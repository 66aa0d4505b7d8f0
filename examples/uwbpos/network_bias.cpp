// SPDX-License-Identifier: MIT
#include "network_bias.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "uwbpos/core/quaternion.hpp"

#include "failure.hpp"
#include "tdoa.hpp"

namespace uwbpos::host {
namespace {

// Predicts biases along a track.
class AlongTrack {
 public:
  AlongTrack(const Site& site, const LinkNetwork& network, const Replay& result)
      : site_{site}, network_{network} {
    for (const Position& p : result.track) of_tag_[p.tag].push_back(&p);
  }

  [[nodiscard]] std::optional<double> bias(const Reading& r) const {
    return of_link(r.t, r.tag, r.anchor);
  }

  [[nodiscard]] std::optional<double> bias(const Difference& d) const {
    const auto a = of_link(d.t, d.tag, d.anchor_a);
    const auto b = of_link(d.t, d.tag, d.anchor_b);
    return a && b ? std::optional{*b - *a} : std::nullopt;
  }

 private:
  [[nodiscard]] std::optional<double> of_link(double t, Id tag, Id anchor) const {
    const auto at = site_.anchors.find(anchor);
    const auto attitude = site_.attitude.at(t);
    const Position* nearest = position_at(t, tag);
    if (at == site_.anchors.end() || !attitude || nearest == nullptr) return std::nullopt;
    const Rotation& q = attitude->rotation;
    const Mat<double, 3> map_R_body =
        rotation_matrix(normalised<double>(Quaternion<double>{q.w, q.x, q.y, q.z}));
    return network_.bias(tag, anchor, at->second - nearest->position, map_R_body);
  }

  [[nodiscard]] const Position* position_at(double t, Id tag) const {
    constexpr double near = 1;  // [s]
    const auto found = of_tag_.find(tag);
    if (found == of_tag_.end()) return nullptr;
    const auto& track = found->second;
    auto after = std::ranges::lower_bound(track, t, {}, [](const Position* p) { return p->t; });
    if (after == track.end() ||
        (after != track.begin() && t - (*(after - 1))->t < (*after)->t - t)) {
      --after;
    }
    return std::abs((*after)->t - t) <= near ? *after : nullptr;
  }

  const Site& site_;
  const LinkNetwork& network_;
  std::map<Id, std::vector<const Position*>> of_tag_;
};

double& value_of(Reading& r) { return r.range; }
double& value_of(Difference& d) { return d.difference; }

template <class Measurement, class Solve>
Replay settle(const Settings& settings, Site& site, const std::vector<Measurement>& measured,
              const Solve& solve) {
  constexpr int most = 10;
  constexpr double settled = 1e-3;  // [m]
  const auto network = std::exchange(site.network, nullptr);
  std::vector<Measurement> corrected = measured;
  Replay result = solve(corrected);
  if (result.dim == 2 && !settings.height) {
    throw Failure{"--bias-network needs heights, so --height or --dim 3"};
  }
  for (int round = 0; round < most; ++round) {
    const AlongTrack along{site, *network, result};
    std::size_t unknown = 0;
    double change = 0;
    for (std::size_t i = 0; i < measured.size(); ++i) {
      const auto bias = along.bias(measured[i]);
      Measurement less = measured[i];
      value_of(less) -= bias.value_or(0);
      unknown += bias ? 0 : 1;
      change = std::max(change, std::abs(value_of(less) - value_of(corrected[i])));
      corrected[i] = less;
    }
    if (change < settled) break;
    result = solve(corrected);
    result.without_bias += unknown;
  }
  return result;
}

}  // namespace

Replay replay_with_network(const Settings& settings, Site site,
                           const std::vector<Reading>& readings,
                           const std::function<void(std::size_t, std::size_t)>& progress) {
  return settle(settings, site, readings, [&](const std::vector<Reading>& corrected) {
    return replay(settings, site, corrected, progress);
  });
}

Replay replay_with_network(const Settings& settings, Site site,
                           const std::vector<Difference>& differences,
                           const std::function<void(std::size_t, std::size_t)>& progress) {
  return settle(settings, site, differences, [&](const std::vector<Difference>& corrected) {
    return replay_differences(settings, site, corrected, progress);
  });
}

}  // namespace uwbpos::host
