// SPDX-License-Identifier: MIT
#include <array>
#include <limits>
#include <vector>

#include <Eigen/Geometry>
#include <doctest/doctest.h>

#include "uwbpos/frames/fit_transform.hpp"

#include "frames/scenes.hpp"
#include "support/nees.hpp"
#include "support/statistics.hpp"

namespace tests::frames_fit_transform {

using namespace uwbpos;

namespace {

// `count` points of a room of 20 m, as frame b and a see them, without noise.
template <class S, int D>
std::vector<SharedPoint<S, D>> shared_points(sim::Random& random, const Transform<double, D>& a_T_b,
                                             int count) {
  std::vector<SharedPoint<S, D>> points;
  for (int i = 0; i < count; ++i) {
    const Vec<double, D> p = test::random_in_cube<double, D>(random, 10.0);
    points.push_back(
        {p.template cast<S>(), apply(a_T_b, p).template cast<S>(), S(random.uniform(0.02, 0.1))});
  }
  return points;
}

template <class S, int D>
void exact_fit(sim::Random& random, int count) {
  const auto a_T_b = test::random_transform<double, D>(random);
  const auto points = shared_points<S, D>(random, a_T_b, count);
  const auto fit = fit_transform(points, {.max_turn_sigma = S(10)});
  REQUIRE(fit);
  // Points rounded at 60 m; few points near a line turn that into more. Double: 1e-13 · 100.
  const double tolerance = 2e3 * static_cast<double>(std::numeric_limits<S>::epsilon());
  const auto found = test::in_double(fit->a_T_b);
  double spread = 0;  // least extent of the points that matters, as a share of 10 m
  {
    Vec<double, D> mean = Vec<double, D>::Zero();
    for (const auto& p : points) mean += p.in_b.template cast<double>() / count;
    Mat<double, D> m = Mat<double, D>::Zero();
    for (const auto& p : points) {
      const Vec<double, D> d = p.in_b.template cast<double>() - mean;
      m += d * d.transpose() / count;
    }
    const Vec<double, D> s = Eigen::JacobiSVD<Mat<double, D>>{m}.singularValues();
    spread = std::sqrt(D == 2 ? s[0] : s[1]) / 10;
  }
  CHECK((found.rotation - a_T_b.rotation).cwiseAbs().maxCoeff() * spread < tolerance);
  CHECK((found.translation - a_T_b.translation).norm() * spread < 10 * tolerance);
  // Coordinates rounded at 64 m leave 32 ε. H squares the extent, so that its rounding, 8 ε of
  // 17 m, turns the points about their line by that over spread².
  CHECK(static_cast<double>(fit->rms) * spread <
        (32 + 8 * 17) * static_cast<double>(std::numeric_limits<S>::epsilon()));
  CHECK(fit->worst >= fit->rms);
  CHECK(test::rotation_defect<S, D>(fit->a_T_b.rotation) <
        8 * static_cast<double>(std::numeric_limits<S>::epsilon()));
  CHECK(fit->degrees_of_freedom == D * count - kTransformDof<D>);
  CHECK(fit->a_T_b.covariance == fit->a_T_b.covariance.transpose());
}

// Normalised squared errors of many fits; every fit its own motion, points and sigmas.
template <class S, int D>
void honest_fit(sim::Random& random, int count) {
  constexpr int N = kTransformDof<D>;
  constexpr int trials = 3000;
  double transform_error = 0;
  double residual = 0;
  double mapped_error = 0;
  int fitted = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const auto a_T_b = exact(test::random_transform<double, D>(random));
    auto points = shared_points<S, D>(random, a_T_b, count);
    for (auto& p : points) {
      p.in_a += test::random_normal<S, D>(random, p.sigma * S(0.8));
      p.in_b += test::random_normal<S, D>(random, p.sigma * S(0.6));  // 0.8² + 0.6² = 1
    }
    const auto fit = fit_transform(points, {.max_turn_sigma = S(0.03)});
    if (!fit) continue;
    ++fitted;
    const auto found = test::in_double(fit->a_T_b);
    const Vec<double, N> xi = test::error_of<D>(a_T_b, found);
    transform_error += xi.dot(found.covariance.inverse() * xi);
    residual += static_cast<double>(fit->chi_squared);
    Fix<double, D> fix{};
    fix.position = test::random_in_cube<double, D>(random, 15.0);
    fix.covariance.setZero();
    const auto mapped = apply(found, fix);
    mapped_error += test::normalised_squared_error<double, D>(mapped.position, mapped.covariance,
                                                              apply(a_T_b, fix.position));
  }
  REQUIRE(fitted > trials / 2);
  const auto n = static_cast<std::size_t>(fitted);
  // 99.9 % intervals, and 1 % for the angles' second order and the lever arms' noise.
  const auto within = [&](double sum, int dimension) {
    const auto interval = test::mean_nees_interval(dimension, n, 0.999);
    CAPTURE(D);
    CAPTURE(count);
    CAPTURE(sum / fitted / dimension);
    CHECK(sum / fitted > 0.99 * interval.low);
    CHECK(sum / fitted < 1.01 * interval.high);
  };
  within(transform_error, N);
  within(mapped_error, D);
  within(residual, D * count - N);
}

}  // namespace

