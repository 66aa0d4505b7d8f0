// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What RapidCheck draws for the properties: scenes in whole millimetres, so that they shrink to
/// simple ones and are the same for float and double.

#include <array>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <string>
#include <vector>

namespace uwbpos::test {

/// How the stations of a scene lie. All but the first do not determine a position by themselves.
enum class Shape { General, Ceiling, InLine, OnePoint };

/// Whole millimetres.
struct Place {
  int x, y, z;
};

/// An anchor, or whatever a solver takes many of, and the error of what is measured there.
struct Station {
  Place place;
  int sigma;  ///< [mm]
  int noise;  ///< [σ/1000], |noise| ≤ √3 as uniform noise of unit variance has it
};

/// One scene and one way to move it. Only the first `count` stations are there.
struct Scene {
  std::vector<Station> stations;
  int count;
  Shape shape;
  Place tag;
  int heading;              ///< [mrad]
  std::vector<Place> arms;  ///< of the tags on a body, four
  int tags;                 ///< how many of them are there
  std::array<int, 4> turn;  ///< a quaternion of any length; zero: no turn
  Place shift;              ///< [mm]
  int octaves;              ///< lengths grow by 2^octaves
  int noisier;              ///< sigmas grow by 2^noisier
  int seed;                 ///< of a permutation, of noise
};

std::ostream& operator<<(std::ostream& out, const Scene& scene);

/// Stamps of exchanges, in ticks: intervals that may be, and with `odd` some that may not.
struct Exchange {
  int flight;                        ///< [ticks]
  std::array<int, 2> replies;        ///< of B and of A [1000 ticks]
  std::array<int, 2> rates;          ///< clock errors of A and B [0.1 ppm]
  std::array<int, 6> noise;          ///< on each stamp [ticks]
  int odd;                           ///< 0: none; else which stamp is off by half a second
  std::array<std::uint64_t, 2> now;  ///< where A's and B's counters stand
  int octaves;                       ///< as in `Scene`
  int delay;                         ///< of the antennas [ticks]
};

std::ostream& operator<<(std::ostream& out, const Exchange& exchange);

/// Whether a property holds for one scene; `fault` says why not. Of a scene that is not `decided`
/// it says nothing.
struct Verdict {
  bool decided = true;
  std::string fault = {};
};

/// Runs RapidCheck on a property and reports to doctest: the counterexample, shrunk, and how to run
/// it again. $RC_PARAMS has a say, e.g. `seed=7 max_success=10000`; `share` of that many cases.
void check(const std::string& name, const std::function<Verdict(const Scene&)>& property,
           double share = 1);
/// The same for exchanges.
void check(const std::string& name, const std::function<Verdict(const Exchange&)>& property,
           double share = 1);

}  // namespace uwbpos::test
