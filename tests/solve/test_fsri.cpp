// SPDX-License-Identifier: MIT
#include <limits>
#include <vector>

#include <doctest/doctest.h>

#include "uwbpos/sim/ultrasonic.hpp"
#include "uwbpos/solve/fsri.hpp"

#include "support/random_geometry.hpp"

namespace tests::solve_fsri {

using namespace uwbpos;

namespace {

template <class S>
constexpr S kWave = S(sim::kPaperWave);

template <class S, int D, std::size_t N>
std::array<S, N> late(const std::array<Vec<S, D>, N>& receivers, const Vec<S, D>& emitter, S lag,
                      const std::array<int, N>& waves) {
  std::array<S, N> lengths;
  for (std::size_t i = 0; i < N; ++i) {
    const Vec<S, D> offset = emitter - receivers[i];
    lengths[i] = norm(offset) + lag + kWave<S> * static_cast<S>(waves[i]);
  }
  return lengths;
}

// A float knows these lengths to 1e-7 m; the dilution of these places makes up to 1e2 of that.
template <class S>
constexpr S kExact = sizeof(S) == 4 ? S(2e-5) : S(1e-11);

template <class S>
std::array<Vec<S, 2>, 3> bar() {
  return {Vec<S, 2>{S(-0.4), 0}, Vec<S, 2>{0, 0}, Vec<S, 2>{S(0.4), 0}};
}

template <class S>
std::array<Vec<S, 3>, 4> plate() {
  return {Vec<S, 3>{S(-0.2), S(-0.2), 0}, Vec<S, 3>{S(0.2), S(-0.2), 0},
          Vec<S, 3>{S(0.2), S(0.2), 0}, Vec<S, 3>{S(-0.2), S(0.2), 0}};
}

template <class S>
std::array<Vec<S, 3>, 6> cage() {
  return {Vec<S, 3>{0, 0, 0},           Vec<S, 3>{S(0.8), 0, S(0.1)},
          Vec<S, 3>{0, S(0.7), 0},      Vec<S, 3>{S(0.9), S(0.6), S(0.8)},
          Vec<S, 3>{0, S(0.1), S(0.7)}, Vec<S, 3>{S(0.3), S(0.9), S(0.5)}};
}

}  // namespace

TEST_CASE_TEMPLATE("FSRI: exact lengths give the exact position at every lag, bounds included", S,
                   float, double) {
  sim::Random random{"exact shots"};
  for (int wave = 0; wave <= 5; ++wave) {
    const S lag = kWave<S> * static_cast<S>(wave);
    CAPTURE(wave);
    for (int trial = 0; trial < 50; ++trial) {
      const Vec<S, 2> flat = test::random_in_box<S, 2>(random, {S(-0.6), S(0.3)}, {S(0.6), 1});
      const auto in_line =
          fsri(bar<S>(), late<S, 2, 3>(bar<S>(), flat, lag, {}), {.wavelength = kWave<S>});
      REQUIRE(in_line);
      CHECK((in_line->position - flat).norm() < kExact<S>);
      CHECK(std::abs(in_line->lag - lag) < kExact<S>);
      CHECK(in_line->repair == std::array<int, 3>{});
      CHECK(in_line->residual < kExact<S>);

      const Vec<S, 3> up =
          test::random_in_box<S, 3>(random, {S(-0.3), S(-0.3), S(0.2)}, {S(0.3), S(0.3), S(0.6)});
      const auto in_plane =
          fsri(plate<S>(), late<S, 3, 4>(plate<S>(), up, lag, {}), {.wavelength = kWave<S>});
      if (in_plane || up.template head<2>().cwiseAbs().minCoeff() > S(0.05)) {
        REQUIRE(in_plane);
        CHECK((in_plane->position - up).norm() < S(30) * kExact<S>);
      }
      const Vec<S, 3> inside = test::random_in_cube<S, 3>(random, S(1)) + cage<S>()[3];
      const auto general =
          fsri(cage<S>(), late<S, 3, 6>(cage<S>(), inside, lag, {}), {.wavelength = kWave<S>});
      REQUIRE(general);
      CHECK((general->position - inside).norm() < S(10) * kExact<S>);
      CHECK(general->degrees_of_freedom == 2);
      CHECK_FALSE(general->ambiguous);
    }
  }
}

TEST_CASE_TEMPLATE("FSRI: redundant receivers' waves are found, in whatever order", S, float,
                   double) {
  sim::Random random{"redundant waves"};
  int unsure = 0;
  int wrong = 0;
  constexpr int kTrials = 100;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Vec<S, 3> emitter = test::random_in_cube<S, 3>(random, S(0.5)) + cage<S>()[3];
    std::array<int, 6> waves{};
    for (int& w : waves) w = random.chance(0.3) ? random.integer(1, 2) : 0;
    const S lag = kWave<S> * S(random.uniform(0, 3));
    const auto lengths = late<S, 3, 6>(cage<S>(), emitter, lag, waves);
    const auto shot = fsri(cage<S>(), lengths, {.wavelength = kWave<S>});
    REQUIRE(shot);
    const bool right = (shot->position - emitter).norm() < S(10) * kExact<S>;
    unsure += shot->ambiguous ? 1 : 0;
    wrong += right || shot->ambiguous ? 0 : 1;
    if (!right) continue;
    for (std::size_t i = 1; i < 6; ++i) {
      CHECK(shot->repair[i] - shot->repair[0] == waves[0] - waves[i]);
    }
    // Whatever wave is common to all, lag and repair tell it apart consistently.
    CHECK(std::abs(shot->lag - (lag + kWave<S> * static_cast<S>(waves[0] + shot->repair[0]))) <
          S(10) * kExact<S>);
  }
  CHECK(unsure < kTrials / 10);
  // These waves are ten times as common as `kWaveCost` has it, so now and then fewer waves and a
  // residual of a few sigma look likelier.
  CHECK(wrong <= kTrials / 50);
}

