// SPDX-License-Identifier: MIT
#include "properties/laws.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>
#include <utility>

#include <doctest/doctest.h>

#include "uwbpos/accuracy/dop.hpp"
#include "uwbpos/core/angle.hpp"

#include "support/nees.hpp"
#include "support/random_geometry.hpp"
#include "support/statistics.hpp"

namespace uwbpos::test {

namespace {

constexpr double kSingle = static_cast<double>(std::numeric_limits<float>::epsilon());
constexpr double kDouble = std::numeric_limits<double>::epsilon();
// Of the four draws that measure the condition the largest is near the root of the sum of squares;
// an adversary among ten measurements or so does three times as much, and the input is rounded some
// times on its way: squares, differences, sums.
constexpr double kRounding = 16;
constexpr int kDraws = 4;
// Normal equations square the condition of a linear system, which here is up to the room's size
// over half a metre, and the second of Chan's steps does not show it.
constexpr double kNormal = 32;
// Worse conditions are not well-posed.
constexpr double kWorst = 100;

/// A similarity, and a factor of the sigmas.
struct Motion {
  Mat<double, 3> turn = Mat<double, 3>::Identity();
  Point shift = Point::Zero();
  double yaw = 0;
  double scale = 1;
  double noise = 1;
};

Motion motion_of(const Scene& scene, Law law, bool planar, bool flat) {
  Motion motion;
  if (law == Law::Rotation && planar) {
    motion.yaw = std::numbers::pi * scene.turn[0] / 100;
    const double c = std::cos(motion.yaw);
    const double s = std::sin(motion.yaw);
    motion.turn << c, -s, 0, s, c, 0, 0, 0, 1;
  } else if (law == Law::Rotation) {
    Vec<double, 4> q{1e-9, 0, 0, 0};
    for (std::size_t i = 0; i < 4; ++i) q[static_cast<int>(i)] += scene.turn[i];
    motion.turn = rotation_matrix<double>(q / q.norm());
  }
  if (law == Law::Translation) {
    motion.shift = Point(scene.shift.x, scene.shift.y, flat ? 0 : scene.shift.z) / 1000;
  }
  if (law == Law::Scale) motion.scale = std::ldexp(1.0, scene.octaves);
  if (law == Law::Noise) motion.noise = std::ldexp(1.0, scene.noisier);
  return motion;
}

void move(Problem& p, const Motion& motion) {
  for (Point& place : p.places) place = motion.scale * (motion.turn * place) + motion.shift;
  for (Mat<double, 3>& turn : p.turns) turn = (motion.turn * turn).eval();
  for (Point& place : p.body) place *= motion.scale;
  if (motion.yaw != 0) {
    for (double& angle : p.angles) angle = wrap_angle(angle + motion.yaw);
  }
  for (double& value : p.values) value *= motion.scale;
  for (double& sigma : p.sigmas) sigma *= motion.scale * motion.noise;
  p.side = (motion.turn * p.side).eval();
  p.tag = motion.scale * (motion.turn * p.tag) + motion.shift;
  p.unit *= motion.scale;
}

void round_to_float(Problem& p) {
  const auto rounded = [](double& x) { x = static_cast<double>(static_cast<float>(x)); };
  for (auto* points : {&p.places, &p.body}) {
    for (Point& point : *points) {
      for (double& x : point.reshaped()) rounded(x);
    }
  }
  for (auto* numbers : {&p.values, &p.sigmas, &p.angles}) {
    for (double& x : *numbers) rounded(x);
  }
}

/// The greatest length in it [m].
double largest(const Problem& p) {
  double most = 0;
  for (const auto* points : {&p.places, &p.body}) {
    for (const Point& point : *points) most = std::max(most, point.norm());
  }
  for (const double value : p.values) most = std::max(most, std::abs(value));
  return most;
}

/// The problem with what was measured off by `size` or so; of one without measurements, places.
Problem disturbed(Problem p, sim::Random& random, double size) {
  for (double& value : p.values) value += random.normal(0, size);
  if (!p.values.empty()) return p;
  for (Point& place : p.places) place += random_normal<double, 3>(random, size);
  return p;
}

Mat<double, 3> expected(const Quantity& q, const Motion& motion) {
  const double factor = std::pow(motion.scale, q.length) * std::pow(motion.noise, q.noise);
  switch (q.kind) {
    case Kind::Place:
      return padded(Point{factor * (motion.turn * q.value.col(0)) + motion.shift});
    case Kind::Vector:
      return factor * (motion.turn * q.value);
    case Kind::Tensor:
      return factor * (motion.turn * q.value * motion.turn.transpose());
    case Kind::Angle:
      return padded(q.value(0, 0) + motion.yaw);
    case Kind::Number:
      break;
  }
  return factor * q.value;
}

double distance(Kind kind, const Mat<double, 3>& a, const Mat<double, 3>& b) {
  if (kind == Kind::Angle) return std::abs(angle_difference(a(0, 0), b(0, 0)));
  return (a - b).cwiseAbs().maxCoeff();
}

std::string told(const Result<Answer>& result) {
  return result ? std::string{"an answer"} : std::string{describe(result.error())};
}

/// Whether a problem lies where a touch makes another error, or an answer, of it.
bool on_an_edge(const Subject& subject, const Problem& p, double touch) {
  sim::Random random{"edges"};
  const Result<Answer> before = subject.precise(p);
  for (int draw = 0; draw < 2 * kDraws; ++draw) {
    const Result<Answer> after = subject.precise(disturbed(p, random, touch));
    if (before.has_value() != after.has_value()) return true;
    if (!before && before.error() != after.error()) return true;
  }
  return false;
}

/// By how much each quantity answers a touch, or nothing where it is not well-posed.
std::optional<std::vector<double>> responses(const Subject& subject, const Problem& p,
                                             double touch) {
  const Result<Answer> base = subject.precise(p);
  if (!base) return std::nullopt;
  sim::Random random{"responses"};
  std::vector<double> most(base->quantities.size(), 0);
  for (int draw = 0; draw < kDraws; ++draw) {
    const Result<Answer> off = subject.precise(disturbed(p, random, touch));
    if (!off || off->quantities.size() != most.size()) return std::nullopt;
    for (std::size_t i = 0; i < most.size(); ++i) {
      const Quantity& q = base->quantities[i];
      const double response = distance(q.kind, q.value, off->quantities[i].value);
      if (q.kind == Kind::Place && response > kWorst * touch) return std::nullopt;
      most[i] = std::max(most[i], response);
    }
  }
  return most;
}

Verdict compare(const Subject& subject, const Problem& p, const Problem& q, const Motion& motion,
                const Answer& before, const Answer& after) {
  if (before.quantities.size() != after.quantities.size()) return {.fault = "another answer"};
  const double length = std::max(largest(p) * motion.scale, largest(q)) * p.squares;
  const double touch = kSingle * length / motion.scale;
  const double epsilon =
      (subject.single ? kSingle : kDouble) * (subject.traits.squared ? kNormal : 1);
  const auto response = responses(subject, p, touch);
  if (!response) return {.decided = false};
  // By powers of two nothing is rounded.
  const bool exact = motion.scale != 1;
  // Weights of squares are those of ranges times 1 + (σ/r)²/2.
  const double second = subject.traits.squared && motion.noise != 1
                            ? p.second * std::max(1.0, motion.noise * motion.noise)
                            : 0;
  for (std::size_t i = 0; i < before.quantities.size(); ++i) {
    const Quantity& a = before.quantities[i];
    const Quantity& b = after.quantities[i];
    const Mat<double, 3> wanted = expected(a, motion);
    const double factor = std::pow(motion.scale, a.length) * std::pow(motion.noise, a.noise);
    const double size = wanted.cwiseAbs().maxCoeff();
    const double tolerance =
        exact ? 0
              : a.slack * factor + b.slack + second * (size + 1) +
                    kRounding * epsilon * (b.condition * size + (*response)[i] * factor / kSingle);
    const double off = distance(a.kind, wanted, b.value);
    if (off <= tolerance) continue;
    std::ostringstream fault;
    fault.precision(12);
    fault << a.name << " is off by " << off << ", tolerance " << tolerance << "\nwanted\n"
          << wanted << "\nfound\n"
          << b.value;
    return {.fault = fault.str()};
  }
  return {};
}

/// A few millimetres of noise, so that second orders do not show.
void quieten(Scene& scene) {
  for (Station& s : scene.stations) s.sigma = 1 + s.sigma / 40;
}

Verdict keeps(const Subject& subject, Scene scene, Law law) {
  const Traits& traits = subject.traits;
  if (law == Law::Noise && traits.gated) scene.noisier = std::abs(scene.noisier);
  // Near the plane of a ceiling the height is known to second order only, which depends on sigma.
  const bool second_order = traits.squared || scene.shape == Shape::Ceiling;
  if (law == Law::Noise && second_order) quieten(scene);
  if (law == Law::Rotation && traits.leaning) {
    for (Station& s : scene.stations) s.noise = 0;
  }
  std::optional<Problem> made = subject.make(scene, subject.dimension);
  if (!made) return {.decided = false};
  Problem& p = *made;
  if (subject.single) round_to_float(p);
  Problem q = p;
  Motion motion;
  if (law == Law::Permutation) {
    sim::Random random{static_cast<std::uint64_t>(scene.seed)};
    shuffle(random, q.order);
  } else {
    motion = motion_of(scene, law, traits.level || subject.dimension == 2, subject.dimension == 2);
    move(q, motion);
    if (subject.single) round_to_float(q);
  }
  const Result<Answer> before = subject.solve(p);
  const Result<Answer> after = subject.solve(q);
  if (before && after) return compare(subject, p, q, motion, *before, *after);
  if (!before && !after && before.error() == after.error()) return {};
  // What is ambiguous, negative or contradictory depends on the noise.
  if (law == Law::Noise) return {.decided = false};
  const double touch = 8 * kSingle * std::max(largest(p), largest(q) / motion.scale) * p.squares;
  if (on_an_edge(subject, p, touch)) return {.decided = false};
  return {.fault = "before: " + told(before) + "; after: " + told(after)};
}

constexpr const char* kNames[] = {"rotation", "translation", "permutation", "scale", "unit noise"};

}  // namespace

void check_laws(const Subject& subject) {
  for (int law = 0; law < 5; ++law) {
    if ((subject.traits.laws >> law & 1U) == 0) continue;
    check(
        subject.name + ": " + kNames[law],
        [&](const Scene& scene) { return keeps(subject, scene, static_cast<Law>(law)); },
        subject.traits.share);
  }
}

std::optional<Problem> make_spanned(const Scene& scene, int dimension, bool biased) {
  auto p = make_stations(scene, dimension, biased);
  if (!p || scene.shape != Shape::General || scene.count <= dimension) return p;
  // The scatter [m²] of places and measurements; what does not count has some.
  Vec<double, 4> middle = Vec<double, 4>::Zero();
  Mat<double, 4> scatter = Mat<double, 4>::Zero();
  for (const bool first : {true, false}) {
    for (std::size_t i = 0; i < p->places.size(); ++i) {
      Vec<double, 4> row;
      row << p->places[i], p->values[i];
      if (first) middle += row / scene.count;
      if (!first) add_outer<double, 4>(scatter, row - middle, 1.0 / scene.count);
    }
  }
  for (const int k : {2, 3}) {
    if (k == 3 ? biased : dimension == 3) continue;
    for (int j = 0; j < 4; ++j) scatter(std::max(j, k), std::min(j, k)) = j == k ? 100 : 0;
  }
  const Ldlt<double, 4> factor{scatter};
  // The least extent squared is more than the inverse's trace, inverted.
  if (!factor.positive_definite() || !(factor.inverse().trace() < 4)) {
    const bool meant = scene.seed % 64 < 4;  // a number that no solver takes
    if (!meant) return std::nullopt;
  }
  return p;
}

void check_honesty(const Subject& subject) {
  constexpr int kTrials = 100;
  double nees = 0;
  double unknowns = 0;
  double chi = 0;
  double freedom = 0;
  const auto property = [&](const Scene& given) -> Verdict {
    Scene scene = given;
    scene.shape = Shape::General;
    scene.seed = 64 * (scene.seed / 64) + 63;  // all of it is as it should be
    quieten(scene);
    sim::Random random{static_cast<std::uint64_t>(scene.seed)};
    double sum = 0;
    std::size_t n = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      for (Station& s : scene.stations)
        s.noise = static_cast<int>(std::lround(1000 * random.normal()));
      std::optional<Problem> p = subject.make(scene, subject.dimension);
      if (!p) return {.decided = false};
      if (subject.single) round_to_float(*p);
      const auto answer = subject.solve(*p);
      if (!answer) {
        if (trial == 0) return {.decided = false};
        if (answer.error() == Error::AmbiguousSolution) return {.decided = false};
        return {.fault = "a draw of noise: " + told(answer)};
      }
      n = answer->error.size();
      sum += quadratic_form(answer->covariance.data(), answer->error.data(), n);
      chi += answer->chi_squared;
      freedom += answer->freedom;
    }
    nees += sum;
    unknowns += kTrials * static_cast<double>(n);
    // Six standard deviations of the mean, and second orders.
    const double mean = sum / kTrials;
    const auto wanted = static_cast<double>(n);
    if (std::abs(mean - wanted) <= 6 * std::sqrt(2 * wanted / kTrials) + 0.05 * wanted) return {};
    return {.fault = "the mean of normalised squared errors is " + std::to_string(mean)};
  };
  check(subject.name + ": normalised errors", property, subject.traits.share);
  // All geometries together: four standard deviations of a mean of χ², and 2 % of second orders.
  const auto judge = [&](const std::string& what, double sum, double wanted) {
    if (wanted == 0) return;
    INFO(subject.name, ": mean of ", what, " over ", wanted, ": ", sum / wanted);
    CHECK(std::abs(sum / wanted - 1) <= 4 * std::sqrt(2 / wanted) + 0.02);
  };
  judge("eᵀ C⁻¹ e", nees, unknowns);
  judge("χ²", chi, freedom);
}

