// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// The laws that every solver keeps: what is done to a problem is done to its answer, and to
/// nothing else; a problem without an answer keeps its error. Everything here is in double and
/// compiled once; only the adapters of the test files know scalars and dimensions.
///
/// **Tolerance.** Two ways of rounding end within ε · L · κ of each other, for lengths up to L and
/// an answer of condition κ. κ is measured: the same problem is solved in double with its
/// measurements moved by some ten thousandths of a millimetre, so a solver in float cannot excuse
/// its own noise. What an iteration leaves undone comes on top as `slack`.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "uwbpos/core/result.hpp"
#include "uwbpos/core/types.hpp"

#include "properties/scene.hpp"

namespace uwbpos::test {

using Point = Vec<double, 3>;

/// What a solver is given, in metres.
struct Problem {
  std::vector<Point> places;          ///< of stations
  std::vector<Mat<double, 3>> turns;  ///< axes of frames
  std::vector<Point> body;            ///< places in a frame of their own
  std::vector<double> angles;         ///< headings
  std::vector<double> values;         ///< what was measured
  std::vector<double> sigmas;         ///< of it
  std::vector<std::size_t> order;     ///< in which the measurements come
  Point tag = Point::Zero();          ///< the truth
  Point side = Point::Zero();         ///< a direction that is known
  bool flat = false;                  ///< the stations do not span the space
  double unit = 1;                    ///< what an option of one metre is now
  double squares = 1;                 ///< rounding of squared lengths over lengths
  double second = 0;                  ///< (σ/r)² of the nearest: what squares leave out
};

/// How a quantity follows a motion: a place, what turns as a vector or on both sides, a number, an
/// angle that turns with the scene.
enum class Kind { Place, Vector, Tensor, Number, Angle };

/// One part of an answer.
struct Quantity {
  const char* name;
  Kind kind;
  int length;            ///< it grows with this power of the lengths
  int noise;             ///< and with this one of the sigmas alone
  Mat<double, 3> value;  ///< the first column, or element, of what is less
  double slack = 0;      ///< what the iteration may leave undone
  double condition = 1;  ///< how much of ε its own arithmetic may cost, over its size
};

/// What came out.
struct Answer {
  std::vector<Quantity> quantities;
  std::vector<double> error;       ///< against the truth, where there is one
  std::vector<double> covariance;  ///< of it, dense
  double chi_squared = 0;
  int freedom = 0;
};

enum class Law { Rotation, Translation, Permutation, Scale, Noise };
inline constexpr unsigned kAllLaws = 31;
/// All laws but one.
constexpr unsigned but(Law law, unsigned laws = kAllLaws) {
  return laws & ~(1U << static_cast<unsigned>(law));
}

/// What is particular about a solver.
struct Traits {
  unsigned laws = kAllLaws;
  bool level = false;    ///< turns about z only
  bool honest = true;    ///< has a covariance
  bool squared = false;  ///< squares ranges, so that its weights hold to (σ/r)²
  bool leaning = false;  ///< with noise and redundancy, depends on the axes by a part of the noise
  double share = 1;      ///< of the cases that others get, where one costs much
  bool gated = false;    ///< refuses what contradicts: smaller sigmas are another problem
};

/// A solver under test, for one scalar and dimension.
struct Subject {
  std::string name;
  int dimension;
  bool single;                                                    ///< float
  std::function<std::optional<Problem>(const Scene&, int)> make;  ///< none: the scene is no use
  std::function<Result<Answer>(const Problem&)> solve;
  std::function<Result<Answer>(const Problem&)> precise;  ///< the same in double
  Traits traits;
};

/// Every law of the subject, as a property each.
void check_laws(const Subject& subject);

/// Unit noise: over random geometries and draws the mean of eᵀ C⁻¹ e is the number of unknowns and
/// that of χ² its degrees of freedom, for noise of a few millimetres.
void check_honesty(const Subject& subject);

/// `check_laws`, and `check_honesty` where it is honest, of `How::solve<S, D>` in the dimensions
/// `First` to `Last`, float and double.
template <class How, int First = 2, int Last = 3>
void check_all(const std::string& name, std::optional<Problem> (*make)(const Scene&, int),
               const Traits& traits = {}) {
  const auto one = [&]<class S, int D>() {
    const Subject subject{
        name + (sizeof(S) == 4 ? ", float, " : ", double, ") + std::to_string(D) + "-D",
        D,
        sizeof(S) == 4,
        make,
        How::template solve<S, D>,
        How::template solve<double, D>,
        traits};
    check_laws(subject);
    if (traits.honest) check_honesty(subject);
  };
  one.template operator()<float, First>();
  one.template operator()<double, First>();
  if constexpr (First != Last) {
    one.template operator()<float, Last>();
    one.template operator()<double, Last>();
  }
}

/// The first D coordinates, in S.
template <class S, int D>
Vec<S, D> as(const Point& p) {
  return p.head<D>().template cast<S>();
}

/// A point, vector or small matrix as a quantity has it.
template <class Derived>
Mat<double, 3> padded(const Eigen::MatrixBase<Derived>& m) {
  Mat<double, 3> all = Mat<double, 3>::Zero();
  for (int j = 0; j < m.cols(); ++j) {
    for (int i = 0; i < m.rows(); ++i) all(i, j) = static_cast<double>(m(i, j));
  }
  return all;
}

/// A number, likewise.
inline Mat<double, 3> padded(double x) {
  Mat<double, 3> all = Mat<double, 3>::Zero();
  all(0, 0) = x;
  return all;
}

/// Stations of the scene as its shape has them, in the plane with z = 0; exact distances to the tag
/// as values, with the stations' noise and `sigmas`. Some scenes get a number that no solver takes.
/// None where the general geometry, or a ceiling, is not well-posed: GDOP of ranges, or of
/// pseudoranges if `biased`, above 10, or a station within half a metre of the tag.
std::optional<Problem> make_stations(const Scene& scene, int dimension, bool biased);

/// The same where the stations, more than D of them, extend by half a metre in every direction: for
/// solvers whose linear system must determine a position. With a bias the measurements count as one
/// more coordinate.
std::optional<Problem> make_spanned(const Scene& scene, int dimension, bool biased);

/// Noise of one measurement, by station and which of its measurements it is.
double noise_of(const Scene& scene, std::size_t station, std::size_t which = 0);

/// How far from the minimum an iteration, or the step of a clear case (solve/direct_step.hpp), may
/// stop, in standard deviations.
inline constexpr double kStop = 5e-3;

/// Position, covariance, χ² of a fix. `stop`: 0 for closed forms.
template <class S, int D>
Answer fix_answer(const Fix<S, D>& fix, const Problem& p, double stop = kStop) {
  const double spread = std::sqrt(std::abs(static_cast<double>(fix.covariance.trace())));
  double weight = 0;
  for (const double sigma : p.sigmas) weight += 1 / (sigma * sigma);
  // tr C · tr J is more than the condition of J.
  const double condition = spread * spread * weight;
  Answer answer;
  answer.quantities = {
      {"position", Kind::Place, 1, 0, padded(fix.position), stop * spread},
      {"covariance", Kind::Tensor, 2, 2, padded(fix.covariance), 4 * stop * spread * spread,
       condition},
      {"chi-squared", Kind::Number, 0, -2, padded(static_cast<double>(fix.chi_squared)),
       stop * stop + 1e-3 * stop * static_cast<double>(fix.chi_squared)},
      {"degrees of freedom", Kind::Number, 0, 0, padded(fix.degrees_of_freedom)}};
  for (int i = 0; i < D; ++i) {
    answer.error.push_back(static_cast<double>(fix.position[i]) - p.tag[i]);
    for (int j = 0; j < D; ++j) {
      answer.covariance.push_back(static_cast<double>(fix.covariance(i, j)));
    }
  }
  // Only at the minimum is it a χ².
  if (stop > 0) {
    answer.chi_squared = static_cast<double>(fix.chi_squared);
    answer.freedom = fix.degrees_of_freedom;
  }
  return answer;
}

/// Two images whose order means nothing, by their middle and what lies between them.
template <class S, int D>
Answer image_answer(const Vec<S, D>& first, const Vec<S, D>& second) {
  const Point a = padded(first).col(0);
  const Point b = padded(second).col(0);
  const Point middle = (a + b) / 2;
  const Point half = (a - b) / 2;
  Answer answer;
  answer.quantities = {
      {"middle of the images", Kind::Place, 1, 0, padded(middle)},
      {"what lies between them", Kind::Tensor, 2, 0, padded(half * half.transpose())}};
  return answer;
}

}  // namespace uwbpos::test