TEST_CASE_TEMPLATE("FSRI: a mirror image is told by side, by prior, or is the upper one", S, float,
                   double) {
  const Vec<S, 2> above{S(0.3), S(0.9)};
  const Vec<S, 2> below{S(0.3), S(-0.9)};
  const auto lengths = late<S, 2, 3>(bar<S>(), above, S(0.01), {});
  FsriOptions<S> options{.wavelength = kWave<S>};
  const auto where = [&] { return fsri(bar<S>(), lengths, options)->position; };
  CHECK((where() - above).norm() < kExact<S>);
  options.side = {0, -1};
  CHECK((where() - below).norm() < kExact<S>);
  options.prior = Vec<S, 2>{S(0.3), S(0.5)};
  CHECK((where() - below).norm() < kExact<S>);  // the side decides
  options.side.setZero();
  CHECK((where() - above).norm() < kExact<S>);
  options.prior = Vec<S, 2>{S(0.3), S(-0.5)};
  CHECK((where() - below).norm() < kExact<S>);
  // A bar along y has no upper side: the emitter is at greater x.
  std::array<Vec<S, 2>, 3> upright;
  for (std::size_t i = 0; i < 3; ++i) upright[i] = {0, bar<S>()[i].x()};
  const Vec<S, 2> right{S(0.9), S(0.3)};
  const auto beside = fsri(upright, lengths, {.wavelength = kWave<S>});
  REQUIRE(beside);
  CHECK((beside->position - right).norm() < kExact<S>);
  // And a plate on a ceiling looks down.
  const Vec<S, 3> under{S(0.15), S(0.1), S(-0.5)};
  const auto down = fsri(plate<S>(), late<S, 3, 4>(plate<S>(), under, S(0.01), {}),
                         {.wavelength = kWave<S>, .side = {0, 0, -1}});
  REQUIRE(down);
  CHECK((down->position - under).norm() < S(30) * kExact<S>);
}

TEST_CASE_TEMPLATE("FSRI: arrays, vectors and spans; what a prior settles is no longer ambiguous",
                   S, float, double) {
  const std::array<Vec<S, 2>, 4> receivers{Vec<S, 2>{0, 0}, Vec<S, 2>{S(0.8), 0},
                                           Vec<S, 2>{S(0.8), S(0.8)}, Vec<S, 2>{0, S(0.8)}};
  const Vec<S, 2> emitter{S(1.7), S(1.6)};
  const auto lengths = late<S, 2, 4>(receivers, emitter, S(0.012), {1, 0, 0, 0});
  const auto shot = fsri(receivers, lengths, {.wavelength = kWave<S>});
  REQUIRE(shot);
  static_assert(std::is_same_v<decltype(shot->repair), std::array<int, 4>>);
  const std::vector<Vec<S, 2>> points(receivers.begin(), receivers.end());
  const std::vector<S> values(lengths.begin(), lengths.end());
  const auto same = fsri(points, values, {.wavelength = kWave<S>});
  REQUIRE(same);
  CHECK(same->position == shot->position);
  CHECK(same->repair[0] == shot->repair[0]);
  CHECK(same->repair[15] == 0);

  // Without redundancy a wave off the longest and one on the shortest turn the answer about the
  // bar: the lag barely tells. A prior does.
  const Vec<S, 2> place{S(0.35), S(0.85)};
  const auto three = late<S, 2, 3>(bar<S>(), place, S(1.5) * kWave<S>, {1, 0, 0});
  FsriOptions<S> options{.wavelength = kWave<S>};
  options.prior = place;
  options.prior_sigma = S(0.005);
  const auto known = fsri(bar<S>(), three, options);
  REQUIRE(known);
  CHECK((known->position - place).norm() < kExact<S>);
  CHECK(known->repair == std::array{-1, 0, 0});
  CHECK_FALSE(known->ambiguous);
  options.prior_sigma = S(1);
  const auto vague = fsri(bar<S>(), three, options);
  REQUIRE(vague);
  CHECK(vague->ambiguous);
  CHECK((vague->alternative - vague->position).norm() > S(0.01));
}

