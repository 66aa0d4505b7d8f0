// SPDX-License-Identifier: MIT
#include <cmath>
#include <string>
#include <string_view>

#include <csv.hpp>
#include <doctest/doctest.h>
#include <failure.hpp>
#include <formats.hpp>

#include "files.hpp"

namespace tests::host_csv {

namespace {

using namespace uwbpos::host;
using uwbpos::test::Files;

Log<Reading> ranges_of(const Files& files, std::string_view content, Problems& problems) {
  return read_ranges(files.write("ranges.csv", content), problems);
}

// Reads a file that cannot be used and returns what is said about it.
template <class Read>
std::string failure_of(const Read& read) {
  try {
    read();
  } catch (const Failure& failure) {
    return failure.what();
  }
  return "no failure";
}

bool contains(std::string_view text, std::string_view part) {
  return text.find(part) != std::string_view::npos;
}

TEST_CASE("Columns are found by name, whatever their order, and unknown ones are ignored") {
  const Files files;
  Problems problems{false, true};
  const auto log = ranges_of(files,
                             "note,range_m,anchor_id,extra,t_s,tag_id,sigma_m\n"
                             "\"a, \"\"quoted\"\" note\",3.25,7,,10.5,2,0.2\n",
                             problems);
  REQUIRE(log.rows.size() == 1);
  const Reading& reading = log.rows[0];
  CHECK(reading.t == 10.5);
  CHECK(reading.tag == 2);
  CHECK(reading.anchor == 7);
  CHECK(reading.range == 3.25);
  CHECK(reading.sigma == 0.2);
  CHECK(problems.total() == 0);
}

TEST_CASE("The tag is 0 where no column names it") {
  const Files files;
  Problems problems{false, true};
  const auto log = ranges_of(files, "t_s,anchor_id,range_m\n1,2,3\n", problems);
  REQUIRE(log.rows.size() == 1);
  CHECK(log.rows[0].tag == 0);
  CHECK_FALSE(log.rows[0].sigma);
}

TEST_CASE("BOM, CRLF, comments, blank lines, blanks and a missing last newline change nothing") {
  const Files files;
  Problems problems{false, true};
  const auto plain = ranges_of(files, "t_s,anchor_id,range_m\n1,2,3\n4,5,6\n", problems);
  const auto odd = ranges_of(files,
                             "\xEF\xBB\xBF# recorded on a Monday\r\n\r\nt_s, anchor_id ,range_m\r\n"
                             "# warm-up, 1, 2\r\n 1,\t2 ,3\r\n   \r\n\"4\",5,6",
                             problems);
  CHECK(problems.total() == 0);
  REQUIRE(plain.rows.size() == 2);
  REQUIRE(odd.rows.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK(odd.rows[i].t == plain.rows[i].t);
    CHECK(odd.rows[i].anchor == plain.rows[i].anchor);
    CHECK(odd.rows[i].range == plain.rows[i].range);
  }
}

TEST_CASE("An empty cell is no reading, not a malformed row") {
  const Files files;
  Problems problems{false, true};
  const auto log =
      ranges_of(files, "t_s,tag_id,anchor_id,range_m,sigma_m\n1,,2,,\n1,,3,4,\n", problems);
  CHECK(problems.total() == 0);
  CHECK(log.counts.rows == 2);
  CHECK(log.counts.no_reading == 1);
  REQUIRE(log.rows.size() == 1);
  CHECK(log.rows[0].tag == 0);
  CHECK_FALSE(log.rows[0].sigma);
}

TEST_CASE("A malformed row is skipped and told with file, line, column and what was expected") {
  struct Case {
    const char* row;
    const char* place;
    const char* said;
  };
  // Columns count bytes of the line from one, as compilers do.
  const Case cases[] = {
      {"1,2,abc", ":2:5:", "range_m: expected a finite number, found \"abc\""},
      {"1,2,nan", ":2:5:", "expected a finite number, found \"nan\""},
      {"inf,2,3", ":2:1:", "t_s: expected a finite number"},
      {"1,2,1e999", ":2:5:", "expected a finite number, found \"1e999\""},
      {"1,2,3m", ":2:5:", "expected a finite number, found \"3m\""},
      {"1,-2,3", ":2:3:", "anchor_id: expected a whole number from 0 to 4294967295"},
      {"1,2.5,3", ":2:3:", "anchor_id: expected a whole number"},
      {"1,4294967296,3", ":2:3:", "anchor_id: expected a whole number"},
      {"1,,3", ":2:3:", "anchor_id: expected a whole number from 0 to 4294967295, found \"\""},
      {",2,3", ":2:1:", "t_s: expected a finite number"},
      {"1,2", ":2:4:", "expected 3 cells as in the header row, found 2"},
      {"1,2,3,4", ":2:7:", "expected 3 cells as in the header row, found 4"},
      {"1,\"2,3", ":2:1:", "quotation mark"},
      {"1,2\"2,3", ":2:1:", "quotation mark"},
      {"\"1,5\",2,x", ":2:1:", "t_s: expected a finite number, found \"1,5\""},
      {"1,\"2\",  x", ":2:9:", "range_m: expected a finite number"},
  };
  for (const Case& c : cases) {
    CAPTURE(c.row);
    const Files files;
    Problems problems{false, true};
    const auto log =
        ranges_of(files, "t_s,anchor_id,range_m\n" + std::string{c.row} + "\n7,8,9\n", problems);
    CHECK(problems.total() == 1);
    REQUIRE(problems.messages().size() == 1);
    CHECK(contains(problems.messages()[0], std::string{"ranges.csv"} + c.place));
    CHECK(contains(problems.messages()[0], c.said));
    // The rows after it are read as if nothing had happened.
    REQUIRE(log.rows.size() == 1);
    CHECK(log.rows[0].range == 9);
  }
}

TEST_CASE("Trailing commas beyond the header are no cells") {
  const Files files;
  Problems problems{false, true};
  const auto log = ranges_of(files, "t_s,anchor_id,range_m\n1,2,3,,\n", problems);
  CHECK(problems.total() == 0);
  CHECK(log.rows.size() == 1);
}

TEST_CASE("A strict run ends at the first malformed row") {
  const Files files;
  Problems problems{true, true};
  const std::string said = failure_of(
      [&] { ranges_of(files, "t_s,anchor_id,range_m\n1,2,3\n1,2,x\n1,2,y\n", problems); });
  CHECK(contains(said, "ranges.csv:3:5: range_m: expected a finite number, found \"x\""));
}

TEST_CASE("Thousands of malformed rows are all counted and a few are told") {
  const Files files;
  Problems problems{false, true};
  std::string content = "t_s,anchor_id,range_m\n";
  for (int i = 0; i < 5000; ++i) content += "1,2,?\n";
  CHECK(ranges_of(files, content, problems).rows.empty());
  CHECK(problems.total() == 5000);
  CHECK(problems.messages().size() == Problems::kToldPerFile);
}

TEST_CASE("A file that cannot be used ends the run and says what was expected") {
  struct Case {
    const char* content;
    const char* said;
  };
  const Case cases[] = {
      {"", "is empty; expected a header row with t_s,anchor_id,range_m"},
      {"# nothing\n\n", "is empty; expected a header row"},
      {"t_s,anchor,range_m\n1,2,3\n", "ranges.csv:1: no column anchor_id; expected a header row"},
      {"# x\nt_s;anchor_id;range_m\n1;2;3\n", "separated by semicolons, expected commas"},
      {"t_s\tanchor_id\trange_m\n", "separated by tabs, expected commas"},
      {"1,2,3\n4,5,6\n", "the first row must name the columns"},
      {"t_s,anchor_id,range_m,range_m\n", "two columns are called range_m"},
      {"\xFF\xFEt\0_\0s\0", "UTF-16"},
      {"t_s,\"anchor_id,range_m\n1,2,3\n", "quotation mark"},
  };
  for (const Case& c : cases) {
    CAPTURE(c.said);
    const Files files;
    Problems problems{false, true};
    CHECK(contains(failure_of([&] { ranges_of(files, c.content, problems); }), c.said));
  }
  const Files files;
  Problems problems{false, true};
  CHECK(contains(failure_of([&] { (void)read_ranges(files.path("absent.csv"), problems); }),
                 "absent.csv: cannot be opened"));
  CHECK(
      contains(failure_of([&] { (void)read_ranges(files.path(""), problems); }), "is a directory"));
}

TEST_CASE("Rows come back by time, however they stood in the file") {
  const Files files;
  Problems problems{false, true};
  const auto log =
      ranges_of(files, "t_s,anchor_id,range_m\n5,1,1\n4.5,2,2\n1,3,3\n5,4,4\n", problems);
  REQUIRE(log.rows.size() == 4);
  // Rows of one time keep the file's order.
  CHECK(log.rows[0].anchor == 3);
  CHECK(log.rows[1].anchor == 2);
  CHECK(log.rows[2].anchor == 1);
  CHECK(log.rows[3].anchor == 4);
  // 4.5 is within the reordering window of a second, 1 is not.
  CHECK(log.counts.out_of_order == 1);
}

TEST_CASE("Raw stamps: two or three messages, and the offset as a fraction") {
  const Files files;
  Problems problems{false, true};
  const auto log =
      read_twr(files.write("twr.csv",
                           "t_s,anchor_id,poll_tx,poll_rx,resp_tx,resp_rx,final_tx,final_rx,"
                           "clock_offset_ppm,true_range_m\n"
                           "1,2,10,20,30,40,50,60,,\n"
                           "2,2,10,20,30,40,,,-2.5,7\n"
                           "3,2,10,,,,,,,\n"
                           "4,2,1099511627776,20,30,40,,,,\n"
                           "5,2,1099511627775,20,30,40,,,,\n"),
               problems);
  CHECK(log.counts.no_reading == 1);
  CHECK(problems.total() == 1);  // 2^40 does not fit a counter of 40 bits
  REQUIRE(log.rows.size() == 3);
  REQUIRE(log.rows[0].final);
  CHECK(log.rows[0].final->second == 60);
  CHECK_FALSE(log.rows[1].final);
  CHECK(*log.rows[1].clock_offset == doctest::Approx(-2.5e-6));
  CHECK(*log.rows[1].true_range == 7);
  CHECK(log.rows[2].poll_tx == 1099511627775u);
}

TEST_CASE("A bias without a tag serves every tag, one with a tag goes before it") {
  const Files files;
  Problems problems{false, true};
  const BiasTable table = read_bias(
      files.write("bias.csv", "anchor_id,bias_m,tag_id\n1,0.1,\n1,0.3,5\n2,0.2,5\n"), problems);
  CHECK(table.find(4, 1) == 0.1);
  CHECK(table.find(5, 1) == 0.3);
  CHECK(table.find(5, 2) == 0.2);
  CHECK_FALSE(table.find(4, 2));
}

TEST_CASE("An anchor that is given twice is told, and its first position stays") {
  const Files files;
  Problems problems{false, true};
  const Points anchors = read_anchors(
      files.write("anchors.csv", "anchor_id,x_m,y_m,z_m\n1,0,0,0\n1,9,9,9\n2,1,1,1\n"), problems);
  CHECK(anchors.size() == 2);
  CHECK(anchors.at(1).x() == 0);
  CHECK(problems.total() == 1);
}

TEST_CASE("Trajectories: comments, CRLF, malformed rows, and no row at all") {
  const Files files;
  Problems problems{false, true};
  const Trajectory truth = read_trajectory(files.write("truth.tum",
                                                       "# t x y z\r\n2 1 0 0 0 0 0 1\r\n\r\n"
                                                       "1 0 0 0 0 0 0 1\n"
                                                       "3 1 2 3\n"
                                                       "4 1 2 x 0 0 0 1\n"
                                                       "5 1 2 3 0 0 0 0\n"),
                                           problems);
  CHECK(problems.total() == 3);
  REQUIRE(truth.poses().size() == 2);
  CHECK(truth.poses()[0].t == 1);
  CHECK(contains(problems.messages()[1], "truth.tum:6:7: expected a finite number"));
  CHECK(contains(failure_of([&] { (void)read_trajectory(files.write("e.tum", "#\n"), problems); }),
                 "holds no pose"));
}

TEST_CASE("Trajectories as far as numbers reach have a pose between any two") {
  const Files files;
  Problems problems{false, true};
  const Trajectory truth = read_trajectory(
      files.write("far.tum", "-1.6e308 -1.6e308 0 1 0 0 0 1\n1.6e308 1.6e308 0 3 0 0 0 1\n"),
      problems);
  const auto at = truth.at(0.8e308);
  REQUIRE(at);
  CHECK(at->position[0] == doctest::Approx(0.8e308));
  CHECK(at->position[2] == doctest::Approx(2.5));
}

TEST_CASE("A clock that was set back is not mended where times would overflow") {
  const Files files;
  Problems problems{false, true};
  std::string rows = "t_s,anchor_id,range_m\n";
  for (int k = 1; k <= 8; ++k) rows += std::to_string(k) + "e307,1,3\n";
  for (int k = 0; k < 32; ++k) rows += std::to_string(150 + k) + "e305,1,3\n";
  const auto mended = read_ranges(files.write("mended.csv", rows), problems);
  CHECK(mended.counts.clock_resets.size() == 1);
  const auto left = read_ranges(files.write("left.csv", rows + "17.5e307,1,3\n"), problems);
  CHECK(left.counts.clock_resets.empty());
  REQUIRE(left.rows.size() == 41);
  CHECK(left.rows.back().t == 17.5e307);
}

}  // namespace

}  // namespace tests::host_csv
