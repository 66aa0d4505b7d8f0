// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// How ranges and differences correct a track. Ranges are \f$ |p_{tag} - b| + \beta_b \f$ and
/// differences \f$ |p_{tag} - b| - |p_{tag} - a| + \beta_b - \beta_a \f$ with the anchors' biases
/// β.
///
/// **One arrival shared by several differences** d_i = ρ_i − ρ_0 correlates their noise,
/// σ²(I + 11ᵀ). Taken one after the other, the k-th tells, independently of those before,
/// \f[ d_k - \frac1k \sum_{i<k} d_i = \rho_k - \frac1k \Big( \rho_0 + \sum_{i<k} \rho_i \Big),
///     \qquad \mathrm{var} = \sigma^2 \left( 1 + \tfrac1k \right): \tag{1} \f]
/// the arrival k against the mean of all arrivals before. Refused ones are left out of the mean.

#include <algorithm>
#include <span>

#include "uwbpos/filter/events.hpp"
#include "uwbpos/filter/track.hpp"
#include "uwbpos/model/range.hpp"

namespace uwbpos {

namespace detail {

// What (1) needs of the tag's place: prediction, gradient, biases.
template <class S, int Biases>
struct ArrivalSum {
  S predicted = S(0);
  Vec<S, 3> gradient = Vec<S, 3>::Zero();
  Vec<S, Biases> by_bias = Vec<S, Biases>::Zero();

  void add(const Vec<S, 3>& place, const Vec<S, 3>& anchor, int slot, const Vec<S, Biases>& bias,
           S weight) {
    const RangePrediction<S, 3> range = predict_range<S, 3>(place, anchor);
    predicted += weight * range.range;
    gradient += weight * range.gradient;
    if constexpr (Biases > 0) {
      if (slot >= 0 && slot < Biases) {
        predicted += weight * bias[slot];
        by_bias[slot] += weight;
      }
    }
  }
};

template <class S>
const ArrivalEvent<S>* shares_with(const ArrivalEvent<S>& event, const Event<S>& other) {
  const auto* before = std::get_if<ArrivalEvent<S>>(&other.what);
  const bool same = before != nullptr && other.used && before->is_difference && before->shared &&
                    before->anchor_a == event.anchor_a && before->tag == event.tag;
  return same ? before : nullptr;
}

}  // namespace detail

/// An arrival; `before` are the events before it, oldest first.
template <class Motion, int Biases, class S>
[[nodiscard]] Result<Innovation<S>> apply(Track<Motion, Biases>& track,
                                          const TrackModel<Motion>& model,
                                          const ArrivalEvent<S>& event,
                                          std::span<const Event<S>> before) {
  const Vec<S, 3> place = model.motion.place(track.state, event.lever);
  detail::ArrivalSum<S, Biases> sum;
  sum.add(place, event.b, event.bias_b, track.bias, S(1));
  S value = event.value;
  S noise = event.variance;
  if (event.is_difference && !event.shared) {
    sum.add(place, event.a, event.bias_a, track.bias, S(-1));
  } else if (event.is_difference) {
    int k = 1;
    S of_others = S(0);
    const auto for_others = [&](const auto& visit) {
      for (std::size_t left = before.size(); left > 0; --left) {
        const Event<S>& earlier = before[left - 1];
        if (earlier.time != track.time) break;
        if (const auto* other = detail::shares_with(event, earlier)) visit(*other);
      }
    };
    for_others([&](const ArrivalEvent<S>& other) {
      of_others += other.value;
      ++k;
    });
    const S share = S(1) / static_cast<S>(k);
    value -= share * of_others;
    noise = event.variance / S(2) * (S(1) + share);
    sum.add(place, event.a, event.bias_a, track.bias, -share);
    for_others([&](const ArrivalEvent<S>& other) {
      sum.add(place, other.b, other.bias_b, track.bias, -share);
    });
  }
  const Vec<S, Motion::kPoseDof> row =
      model.motion.place_row(track.state, event.lever, sum.gradient);
  const S slope = norm(sum.gradient);
  if constexpr (Biases == 0) {
    return gated_correct(track, model, row, S(value - sum.predicted), noise, slope);
  } else {
    Vec<S, Track<Motion, Biases>::kDof> whole = Vec<S, Track<Motion, Biases>::kDof>::Zero();
    whole.template head<Motion::kPoseDof>() = row;
    whole.template tail<Biases>() = sum.by_bias;
    track.heard = std::min(std::max({track.heard, event.bias_a + 1, event.bias_b + 1}), Biases);
    S unknown = S(0);
    for (int k = 0; k < track.heard && event.expected; ++k) {
      if (sum.by_bias[k] == S(0)) continue;
      const int state = Track<Motion, Biases>::kBias + k;
      unknown += sum.by_bias[k] * sum.by_bias[k] * track.covariance(state, state);
    }
    return gated_correct(track, model, whole, S(value - sum.predicted), noise, slope, unknown);
  }
}

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
