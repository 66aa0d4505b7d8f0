// SPDX-License-Identifier: MIT
#include <cstdlib>
#include <new>

#include <doctest/doctest.h>

#include "uwbpos/accuracy/dop.hpp"
#include "uwbpos/filter/motion/inertial.hpp"
#include "uwbpos/filter/tracker.hpp"
#include "uwbpos/pose/target.hpp"
#include "uwbpos/pose/twist.hpp"
#include "uwbpos/pose/two_tag.hpp"
#include "uwbpos/solve/bancroft.hpp"
#include "uwbpos/solve/exclude_outliers.hpp"
#include "uwbpos/solve/fsri.hpp"
#include "uwbpos/solve/locate.hpp"
#include "uwbpos/solve/pose_from_ranges.hpp"
#include "uwbpos/solve/tdoa_chan.hpp"
#include "uwbpos/solve/tdoa_fang.hpp"
#include "uwbpos/solve/toa_chan.hpp"
#include "uwbpos/solve/toa_linear.hpp"
#include "uwbpos/solve/toa_refine.hpp"

#include "filter/flights.hpp"
#include "pose/scenes.hpp"
#include "solve/difference_rooms.hpp"

namespace {

std::size_t allocations = 0;

void* counted(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size > 0 ? size : 1)) return memory;
  std::abort();
}

}  // namespace

// Replaced for the whole binary; they count and otherwise do what the library's do.
void* operator new(std::size_t size) { return counted(size); }
void* operator new[](std::size_t size) { return counted(size); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }

namespace tests::solve_no_heap {

using namespace uwbpos;

TEST_CASE_TEMPLATE("no solver and no bound touches the heap", S, float, double) {
  sim::Random random{"no heap"};
  const auto room = test::random_room<S, 3>(random, 8, 8);
  const auto hall = test::random_room<S, 3>(random, 8, 8, true);
  const auto plane = test::random_room<S, 2>(random, 5, 5);
  std::vector<Vec<S, 3>> anchors;
  for (const auto& r : room.ranges) anchors.push_back(r.anchor);
  const auto heard = test::differences_between<S, 3>(room.tag, anchors);
  auto fewest = heard.differences;
  fewest.resize(3);
  std::vector<PairDifference<S, 3>> pairs;
  for (std::size_t i = 1; i < anchors.size(); ++i) {
    const auto& a = anchors[i - 1];
    pairs.push_back({a, anchors[i], test::true_difference<S, 3>(room.tag, a, anchors[i])});
  }

  const std::array<Vec<S, 2>, 4> receivers{Vec<S, 2>{0, 0}, Vec<S, 2>{S(0.8), 0},
                                           Vec<S, 2>{S(0.8), S(0.8)}, Vec<S, 2>{0, S(0.8)}};
  const Vec<S, 2> emitter{S(0.9), S(1.3)};
  std::array<S, 4> lengths;
  for (std::size_t i = 0; i < 4; ++i) lengths[i] = (emitter - receivers[i]).norm() + S(0.02);
  lengths[1] += FsriOptions<S>{}.wavelength;

  const auto body = test::random_scene<S, 3>(random, 6, 6);
  const Fix<S, 2> left{{0, S(0.3)}, Mat<S, 2>::Identity() * S(1e-4), S(0), 0};
  const Fix<S, 2> right{{0, S(-0.3)}, left.covariance, S(0), 0};

  const std::size_t before = allocations;
  int solved = 0;
  solved += locate(room.ranges) ? 1 : 0;
  solved += locate(hall.ranges, {.side = {0, 0, -1}}) ? 1 : 0;
  solved += locate(plane.ranges) ? 1 : 0;
  solved += toa_linear(room.ranges) ? 1 : 0;
  solved += toa_chan(room.ranges) ? 1 : 0;
  solved += toa_closed_form(room.ranges) ? 1 : 0;
  solved += toa_least_squares(room.ranges) ? 1 : 0;
  solved += toa_refine(room.ranges, room.tag) ? 1 : 0;
  solved += range_dop(anchors, room.tag) ? 1 : 0;
  solved += cramer_rao_bound(room.ranges, room.tag) ? 1 : 0;
  solved += locate(heard.reference, heard.differences, S(0.1)) ? 1 : 0;
  solved += tdoa_chan(heard.reference, heard.differences, S(0.1)) ? 1 : 0;
  solved += tdoa_fang(heard.reference, fewest) ? 1 : 0;
  solved += bancroft(room.ranges) ? 1 : 0;
  solved += locate_with_bias(room.ranges) ? 1 : 0;
  solved += locate(pairs) ? 1 : 0;
  solved += locate_excluding(room.ranges) ? 1 : 0;
  solved += fsri(receivers, lengths) ? 1 : 0;
  solved += locate_conventional(receivers, lengths, S(0.02)) ? 1 : 0;
  solved += locate_time_difference(receivers, lengths) ? 1 : 0;
  solved += pose_from_ranges(body.ranges) ? 1 : 0;
  solved += pose_from_ranges(body.ranges, {.robust = {Loss::Cauchy}}) ? 1 : 0;
  solved += pose_bound(body.ranges, body.position, body.heading) ? 1 : 0;
  const auto pose = two_tag_pose(left, right, S(0.6));
  solved += pose ? 1 : 0;
  solved += twist_between(*pose, *pose, S(1)) ? 1 : 0;
  solved += bearing_to(*pose, Vec<S, 2>{8, 8}) ? 1 : 0;
  const std::size_t after = allocations;
  CHECK(solved == 26);
  CHECK(after == before);

  // The count does count. (A new expression may be optimised away, a call may not.)
  void* const probe = ::operator new(sizeof(int));
  CHECK(allocations == after + 1);
  ::operator delete(probe);
}

TEST_CASE("no tracker touches the heap, however its measurements come") {
  sim::Random random{"no heap in flight"};
  const test::Course course{0};
  const test::CourseImu imu{.course = course};
  TrackerOptions<Inertial<float>> options;
  options.heading = Measured<float>{static_cast<float>(course.heading(0)), 0.01f};
  Tracker<Inertial<float>> tracker{options};
  test::hang_anchors(tracker);
  const std::size_t before = allocations;
  int used = 0;
  const auto count = [&](auto, const auto& told) { used += told ? 1 : 0; };
  for (std::int64_t time = 0; time < 2'000'000; time += test::kSlot) {
    const Vec<double, 3> place = course.position(1e-6 * static_cast<double>(time));
    static_cast<void>(tracker.update(imu.sample<float>(time, random)));
    test::measure(test::Radio::SharedDifferences, time, place, 0.1, 0.1, random, tracker,
                  test::unspoiled, count);
    // Each range is told 30 ms late, and once more a second late: outside the window.
    const std::int64_t late = time - 30'000;
    if (late < 0) continue;
    const Vec<double, 3> was = course.position(1e-6 * static_cast<double>(late));
    test::measure(test::Radio::Ranges, late, was, 0.1, 0.1, random, tracker, test::unspoiled,
                  count);
    if (time % 100'000 == 0)
      static_cast<void>(tracker.update(TimedRange<float>{time - 1'000'000, 0, 3.0f}));
    used += tracker.pose() ? 1 : 0;
  }
  CHECK(used > 400);
  CHECK(allocations == before);
}

}  // namespace tests::solve_no_heap
