// SPDX-License-Identifier: MIT
#pragma once
#include "uwbpos/core/macros_off.hpp"

/// @file
/// What every fallible function of the library returns: a value, or the name of what was wrong.

#include <cstdint>
#include <expected>
#include <string_view>

namespace uwbpos {

/// Everything that can be wrong with data. `describe` says each in words.
enum class Error : std::uint8_t {
  // Any input.
  NotFinite,
  NumericOverflow,
  NonPositiveSigma,
  InvalidOption,
  // The set of measurements.
  NegativeRange,
  ImpossibleDifference,
  TooFewMeasurements,
  TooManyMeasurements,
  // Geometry.
  DegenerateGeometry,
  AmbiguousSolution,
  InconsistentRanges,
  HeightExceedsRange,
  NotConverged,
  // One exchange of timestamps.
  NonPositiveInterval,
  IntervalTooLong,
  ReplyExceedsRoundTrip,
  NegativeTimeOfFlight,
  RangeBeyondMaximum,
  ClockOffsetOutOfBounds,
  // A clock followed over time.
  NotYetTracked,
  TimeNotIncreasing,
  GapTooLong,
  ClockJump,
  OutlierRejected,
  TooOld,
  // A track.
  NotYetLocated,
  Unreachable,
  TrackLost,
  UnknownTag,
  // Frames.
  InvalidCovariance,
  NotARotation,
  RotationUndetermined,
  UnknownSubnet,
  DuplicateSubnet,
  // Ultrasound.
  TemperatureOutOfRange,
  NoRepairFits,
  // A body's pose.
  BaselineMismatch,
  HeadingUndetermined,
  BearingUndefined,
  // Tables.
  UnknownAnchor,
  DuplicateAnchor,
  CapacityExceeded,
  InvalidTable,
};

/// How many errors there are; they are numbered from zero without holes.
inline constexpr int kErrorCount = static_cast<int>(Error::InvalidTable) + 1;

/// One lower-case clause in English, fit to stand behind a colon. Never empty, never allocates.
[[nodiscard]] constexpr std::string_view describe(Error error) noexcept {
  switch (error) {
    case Error::NotFinite:
      return "an input is NaN or infinite";
    case Error::NumericOverflow:
      return "the numbers are too large or too small for the scalar type";
    case Error::NonPositiveSigma:
      return "a standard deviation is zero, negative or below a nanometre";
    case Error::InvalidOption:
      return "an option lies outside its domain";
    case Error::NegativeRange:
      return "a range is negative beyond its noise";
    case Error::ImpossibleDifference:
      return "a range difference exceeds its anchors' distance beyond noise";
    case Error::TooFewMeasurements:
      return "too few measurements for the unknowns";
    case Error::TooManyMeasurements:
      return "more measurements than the solver's fixed limit";
    case Error::DegenerateGeometry:
      return "the anchors do not determine a position (coincident, or in line in space)";
    case Error::AmbiguousSolution:
      return "two mirror images explain the measurements; give a side or a prior position";
    case Error::InconsistentRanges:
      return "no position comes near to explaining the measurements";
    case Error::HeightExceedsRange:
      return "the slant range is shorter than the height difference";
    case Error::NotConverged:
      return "the iteration did not converge";
    case Error::NonPositiveInterval:
      return "a later timestamp does not lie after the earlier one";
    case Error::IntervalTooLong:
      return "an interval is too long for exact arithmetic, or half the counter's range";
    case Error::ReplyExceedsRoundTrip:
      return "the reply took longer than the round trip, beyond what clock rates explain";
    case Error::NegativeTimeOfFlight:
      return "the time of flight is negative beyond noise";
    case Error::RangeBeyondMaximum:
      return "the range exceeds the maximum allowed";
    case Error::ClockOffsetOutOfBounds:
      return "the clocks' rates differ by more than the bound allows";
    case Error::NotYetTracked:
      return "not enough timestamps yet to know the clock's rate";
    case Error::TimeNotIncreasing:
      return "time does not increase";
    case Error::GapTooLong:
      return "the gap since the last measurement is too long to go on from it";
    case Error::ClockJump:
      return "a clock jumped or was reset";
    case Error::OutlierRejected:
      return "the measurement departs from what others predict, beyond noise; it was not used";
    case Error::TooOld:
      return "the stamps, or the synchronisation they rest on, are too old";
    case Error::NotYetLocated:
      return "there is no position yet: the measurements so far do not give one";
    case Error::Unreachable:
      return "the measurement lies farther from the track than the body can have moved";
    case Error::TrackLost:
      return "nothing was used for so long that the track is lost";
    case Error::UnknownTag:
      return "no tag has this id";
    case Error::InvalidCovariance:
      return "a matrix is no covariance (not symmetric, or not positive)";
    case Error::NotARotation:
      return "the matrix is no rotation (axes not orthonormal, or mirrored)";
    case Error::RotationUndetermined:
      return "the shared points do not determine a rotation (coincident, in line in space, or too "
             "noisy)";
    case Error::UnknownSubnet:
      return "no subnet has this id";
    case Error::DuplicateSubnet:
      return "a subnet with this id exists already";
    case Error::TemperatureOutOfRange:
      return "the temperature, or the speed of sound, lies outside what air has";
    case Error::NoRepairFits:
      return "no allowed number of whole waves brings the lag into its bounds";
    case Error::BaselineMismatch:
      return "the tags' distance departs from the known baseline beyond noise";
    case Error::HeadingUndetermined:
      return "nothing tells the heading: it takes tags apart, a measured one, or one known before";
    case Error::BearingUndefined:
      return "a target in the robot's own place has no bearing";
    case Error::UnknownAnchor:
      return "no anchor has this id";
    case Error::DuplicateAnchor:
      return "the same anchor twice";
    case Error::CapacityExceeded:
      return "the fixed capacity is exhausted";
    case Error::InvalidTable:
      return "the table is empty or its arguments do not increase";
  }
  return "unknown error";
}

/// A value or an `Error`. Never throws when checked before use (`if (r) use(*r)`).
template <class T>
using Result = std::expected<T, Error>;

}  // namespace uwbpos

#include "uwbpos/core/macros_back.hpp"