double noise_of(const Scene& scene, std::size_t station, std::size_t which) {
  return scene.stations[(station + 6 * which) % scene.stations.size()].noise / 1000.0;
}

std::optional<Problem> make_stations(const Scene& scene, int dimension, bool biased) {
  Problem p;
  const bool space = dimension == 3;
  const auto metres = [&](const Place& place) -> Point {
    return Point(place.x, place.y, space ? place.z : 0) / 1000;
  };
  p.tag = metres(scene.tag);
  p.flat = scene.shape != Shape::General;
  const Point first = metres(scene.stations[0].place);
  double nearest = std::numeric_limits<double>::infinity();
  std::vector<Vec<double, 3>> solid;
  std::vector<Vec<double, 2>> plane;
  for (std::size_t i = 0; i < static_cast<std::size_t>(scene.count); ++i) {
    const Station& s = scene.stations[i];
    Point place = metres(s.place);
    if (scene.shape == Shape::Ceiling) place[dimension - 1] = space ? 3 : 7;
    if (scene.shape == Shape::InLine) place = {place[0], 1 + place[0] / 2, space ? 3.0 : 0.0};
    if (scene.shape == Shape::OnePoint) place = first;
    const double range = (p.tag - place).norm();
    nearest = std::min(nearest, range);
    // A common bias has one sigma.
    const double sigma = (biased ? scene.stations[0].sigma : s.sigma) / 1000.0;
    const double bias = biased ? scene.heading / 1000.0 : 0;
    p.places.push_back(place);
    p.values.push_back(range + bias + noise_of(scene, i) * sigma);
    p.sigmas.push_back(sigma);
    p.order.push_back(i);
    solid.push_back(place);
    plane.push_back(place.head<2>());
  }
  const double above = p.tag[dimension - 1] - (space ? 3 : 7);
  const double aside = p.tag[1] - 1 - p.tag[0] / 2;
  if (scene.shape == Shape::InLine && !space && std::abs(aside) < 2) return std::nullopt;
  if (scene.shape == Shape::Ceiling) {
    if (std::abs(above) < 0.5) return std::nullopt;
    // Or else nobody knows.
    if (scene.seed % 4 != 0) p.side[dimension - 1] = above;
  }
  // In line and in one point there is none; whether it is a line must not depend on noise.
  double apart = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < p.places.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) apart = std::min(apart, (p.places[i] - p.places[j]).norm());
  }
  if (scene.shape == Shape::InLine && apart < 0.3) return std::nullopt;
  const auto dop = [&](const auto& anchors, const auto& at) {
    return biased ? pseudorange_dop(anchors, at) : range_dop(anchors, at);
  };
  const auto seen = space ? dop(solid, p.tag) : dop(plane, Vec<double, 2>{p.tag.head<2>()});
  const bool hopeless = scene.shape == Shape::InLine || scene.shape == Shape::OnePoint;
  if (seen && !hopeless && !(seen->gdop < 10)) return std::nullopt;
  if (!seen && !hopeless && seen.error() != Error::TooFewMeasurements) return std::nullopt;
  if (nearest < 0.5) return std::nullopt;
  p.second = std::pow(*std::ranges::max_element(p.sigmas) / nearest, 2);
  p.squares = std::max(1.0, largest(p) / nearest);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  switch (scene.seed % 64) {
    case 0:
      p.values[0] = -5;
      break;
    case 1:
      p.values[0] = kNan;
      break;
    case 2:
      p.sigmas[0] = 0;
      break;
    case 3:
      p.places[0][0] = std::numeric_limits<double>::infinity();
      break;
    default:
      break;
  }
  return p;
}

}  // namespace uwbpos::test