TEST_CASE_TEMPLATE("exact points give the exact transform", S, float, double) {
  sim::Random random{"exact fit"};
  for (int trial = 0; trial < 300; ++trial) {
    for (int count = 2; count <= 8; ++count) exact_fit<S, 2>(random, count);
    for (int count = 3; count <= 8; ++count) exact_fit<S, 3>(random, count);
  }
}

TEST_CASE_TEMPLATE("noisy points give errors and residuals as large as the fit claims", S, float,
                   double) {
  sim::Random random{"honest fit"};
  for (const int count : {2, 3, 6}) honest_fit<S, 2>(random, count);
  for (const int count : {3, 4, 8}) honest_fit<S, 3>(random, count);
}

TEST_CASE("with equal weights the fit is that of Eigen's umeyama") {
  sim::Random random{"umeyama"};
  for (int trial = 0; trial < 200; ++trial) {
    const int count = 4 + trial % 5;
    auto points =
        shared_points<double, 3>(random, test::random_transform<double, 3>(random), count);
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 8> a{3, count};
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 8> b{3, count};
    for (int i = 0; i < count; ++i) {
      auto& p = points[static_cast<std::size_t>(i)];
      p.sigma = 0.3;
      p.in_a += test::random_normal<double, 3>(random, trial % 2 == 0 ? 0.3 : 3.0);
      a.col(i) = p.in_a;
      b.col(i) = p.in_b;
    }
    const auto fit = fit_transform(points, {.max_turn_sigma = 10.0});
    REQUIRE(fit);
    const Eigen::Matrix4d expected = Eigen::umeyama(b, a, false);
    // Two orders of the same sums; conditions up to a few thousand.
    CHECK((fit->a_T_b.rotation - expected.topLeftCorner<3, 3>()).norm() < 1e-11);
    CHECK((fit->a_T_b.translation - expected.topRightCorner<3, 1>()).norm() < 1e-10);
  }
}

TEST_CASE_TEMPLATE("no motion near the fitted one explains the points better", S, double) {
  sim::Random random{"least squares"};
  for (int trial = 0; trial < 100; ++trial) {
    auto points = shared_points<S, 3>(random, test::random_transform<S, 3>(random), 5);
    for (auto& p : points) p.in_a += test::random_normal<S, 3>(random, S(0.5));
    const auto fit = fit_transform(points, {.max_turn_sigma = S(10)});
    REQUIRE(fit);
    const auto cost = [&](const Transform<S, 3>& t) {
      S sum = 0;
      for (const auto& p : points) {
        sum += (p.in_a - apply(t, p.in_b)).squaredNorm() / (p.sigma * p.sigma);
      }
      return sum;
    };
    CHECK(cost(fit->a_T_b) == doctest::Approx(fit->chi_squared).epsilon(1e-9));
    for (int k = 0; k < 20; ++k) {
      const Vec<S, 6> xi = test::random_normal<S, 6>(random, S(1e-3));
      CHECK(cost(test::perturbed<3>(fit->a_T_b, xi)) > fit->chi_squared);
    }
  }
}

TEST_CASE_TEMPLATE("the point that was surveyed wrongly is named", S, float, double) {
  sim::Random random{"wrong survey"};
  for (int trial = 0; trial < 50; ++trial) {
    auto points = shared_points<S, 2>(random, test::random_transform<double, 2>(random), 8);
    const int wrong = random.integer(0, 7);
    points[static_cast<std::size_t>(wrong)].in_a += test::random_direction<S, 2>(random) * S(2);
    for (auto& p : points) p.sigma = S(0.05);
    const auto fit = fit_transform(points);
    REQUIRE(fit);
    CHECK(fit->worst_point == wrong);
    CHECK(fit->worst > S(0.8));  // the fit follows the bad point by less than its leverage
    CHECK(fit->chi_squared > S(100));
  }
}

TEST_CASE_TEMPLATE("mirrored points leave a residual, not a reflection", S, float, double) {
  sim::Random random{"mirrored"};
  for (int trial = 0; trial < 50; ++trial) {
    auto points = shared_points<S, 3>(random, test::random_transform<double, 3>(random), 8);
    for (auto& p : points) p.in_b[2] = -p.in_b[2];
    const auto fit = fit_transform(points);
    REQUIRE(fit);
    CHECK(test::rotation_defect<S, 3>(fit->a_T_b.rotation) < 1e-5);
    CHECK(fit->rms > S(0.5));
  }
  // Where the mirror image has no nearest rotation, the fit says so: a square in the plane.
  const std::array<SharedPoint<S, 2>, 4> square{SharedPoint<S, 2>{{1, 1}, {1, -1}},
                                                {{-1, 1}, {-1, -1}},
                                                {{-1, -1}, {-1, 1}},
                                                {{1, -1}, {1, 1}}};
  CHECK(fit_transform(square).error() == Error::RotationUndetermined);
}

