// SPDX-License-Identifier: MIT
// A batch answers as the single solvers do, epoch by epoch, whatever stands in the other lanes.
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/solve/batch.hpp"

#include "solve/difference_rooms.hpp"

namespace tests::solve_batch {

using namespace uwbpos;

namespace {

/// Not a multiple of any number of lanes.
constexpr std::size_t kEpochs = 403;

template <class S, int D>
struct Recording {
  std::vector<Vec<S, D>> anchors;
  std::vector<S> sigmas;
  std::vector<S> ranges;

  [[nodiscard]] RangeBatch<S, D> batch() const { return {anchors, sigmas, ranges}; }
  [[nodiscard]] std::vector<RangeTo<S, D>> epoch(std::size_t e) const {
    std::vector<RangeTo<S, D>> all;
    for (std::size_t i = 0; i < anchors.size(); ++i) {
      const S range = ranges[i * kEpochs + e];
      if (!std::isnan(range)) all.push_back({anchors[i], range, sigmas[i]});
    }
    return all;
  }
};

/// Tags in and around a hall; a fifth of the ranges missing, spikes, infinities and negative ranges
/// among them if `harsh`.
template <class S, int D>
Recording<S, D> record(sim::Random& random, int anchors, bool harsh) {
  Recording<S, D> recording;
  for (int i = 0; i < anchors; ++i) {
    recording.anchors.push_back(test::random_in_box<S, D>(random, test::room_corner<S, D>(0, 0, 0),
                                                          test::room_corner<S, D>(20, 15, 6)));
    recording.sigmas.push_back(S(random.uniform(0.05, 0.2)));
  }
  recording.ranges.resize(recording.anchors.size() * kEpochs);
  for (std::size_t e = 0; e < kEpochs; ++e) {
    const auto tag = test::random_in_box<S, D>(random, test::room_corner<S, D>(-2, -2, -1),
                                               test::room_corner<S, D>(22, 17, 7));
    for (std::size_t i = 0; i < recording.anchors.size(); ++i) {
      S& range = recording.ranges[i * kEpochs + e];
      range = test::true_range<S, D>(tag, recording.anchors[i]) +
              S(random.normal()) * recording.sigmas[i];
      if (!harsh) continue;
      if (random.chance(0.2)) range = std::numeric_limits<S>::quiet_NaN();
      if (random.chance(0.02)) range += S(30);
      if (random.chance(0.005)) range = std::numeric_limits<S>::infinity();
      if (random.chance(0.005)) range = S(-5);
    }
  }
  return recording;
}

/// The same answer, or the same error. Of floats the very bits, where no sum and product were
/// fused.
template <class S, int D>
void check_same(const Result<Fix<S, D>>& found, const Result<Fix<S, D>>& single) {
  REQUIRE(found.has_value() == single.has_value());
  if (!found) {
    CHECK(found.error() == single.error());
    return;
  }
  const Vec<double, D> off = (found->position - single->position).template cast<double>();
  const double deviation = std::sqrt(double(single->covariance.trace()));
  CHECK(off.norm() < 3e-3 * deviation + (sizeof(S) == 4 ? 1e-4 : 1e-11));
  CHECK(std::abs(found->covariance.trace() / single->covariance.trace() - S(1)) < S(0.05));
  CHECK(double(found->chi_squared) ==
        doctest::Approx(double(single->chi_squared)).epsilon(1e-3).scale(1));
  CHECK(found->degrees_of_freedom == single->degrees_of_freedom);
#if !defined(__FMA__)
  if (sizeof(S) == 4) CHECK(off.norm() < 2e-5 * deviation + 1e-9);
#endif
}

template <class S, int D>
void check_ranges_batch(bool harsh) {
  sim::Random random{"batch"};
  for (int anchors = D - 1; anchors <= 12; anchors += anchors < D + 3 ? 1 : 3) {
    const auto recording = record<S, D>(random, anchors, harsh);
    std::vector<Result<Fix<S, D>>> fixes(kEpochs, std::unexpected(Error::InvalidOption));
    const std::span<Result<Fix<S, D>>> out{fixes};
    const auto together = toa_least_squares(recording.batch(), out);
    REQUIRE(together);
    if (anchors >= D + 3 && !harsh) CHECK(*together > kEpochs / 2);
    for (std::size_t e = 0; e < kEpochs; ++e) {
      check_same<S, D>(fixes[e], toa_least_squares(recording.epoch(e)));
    }
    LocateOptions<S, D> options;
    options.side = test::room_corner<S, D>(0, D == 2 ? 1 : 0, -1);
    REQUIRE(locate(recording.batch(), out, options));
    for (std::size_t e = 0; e < kEpochs; ++e) {
      check_same<S, D>(fixes[e], locate(recording.epoch(e), options));
    }
    std::vector<Result<Mirror<S, D>>> mirrors(kEpochs, std::unexpected(Error::InvalidOption));
    REQUIRE(toa_closed_form(recording.batch(), std::span<Result<Mirror<S, D>>>{mirrors}));
    for (std::size_t e = 0; e < kEpochs; ++e) {
      const auto single = toa_closed_form(recording.epoch(e));
      REQUIRE(mirrors[e].has_value() == single.has_value());
      if (!single) {
        CHECK(mirrors[e].error() == single.error());
        continue;
      }
      const double tolerance = sizeof(S) == 4 ? 1e-3 : 1e-9;
      CHECK(double((mirrors[e]->first - single->first).norm()) < tolerance);
      CHECK(double((mirrors[e]->second - single->second).norm()) < tolerance);
    }
  }
}

template <class S, int D>
void check_differences_batch(bool harsh) {
  sim::Random random{"difference batch"};
  for (int anchors = D; anchors <= 12; anchors += anchors < D + 4 ? 1 : 3) {
    auto recording = record<S, D>(random, anchors, harsh);
    // Against the first.
    for (std::size_t i = 1; i < recording.anchors.size(); ++i) {
      for (std::size_t e = 0; e < kEpochs; ++e) {
        recording.ranges[i * kEpochs + e] -= recording.ranges[e];
      }
    }
    const Vec<S, D> reference = recording.anchors[0];
    const DifferenceBatch<S, D> batch{
        reference, std::span<const Vec<S, D>>{recording.anchors}.subspan(1), S(0.1),
        std::span<const S>{recording.ranges}.subspan(kEpochs)};
    std::vector<Result<Fix<S, D>>> fixes(kEpochs, std::unexpected(Error::InvalidOption));
    const auto together = locate(batch, std::span<Result<Fix<S, D>>>{fixes});
    REQUIRE(together);
    if (anchors >= D + 6 && !harsh) CHECK(*together > kEpochs / 5);
    for (std::size_t e = 0; e < kEpochs; ++e) {
      std::vector<DifferenceTo<S, D>> differences;
      for (std::size_t i = 1; i < recording.anchors.size(); ++i) {
        const S d = recording.ranges[i * kEpochs + e];
        if (!std::isnan(d)) differences.push_back({recording.anchors[i], d});
      }
      check_same<S, D>(fixes[e], locate(reference, differences, S(0.1)));
    }
  }
}

}  // namespace

TEST_CASE_TEMPLATE("batch: ranges, as one by one", S, float, double) {
  check_ranges_batch<S, 2>(false);
  check_ranges_batch<S, 3>(false);
}

TEST_CASE_TEMPLATE("batch: gaps, spikes and what is no range, as one by one", S, float, double) {
  check_ranges_batch<S, 2>(true);
  check_ranges_batch<S, 3>(true);
}

TEST_CASE_TEMPLATE("batch: differences, as one by one", S, float, double) {
  for (const bool harsh : {false, true}) {
    check_differences_batch<S, 2>(harsh);
    check_differences_batch<S, 3>(harsh);
  }
}

TEST_CASE_TEMPLATE("batch: spans that do not fit", S, float, double) {
  sim::Random random{"spans"};
  const auto recording = record<S, 3>(random, 6, false);
  std::vector<Result<Fix<S, 3>>> fixes(kEpochs - 1, std::unexpected(Error::NotFinite));
  const std::span<Result<Fix<S, 3>>> out{fixes};
  CHECK(toa_least_squares(recording.batch(), out).error() == Error::InvalidOption);
  CHECK(locate(recording.batch(), out).error() == Error::InvalidOption);
  auto batch = recording.batch();
  batch.sigmas = batch.sigmas.first(5);
  fixes.emplace_back(std::unexpected(Error::NotFinite));
  CHECK(toa_least_squares(batch, std::span<Result<Fix<S, 3>>>{fixes}).error() ==
        Error::InvalidOption);
  LocateOptions<S, 3> options;
  options.side[0] = std::numeric_limits<S>::quiet_NaN();
  CHECK(locate(recording.batch(), std::span<Result<Fix<S, 3>>>{fixes}, options).error() ==
        Error::NotFinite);
  // No epoch at all.
  CHECK(toa_least_squares(RangeBatch<S, 3>{batch.anchors, recording.sigmas, {}},
                          std::span<Result<Fix<S, 3>>>{}) == std::size_t{0});
}

}  // namespace tests::solve_batch