TEST_CASE_TEMPLATE("FSRI: what cannot be is refused by name", S, float, double) {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  const Vec<S, 2> emitter{S(0.3), S(0.9)};
  const auto good = late<S, 2, 3>(bar<S>(), emitter, S(0.01), {});
  const FsriOptions<S> plain{.wavelength = kWave<S>};
  REQUIRE(fsri(bar<S>(), good, plain));
  const auto with_length = [&](S value) {
    auto lengths = good;
    lengths[1] = value;
    return fsri(bar<S>(), lengths, plain).error();
  };
  CHECK(with_length(nan) == Error::NotFinite);
  CHECK(with_length(std::numeric_limits<S>::infinity()) == Error::NotFinite);
  CHECK(with_length(S(0)) == Error::NegativeRange);
  CHECK(with_length(S(-1)) == Error::NegativeRange);
  // Longer by more than the receivers are apart and all waves together.
  CHECK(with_length(S(2)) == Error::InconsistentRanges);
  // Shorter than the lag that the others have: the sound would arrive before it was sent.
  CHECK_FALSE(fsri(bar<S>(), std::array<S, 3>{S(0.01), S(0.01), S(0.01)}, plain));
  CHECK_FALSE(fsri(bar<S>(), std::array<S, 3>{S(0.43), S(0.43), S(0.01)}, plain));
  // Five waves late when two may be taken off, at most, from each.
  auto waves = late<S, 2, 3>(bar<S>(), emitter, S(0.01), {5, 0, 0});
  CHECK(fsri(bar<S>(), waves, plain).error() == Error::NoRepairFits);
  waves = late<S, 2, 3>(bar<S>(), emitter, S(0.01), {0, 1, 0});
  auto none = plain;
  none.max_repair = 0;
  CHECK(fsri(bar<S>(), waves, none).error() == Error::NoRepairFits);
  // A lag beyond its bound.
  const auto slow = late<S, 2, 3>(bar<S>(), emitter, S(9) * kWave<S>, {});
  CHECK(fsri(bar<S>(), slow, none).error() == Error::NoRepairFits);
  CHECK(fsri(bar<S>(), slow, {.wavelength = kWave<S>, .max_lag = S(0.08)}));

  auto receivers = bar<S>();
  receivers[2] = receivers[0];
  CHECK(fsri(receivers, good, plain).error() == Error::DegenerateGeometry);
  receivers = bar<S>();
  receivers[1].x() = nan;
  CHECK(fsri(receivers, good, plain).error() == Error::NotFinite);
  const std::array<Vec<S, 3>, 4> pole{Vec<S, 3>{0, 0, 0}, Vec<S, 3>{0, 0, 1}, Vec<S, 3>{0, 0, 2},
                                      Vec<S, 3>{0, 0, 3}};
  CHECK(fsri(pole, std::array<S, 4>{1, 1, 2, 3}, {.wavelength = kWave<S>}).error() ==
        Error::DegenerateGeometry);
  // On the line of the bar no length depends on the side.
  CHECK_FALSE(fsri(bar<S>(), late<S, 2, 3>(bar<S>(), {S(1.5), 0}, S(0.01), {}), plain));
  const std::vector<Vec<S, 2>> two{bar<S>()[0], bar<S>()[1]};
  CHECK(fsri(two, std::vector<S>{1, 1}).error() == Error::TooFewMeasurements);
  CHECK(fsri(bar<S>(), std::vector<S>{1, 1}).error() == Error::TooFewMeasurements);
  const std::vector<Vec<S, 2>> many(17, Vec<S, 2>::Zero());
  CHECK(fsri(many, std::vector<S>(17, S(1))).error() == Error::TooManyMeasurements);

  const auto with = [&](auto change) {
    FsriOptions<S> options = plain;
    change(options);
    return fsri(bar<S>(), good, options).error();
  };
  CHECK(with([&](auto& o) { o.wavelength = nan; }) == Error::NotFinite);
  CHECK(with([&](auto& o) { o.max_lag = nan; }) == Error::NotFinite);
  CHECK(with([&](auto& o) { o.prior = Vec<S, 2>{nan, 0}; }) == Error::NotFinite);
  CHECK(with([&](auto& o) { o.side[0] = nan; }) == Error::NotFinite);
  CHECK(with([](auto& o) { o.wavelength = 0; }) == Error::InvalidOption);
  CHECK(with([](auto& o) { o.max_lag = S(-1); }) == Error::InvalidOption);
  CHECK(with([](auto& o) { o.max_repair = -1; }) == Error::InvalidOption);
  CHECK(with([](auto& o) { o.max_repair = 9; }) == Error::InvalidOption);
  CHECK(with([](auto& o) { o.prior_sigma = 0; }) == Error::InvalidOption);
  CHECK(with([](auto& o) { o.sigma = S(0); }) == Error::NonPositiveSigma);

  CHECK(locate_conventional(bar<S>(), good, nan).error() == Error::NotFinite);
  CHECK(locate_conventional(bar<S>(), good, S(3)).error() == Error::NegativeRange);
  CHECK(locate_time_difference(receivers, good).error() == Error::NotFinite);
}

}  // namespace tests::solve_fsri