TEST_CASE_TEMPLATE("a line of points suffices in the plane and not in space", S, float, double) {
  sim::Random random{"line of points"};
  for (int trial = 0; trial < 50; ++trial) {
    const auto plane = test::random_transform<double, 2>(random);
    const auto space = test::random_transform<double, 3>(random);
    const Vec<double, 2> along2 = test::random_direction<double, 2>(random);
    const Vec<double, 3> along3 = test::random_direction<double, 3>(random);
    const Vec<double, 3> start = test::random_in_cube<double, 3>(random, 10.0);
    std::vector<SharedPoint<S, 2>> in_plane;
    std::vector<SharedPoint<S, 3>> in_line;
    for (int i = 0; i < 6; ++i) {
      const Vec<double, 2> p = along2 * 3.0 * i;
      in_plane.push_back({p.cast<S>(), apply(plane, p).template cast<S>(), S(0.02)});
      const Vec<double, 3> q = start + along3 * 3.0 * i;
      in_line.push_back({q.cast<S>(), apply(space, q).template cast<S>(), S(0.02)});
    }
    CHECK(fit_transform(in_plane));
    CHECK(fit_transform(in_line).error() == Error::RotationUndetermined);
    // Noise makes no line a plane.
    for (auto& p : in_line) {
      p.in_a += test::random_normal<S, 3>(random, p.sigma);
      p.in_b += test::random_normal<S, 3>(random, p.sigma);
    }
    CHECK(fit_transform(in_line).error() == Error::RotationUndetermined);
    // One point beside the line does.
    in_line[2].in_b +=
        S(2) * Vec<S, 3>{along3.cross(Vec<double, 3>{1, 2, 3}).normalized().cast<S>()};
    in_line[2].in_a =
        apply(space, Vec<double, 3>{in_line[2].in_b.template cast<double>()}).template cast<S>();
    CHECK(fit_transform(in_line));
  }
}

TEST_CASE_TEMPLATE("points that determine no transform are refused by name", S, float, double) {
  const S nan = std::numeric_limits<S>::quiet_NaN();
  using P = SharedPoint<S, 2>;
  const auto error = [](const std::vector<P>& points, FitTransformOptions<S> options = {}) {
    const auto fit = fit_transform(points, options);
    REQUIRE_FALSE(fit);
    return fit.error();
  };
  const P a{{0, 0}, {5, 5}};
  const P b{{4, 0}, {5, 9}};
  CHECK(fit_transform(std::array{a, b}));
  CHECK(error({}) == Error::TooFewMeasurements);
  CHECK(error({a}) == Error::TooFewMeasurements);
  CHECK(error(std::vector<P>(65, a)) == Error::TooManyMeasurements);
  CHECK(error({a, a}) == Error::RotationUndetermined);
  CHECK(error({a, P{{4, 0}, {5, 5}}}) == Error::RotationUndetermined);  // coincide in one frame
  CHECK(error({a, P{{S(0.1), 0}, {5, S(5.1)}}}) == Error::RotationUndetermined);  // 5 cm at 10 cm
  CHECK(error({a, P{{nan, 0}, {5, 9}}}) == Error::NotFinite);
  CHECK(error({a, P{{4, 0}, {5, nan}}}) == Error::NotFinite);
  CHECK(error({a, P{{4, 0}, {5, 9}, nan}}) == Error::NotFinite);
  CHECK(error({a, P{{4, 0}, {5, 9}, 0}}) == Error::NonPositiveSigma);
  CHECK(error({a, P{{4, 0}, {5, 9}, -1}}) == Error::NonPositiveSigma);
  CHECK(error({a, b}, {.max_turn_sigma = 0}) == Error::InvalidOption);
  CHECK(error({a, b}, {.max_turn_sigma = nan}) == Error::InvalidOption);
  const S huge = std::numeric_limits<S>::max();
  CHECK(error({a, P{{huge, huge}, {-huge, huge}}}) == Error::NumericOverflow);
  const std::array<SharedPoint<S, 3>, 2> two{SharedPoint<S, 3>{{0, 0, 0}, {0, 0, 0}},
                                             {{1, 0, 0}, {1, 0, 0}}};
  CHECK(fit_transform(two).error() == Error::TooFewMeasurements);
}

}  // namespace tests::frames_fit_transform
