// SPDX-License-Identifier: MIT
// The only unit that sees RapidCheck, which takes seconds to compile.
#include <cstdlib>
#include <ostream>
#include <sstream>

#include <doctest/doctest.h>
#include <rapidcheck.h>
#include <rapidcheck/detail/TestListenerAdapter.h>

#include "properties/scene.hpp"

namespace uwbpos::test {

namespace {

/// From `low` to `high` whatever RapidCheck's notion of size; shrinks towards `low`.
rc::Gen<int> between(int low, int high) {
  return rc::gen::resize(rc::kNominalSize, rc::gen::inRange(low, high + 1));
}

/// From −most to most; shrinks towards zero.
rc::Gen<int> around(int most) {
  return rc::gen::map(between(0, 2 * most),
                      [](int k) { return k % 2 == 0 ? k / 2 : -(k + 1) / 2; });
}

rc::Gen<Place> place_in(const rc::Gen<int>& x, const rc::Gen<int>& y, const rc::Gen<int>& z) {
  return rc::gen::build<Place>(rc::gen::set(&Place::x, x), rc::gen::set(&Place::y, y),
                               rc::gen::set(&Place::z, z));
}

rc::Gen<Shape> shapes() {
  return rc::gen::weightedElement<Shape>(
      {{5, Shape::General}, {2, Shape::Ceiling}, {1, Shape::InLine}, {1, Shape::OnePoint}});
}

// A room of 20 m × 15 m × 6 m; tags up to 2 m outside it.
rc::Gen<Scene> scenes() {
  const auto stations = rc::gen::build<Station>(
      rc::gen::set(&Station::place,
                   place_in(between(0, 20'000), between(0, 15'000), between(0, 6'000))),
      rc::gen::set(&Station::sigma, between(20, 200)), rc::gen::set(&Station::noise, around(1732)));
  const auto arm = place_in(around(400), around(400), around(400));
  return rc::gen::build<Scene>(
      rc::gen::set(&Scene::stations, rc::gen::container<std::vector<Station>>(12, stations)),
      rc::gen::set(&Scene::count, between(1, 12)), rc::gen::set(&Scene::shape, shapes()),
      rc::gen::set(&Scene::tag, place_in(between(-2'000, 22'000), between(-2'000, 17'000),
                                         between(-2'000, 5'000))),
      rc::gen::set(&Scene::heading, around(3141)),
      rc::gen::set(&Scene::arms, rc::gen::container<std::vector<Place>>(4, arm)),
      rc::gen::set(&Scene::tags, between(2, 4)),
      rc::gen::set(&Scene::turn, rc::gen::container<std::array<int, 4>>(around(100))),
      rc::gen::set(&Scene::shift, place_in(around(30'000), around(30'000), around(30'000))),
      rc::gen::set(&Scene::octaves, around(6)), rc::gen::set(&Scene::noisier, around(3)),
      rc::gen::set(&Scene::seed, between(0, 1'000'000)));
}

// 0 … 200 m, replies of 0.2 … 4 ms.
rc::Gen<Exchange> exchanges() {
  const auto counter = rc::gen::map(
      rc::gen::container<std::array<int, 2>>(between(0, (1 << 20) - 1)),
      [](std::array<int, 2> halves) {
        return static_cast<std::uint64_t>(halves[0]) << 20 | static_cast<std::uint64_t>(halves[1]);
      });
  return rc::gen::build<Exchange>(
      rc::gen::set(&Exchange::flight, between(0, 42'000)),
      rc::gen::set(&Exchange::replies,
                   rc::gen::container<std::array<int, 2>>(between(12'000, 250'000))),
      rc::gen::set(&Exchange::rates, rc::gen::container<std::array<int, 2>>(around(200))),
      rc::gen::set(&Exchange::noise, rc::gen::container<std::array<int, 6>>(around(20))),
      rc::gen::set(&Exchange::odd,
                   rc::gen::weightedOneOf<int>({{3, rc::gen::just(0)}, {1, between(0, 6)}})),
      rc::gen::set(&Exchange::now, rc::gen::container<std::array<std::uint64_t, 2>>(counter)),
      rc::gen::set(&Exchange::octaves, around(3)), rc::gen::set(&Exchange::delay, around(2'000)));
}

template <class T>
void run(const std::string& name, const rc::Gen<T>& drawn,
         const std::function<Verdict(const T&)>& property, double share) {
  // The same in every run, unless somebody asks for others.
  setenv("RC_PARAMS", "seed=1", 0);
  rc::detail::TestMetadata metadata;
  metadata.id = name;
  metadata.description = name;
  const auto& configured = rc::detail::configuration();
  rc::detail::TestParams params = configured.testParams;
  params.maxSuccess = 1 + static_cast<int>(share * (params.maxSuccess - 1));
  params.maxDiscardRatio = 100;
  rc::detail::TestListenerAdapter silent;
  const auto result = rc::detail::checkProperty(rc::detail::toProperty([&] {
                                                  const T scene = *drawn;
                                                  const Verdict verdict = property(scene);
                                                  if (!verdict.decided) RC_DISCARD("says nothing");
                                                  if (!verdict.fault.empty())
                                                    RC_FAIL(verdict.fault);
                                                }),
                                                metadata, params, silent, configured.reproduce);
  if (result.template is<rc::detail::SuccessResult>()) {
    CHECK(result.template get<rc::detail::SuccessResult>().numSuccess > 0);
    return;
  }
  std::ostringstream told;
  rc::detail::printResultMessage(result, told);
  if (result.template is<rc::detail::FailureResult>()) {
    rc::detail::Configuration again;
    again.reproduce.emplace(name, result.template get<rc::detail::FailureResult>().reproduce);
    told << "\nAgain: RC_PARAMS='" << rc::detail::configToMinimalString(again) << "'";
  }
  FAIL_CHECK(name << ": " << told.str());
}

std::ostream& operator<<(std::ostream& out, const Place& p) {
  return out << '(' << p.x << ", " << p.y << ", " << p.z << ')';
}

}  // namespace

std::ostream& operator<<(std::ostream& out, const Scene& scene) {
  static constexpr const char* kNames[] = {"general", "a ceiling", "in line", "one point"};
  out << kNames[static_cast<int>(scene.shape)] << ", tag " << scene.tag << " mm, heading "
      << scene.heading << " mrad, seed " << scene.seed << '\n';
  for (std::size_t i = 0; i < static_cast<std::size_t>(scene.count); ++i) {
    const Station& s = scene.stations[i];
    out << "  station " << s.place << " mm, sigma " << s.sigma << " mm, noise " << s.noise
        << "/1000\n";
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(scene.tags); ++i) {
    out << "  arm " << scene.arms[i] << " mm\n";
  }
  return out << "  turn " << scene.turn[0] << ' ' << scene.turn[1] << ' ' << scene.turn[2] << ' '
             << scene.turn[3] << ", shift " << scene.shift << " mm, lengths × 2^" << scene.octaves
             << ", sigmas × 2^" << scene.noisier;
}

std::ostream& operator<<(std::ostream& out, const Exchange& e) {
  out << "flight " << e.flight << ", replies of B " << e.replies[0] << "000 and of A "
      << e.replies[1] << "000 ticks, clocks " << e.rates[0] << " and " << e.rates[1]
      << " tenths of ppm, counters " << e.now[0] << " and " << e.now[1] << ", odd stamp " << e.odd
      << ", delay " << e.delay << ", × 2^" << e.octaves << ", noise";
  for (const int noise : e.noise) out << ' ' << noise;
  return out;
}

void check(const std::string& name, const std::function<Verdict(const Scene&)>& property,
           double share) {
  run<Scene>(name, scenes(), property, share);
}

void check(const std::string& name, const std::function<Verdict(const Exchange&)>& property,
           double share) {
  run<Exchange>(name, exchanges(), property, share);
}

}  // namespace uwbpos::test
