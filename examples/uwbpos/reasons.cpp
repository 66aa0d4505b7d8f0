// SPDX-License-Identifier: MIT
#include "reasons.hpp"

namespace uwbpos::host {

std::string_view reason_name(Error error) {
  switch (error) {
    case Error::NotFinite:
      return "not_finite";
    case Error::NumericOverflow:
      return "numeric_overflow";
    case Error::NonPositiveSigma:
      return "non_positive_sigma";
    case Error::InvalidOption:
      return "invalid_option";
    case Error::NegativeRange:
      return "negative_range";
    case Error::ImpossibleDifference:
      return "impossible_difference";
    case Error::TooFewMeasurements:
      return "too_few_measurements";
    case Error::TooManyMeasurements:
      return "too_many_measurements";
    case Error::DegenerateGeometry:
      return "degenerate_geometry";
    case Error::AmbiguousSolution:
      return "ambiguous_solution";
    case Error::InconsistentRanges:
      return "inconsistent_ranges";
    case Error::HeightExceedsRange:
      return "height_exceeds_range";
    case Error::NotConverged:
      return "not_converged";
    case Error::NonPositiveInterval:
      return "non_positive_interval";
    case Error::IntervalTooLong:
      return "interval_too_long";
    case Error::ReplyExceedsRoundTrip:
      return "reply_exceeds_round_trip";
    case Error::NegativeTimeOfFlight:
      return "negative_time_of_flight";
    case Error::RangeBeyondMaximum:
      return "range_beyond_maximum";
    case Error::ClockOffsetOutOfBounds:
      return "clock_offset_out_of_bounds";
    case Error::NotYetTracked:
      return "clock_not_yet_tracked";
    case Error::TimeNotIncreasing:
      return "time_not_increasing";
    case Error::GapTooLong:
      return "gap_too_long";
    case Error::ClockJump:
      return "clock_jump";
    case Error::OutlierRejected:
      return "outlier_rejected";
    case Error::TooOld:
      return "too_old";
    case Error::NotYetLocated:
      return "not_yet_located";
    case Error::Unreachable:
      return "unreachable";
    case Error::TrackLost:
      return "track_lost";
    case Error::UnknownTag:
      return "unknown_tag";
    case Error::InvalidCovariance:
      return "invalid_covariance";
    case Error::NotARotation:
      return "not_a_rotation";
    case Error::RotationUndetermined:
      return "rotation_undetermined";
    case Error::UnknownSubnet:
      return "unknown_subnet";
    case Error::DuplicateSubnet:
      return "duplicate_subnet";
    case Error::TemperatureOutOfRange:
      return "temperature_out_of_range";
    case Error::NoRepairFits:
      return "no_repair_fits";
    case Error::BaselineMismatch:
      return "baseline_mismatch";
    case Error::HeadingUndetermined:
      return "heading_undetermined";
    case Error::BearingUndefined:
      return "bearing_undefined";
    case Error::UnknownAnchor:
      return "unknown_anchor";
    case Error::DuplicateAnchor:
      return "duplicate_anchor";
    case Error::CapacityExceeded:
      return "capacity_exceeded";
    case Error::InvalidTable:
      return "invalid_table";
  }
  return "unknown_error";
}

std::string_view reason_words(std::string_view name) {
  for (int i = 0; i < kErrorCount; ++i) {
    const auto error = static_cast<Error>(i);
    if (reason_name(error) == name) return describe(error);
  }
  if (name == "bias_not_settled") return "pose and the network's bias at it do not agree";
  if (name == "liar_unknown") {
    return "one anchor may lie or another, and which is not known yet: a tag that moves tells";
  }
  if (name == "inconsistent") return "its measurements contradict one another beyond repair";
  if (name == "across_subnets") return "its two anchors belong to different subnets";
  return name;
}

std::size_t total(const Counts& counts) {
  std::size_t sum = 0;
  for (const auto& [reason, count] : counts) sum += count;
  return sum;
}

}  // namespace uwbpos::host
