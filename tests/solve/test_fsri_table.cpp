// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include "uwbpos/ranging/ultrasonic.hpp"
#include "uwbpos/sim/paper_table.hpp"
#include "uwbpos/solve/fsri.hpp"

namespace tests::solve_fsri_table {

using namespace uwbpos;

namespace {

template <class S>
std::array<S, 3> lengths_of(const sim::PrintedRow& row) {
  std::array<S, 3> lengths;
  for (std::size_t i = 0; i < 3; ++i) lengths[i] = ultrasonic_length<S>(row.counts[i])->value;
  return lengths;
}

// The print has a decimal; a millimetre more for what the authors' arithmetic may have lost.
template <class S>
void check_position(const Vec<S, 2>& position, const sim::PrintedPosition& printed) {
  const Vec<double, 2> cm = 100 * position.template cast<double>();
  CHECK(std::abs(cm.x() - printed.x) < 0.15);
  CHECK(std::abs(cm.y() - printed.y) < 0.15);
  CHECK(std::abs(cm.norm() - printed.length) < 0.15);
}

}  // namespace

TEST_CASE_TEMPLATE("FSRI: the paper's table from its counts, all three methods", S, float, double) {
  const auto receivers = sim::table_receivers<S>();
  const S wavelength = *ultrasonic_wavelength(S(24));
  for (const sim::PrintedRow& row : sim::kPaperTable) {
    CAPTURE(row.counts[0]);
    const std::array<S, 3> lengths = lengths_of<S>(row);
    // Conventional: the two outer receivers, lengths as they are.
    const auto conventional = locate_conventional(std::array{receivers[0], receivers[2]},
                                                  std::array{lengths[0], lengths[2]});
    REQUIRE(conventional);
    check_position(conventional->position, row.conventional);
    const auto difference = locate_time_difference(receivers, lengths);
    REQUIRE(difference);
    check_position(difference->position, row.time_difference);
    const auto shot = fsri(receivers, lengths, {.wavelength = wavelength});
    REQUIRE(shot);
    check_position(shot->position, row.fsri);
    CHECK(std::abs(100 * static_cast<double>(shot->lag) - row.lag) < 0.006);
    CHECK(shot->repair == row.repair);
    CHECK_FALSE(shot->ambiguous);
    CHECK(shot->residual < S(1e-6));
    CHECK(shot->degrees_of_freedom == 0);
  }
}

TEST_CASE("FSRI: only the order of the lengths tells the table's third row") {
  // Taking a wave off the shortest length would bring the lag within bounds as well; a prior at the
  // place that would follow makes it the answer, and says that there is doubt.
  const auto receivers = sim::table_receivers<double>();
  const auto lengths = lengths_of<double>(sim::kPaperTable[2]);
  FsriOptions<double> options;
  options.prior = Vec<double, 2>{0.3008, 1.0624};
  options.prior_sigma = 0.01;
  const auto shot = fsri(receivers, lengths, options);
  REQUIRE(shot);
  CHECK(shot->repair == std::array{0, 0, -1});
  CHECK((shot->position - *options.prior).norm() < 0.001);
}

}  // namespace tests::solve_fsri_table
