// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What a tracker remembers of a measurement, and how it corrects a track. Ranges are
/// \f$ |p_{tag} - b| + \beta_b \f$ and differences \f$ |p_{tag} - b| - |p_{tag} - a| + \beta_b -
/// \beta_a \f$ with the anchors' biases β.
///
/// **One arrival shared by several differences** d_i = ρ_i − ρ_0 correlates their noise,
/// σ²(I + 11ᵀ). Taken one after the other, the k-th tells, independently of those before,
/// \f[ d_k - \frac1k \sum_{i<k} d_i = \rho_k - \frac1k \Big( \rho_0 + \sum_{i<k} \rho_i \Big),
///     \qquad \mathrm{var} = \sigma^2 \left( 1 + \tfrac1k \right): \tag{1} \f]
/// the arrival k against the mean of all arrivals before. Refused ones are left out of the mean.

#include <cmath>
#include <cstdint>
#include <span>
#include <variant>

#include "uwbpos/core/angle.hpp"
#include "uwbpos/filter/measurements.hpp"
#include "uwbpos/filter/track.hpp"
#include "uwbpos/model/range.hpp"

namespace uwbpos {

/// A range to `b`, or a difference b − a, with anchors and tag looked up.
template <class S>
struct ArrivalEvent {
  Vec<S, 3> a;                 ///< where anchor a is [m]
  Vec<S, 3> b;                 ///< where anchor b is [m]
  Vec<S, 3> lever;             ///< of the tag, in the body's frame [m]
  S value;                     ///< [m]
  S variance;                  ///< [m²]
  std::uint32_t anchor_a;      ///< id
  std::uint32_t anchor_b;      ///< id
  std::uint32_t tag;           ///< id
  int bias_a = -1;             ///< place of its bias, −1 without one
  int bias_b = -1;             ///< place of its bias, −1 without one
  bool is_difference = false;  ///< else a range
  bool shared = false;         ///< see `TimedDifference`
};

/// A single number about the body.
template <class S>
struct ScalarEvent {
  /// Which number.
  enum class Kind : std::uint8_t { Height, Heading, Speed, TurnRate };
  Kind kind;   ///< which
  S value;     ///< its unit is the kind's
  S variance;  ///< squared
};

/// Anything that a tracker was fed.
template <class S>
struct Event {
  std::int64_t time;  ///< [µs]
  std::variant<ArrivalEvent<S>, ImuSample<S>, ScalarEvent<S>, TimedPosition<S>, TimedVelocity<S>>
      what;           ///< one of them
  bool used = false;  ///< by the track as it stands
};

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
    if (slot >= 0 && slot < Biases) {
      predicted += weight * bias[slot];
      by_bias[slot] += weight;
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
      for (std::size_t i = before.size(); i-- > 0 && before[i].time == track.time;) {
        if (const auto* other = detail::shares_with(event, before[i])) visit(*other);
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
    return gated_correct(track, model, whole, S(value - sum.predicted), noise, slope);
  }
}

/// A sample of an inertial unit: drives the motion that it can drive; to a planar robot its z axis
/// measures the turn rate.
template <class Motion, int Biases, class S>
[[nodiscard]] Result<Innovation<S>> apply(Track<Motion, Biases>& track,
                                          const TrackModel<Motion>& model,
                                          const ImuSample<S>& sample, std::span<const Event<S>>) {
  if constexpr (requires { track.input.gyro; }) {
    track.input = {sample.gyro, sample.accelerometer, S(0)};
    return Innovation<S>{};
  } else if constexpr (requires { model.motion.gyro_sigma; }) {
    Vec<S, Motion::kTurnRate + 1> row = Vec<S, Motion::kTurnRate + 1>::Zero();
    row[Motion::kTurnRate] = S(1);
    const S sigma = model.motion.gyro_sigma;
    const S innovation = sample.gyro[2] - track.state[Motion::kTurnRate];
    return gated_correct(track, model, row, innovation, S(sigma * sigma), S(0));
  } else {
    return Innovation<S>{};
  }
}

/// A height, a heading, a speed or a turn rate, of which the tracker lets in those that the motion
/// has.
template <class Motion, int Biases, class S>
[[nodiscard]] Result<Innovation<S>> apply(Track<Motion, Biases>& track,
                                          const TrackModel<Motion>& model,
                                          const ScalarEvent<S>& event, std::span<const Event<S>>) {
  using Kind = typename ScalarEvent<S>::Kind;
  if (event.kind == Kind::Height) {
    if constexpr (Motion::kDimension == 3) {
      const S z = model.motion.place(track.state, Vec<S, 3>::Zero().eval())[2];
      return gated_correct(track, model, Vec<S, 3>{S(0), S(0), S(1)}, S(event.value - z),
                           event.variance, S(1));
    }
  } else if (event.kind == Kind::Heading) {
    if constexpr (Motion::kHasHeading) {
      const S off = angle_difference(event.value, model.motion.heading(track.state));
      return gated_correct(track, model, model.motion.heading_row(track.state), off, event.variance,
                           S(0));
    }
  } else if constexpr (requires { Motion::kSpeed; }) {
    const int place = event.kind == Kind::Speed ? Motion::kSpeed : Motion::kTurnRate;
    Vec<S, Motion::kTurnRate + 1> row = Vec<S, Motion::kTurnRate + 1>::Zero();
    row[place] = S(1);
    return gated_correct(track, model, row, S(event.value - track.state[place]), event.variance,
                         S(0));
  }
  return std::unexpected(Error::InvalidOption);
}

/// A position, all of it or none. Its covariance is factored, so that its components come one by
/// one.
template <class Motion, int Biases, class S>
[[nodiscard]] Result<Innovation<S>> apply(Track<Motion, Biases>& track,
                                          const TrackModel<Motion>& model,
                                          const TimedPosition<S>& event,
                                          std::span<const Event<S>>) {
  constexpr int D = Motion::kDimension;
  const auto noise =
      FactoredCovariance<S, D>::from_matrix(event.covariance.template topLeftCorner<D, D>().eval());
  if (!noise) return std::unexpected(noise.error());
  const auto off = [&](const Track<Motion, Biases>& at) {
    const Vec<S, 3> place = model.motion.place(at.state, Vec<S, 3>::Zero().eval());
    return (event.position - place).template head<D>().eval();
  };
  const S distance = norm<S, D>(off(track));
  S variance = S(0);
  for (int k = 0; k < D; ++k) variance += event.covariance(k, k);
  const Reach<S> reach{seconds_between<S>(track.used_at, track.time), track.position_variance};
  if (const auto error = check_reach(model.gate, reach, distance, S(1), variance)) {
    return std::unexpected(*error);
  }
  Track<Motion, Biases> next = track;
  Mat<S, D> rows = Mat<S, D>::Identity();  // L⁻¹, row by row
  S square = S(0);
  for (int k = 0; k < D; ++k) {
    for (int j = 0; j < k; ++j) rows.row(k) -= noise->factor()(k, j) * rows.row(j);
    const Vec<S, D> row = rows.row(k).transpose();
    const ProjectedRow<S, D> projected = next.covariance.project(row);
    const S innovation = dot<S, D>(row, off(next));
    const S r = noise->diagonal()[k];
    square += innovation * innovation / (projected.variance + r);
    correct(next, model.motion, projected, innovation, r);
  }
  if (const auto error = check_statistics(model.gate, square, D)) return std::unexpected(*error);
  track = next;
  confirm(track);
  return Innovation<S>{distance, square, D};
}

/// A velocity, all of it or none.
template <class Motion, int Biases, class S>
[[nodiscard]] Result<Innovation<S>> apply(Track<Motion, Biases>& track,
                                          const TrackModel<Motion>& model,
                                          const TimedVelocity<S>& event,
                                          std::span<const Event<S>>) {
  constexpr int D = Motion::kDimension;
  const S variance = event.sigma * event.sigma;
  Track<Motion, Biases> next = track;
  S square = S(0);
  S length = S(0);
  for (int k = 0; k < D; ++k) {
    const auto projected = next.covariance.project(model.motion.velocity_row(next.state, k));
    const S innovation = event.velocity[k] - model.motion.velocity(next.state)[k];
    const S before = event.velocity[k] - model.motion.velocity(track.state)[k];
    length += before * before;
    square += innovation * innovation / (projected.variance + variance);
    correct(next, model.motion, projected, innovation, variance);
  }
  if (const auto error = check_statistics(model.gate, square, D)) return std::unexpected(*error);
  track = next;
  return Innovation<S>{std::sqrt(length), square, D};
}

/// Moves the track to the event's time and lets the event correct it. Errors: NotFinite,
/// Unreachable, OutlierRejected, InvalidCovariance; then the track has only moved.
template <class Motion, int Biases, class S>
[[nodiscard]] Result<Innovation<S>> apply(Track<Motion, Biases>& track,
                                          const TrackModel<Motion>& model, const Event<S>& event,
                                          std::span<const Event<S>> before) {
  advance(track, model, event.time);
  const auto with = [&](const auto& what) { return apply(track, model, what, before); };
  if (const auto* e = std::get_if<ArrivalEvent<S>>(&event.what)) return with(*e);
  if (const auto* e = std::get_if<ImuSample<S>>(&event.what)) return with(*e);
  if (const auto* e = std::get_if<ScalarEvent<S>>(&event.what)) return with(*e);
  if (const auto* e = std::get_if<TimedPosition<S>>(&event.what)) return with(*e);
  if (const auto* e = std::get_if<TimedVelocity<S>>(&event.what)) return with(*e);
  return Innovation<S>{};
}

}  // namespace uwbpos
