// SPDX-License-Identifier: MIT
#include <cmath>
#include <limits>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include "uwbpos/filter/kalman.hpp"
#include "uwbpos/sim/noise.hpp"

#include "support/random_geometry.hpp"

namespace tests::filter_factored_covariance {

namespace {

using namespace uwbpos;

constexpr int N = 6;

// A random covariance of condition some hundreds.
template <class S>
Mat<S, N> random_covariance(sim::Random& random) {
  Mat<S, N> a;
  for (int j = 0; j < N; ++j) a.col(j) = test::random_normal<S, N>(random);
  Mat<S, N> p = Mat<S, N>::Identity() * S(0.1);
  for (int j = 0; j < N; ++j) {
    for (int i = 0; i < N; ++i) {
      for (int k = 0; k < N; ++k) p(i, j) += a(i, k) * a(j, k);
    }
  }
  return p;
}

// Rounding of some N³ products of numbers as large as the largest.
template <class S>
S tolerance(const Mat<S, N>& p) {
  return S(200) * std::numeric_limits<S>::epsilon() * p.cwiseAbs().maxCoeff();
}

TEST_CASE_TEMPLATE("covariance: factors give the matrix back", S, float, double) {
  sim::Random random{"factors"};
  for (int trial = 0; trial < 100; ++trial) {
    const Mat<S, N> p = random_covariance<S>(random);
    const auto factored = FactoredCovariance<S, N>::from_matrix(p);
    REQUIRE(factored);
    CHECK((factored->matrix() - p).cwiseAbs().maxCoeff() < tolerance<S>(p));
    CHECK((factored->template matrix<2>() - p.template topLeftCorner<2, 2>()).norm() <
          tolerance<S>(p));
    CHECK((*factored)(1, 4) == (*factored)(4, 1));
  }
}

TEST_CASE_TEMPLATE("covariance: an update is Kalman's, whatever the row uses", S, float, double) {
  sim::Random random{"update"};
  const auto check = [&]<int M>() {
    for (int trial = 0; trial < 50; ++trial) {
      const Mat<S, N> p = random_covariance<S>(random);
      auto factored = *FactoredCovariance<S, N>::from_matrix(p);
      const Vec<S, M> row = test::random_normal<S, M>(random);
      const S noise = static_cast<S>(random.uniform(0.01, 10));
      Vec<S, N> whole = Vec<S, N>::Zero();
      whole.template head<M>() = row;
      const Vec<S, N> ph = p * whole;
      const S s = whole.dot(ph) + noise;
      const auto projected = factored.project(row);
      CHECK(std::abs(projected.variance + noise - s) < S(1e-4) * s);
      const Vec<S, N> gain = factored.update(projected, noise);
      CHECK((gain - ph / s).norm() < S(1e3) * std::numeric_limits<S>::epsilon() * (ph / s).norm());
      const Mat<S, N> after = p - ph * ph.transpose() / s;
      CHECK((factored.matrix() - after).cwiseAbs().maxCoeff() < tolerance<S>(p));
    }
  };
  check.template operator()<1>();
  check.template operator()<3>();
  check.template operator()<6>();
}

TEST_CASE_TEMPLATE("covariance: columns that a row does not use keep their bits", S, float,
                   double) {
  sim::Random random{"untouched"};
  auto factored = *FactoredCovariance<S, N>::from_matrix(random_covariance<S>(random));
  const auto before = factored;
  factored.update(factored.project(Vec<S, 2>{S(0.6), S(-0.8)}), S(0.01));
  CHECK(factored.factor().template rightCols<4>() == before.factor().template rightCols<4>());
  CHECK(factored.diagonal().template tail<4>() == before.diagonal().template tail<4>());
}

TEST_CASE_TEMPLATE("covariance: a step of time is F P Fᵀ + G q Gᵀ", S, float, double) {
  sim::Random random{"predict"};
  for (int trial = 0; trial < 50; ++trial) {
    const Mat<S, N> p = random_covariance<S>(random);
    auto factored = *FactoredCovariance<S, N>::from_matrix(p);
    Mat<S, N> f = Mat<S, N>::Identity();
    f(0, 3) = f(1, 4) = f(2, 5) = S(0.7);
    f(4, 1) = S(-0.3);
    Eigen::Matrix<S, N, 2> g;
    g.col(0) = test::random_normal<S, N>(random);
    g.col(1) = test::random_normal<S, N>(random);
    const Vec<S, 2> q{S(0.5), S(2)};
    factored.predict(f, g, q);
    const Mat<S, N> wanted = f * p * f.transpose() + g * q.asDiagonal() * g.transpose();
    CHECK((factored.matrix() - wanted).cwiseAbs().maxCoeff() < tolerance<S>(wanted));
  }
}

TEST_CASE_TEMPLATE("covariance: where only the first states move, and where one wanders by itself",
                   S, float, double) {
  sim::Random random{"predict a part"};
  for (int trial = 0; trial < 50; ++trial) {
    const Mat<S, N> p = random_covariance<S>(random);
    auto factored = *FactoredCovariance<S, N>::from_matrix(p);
    Mat<S, 3> f = Mat<S, 3>::Identity();
    f(0, 2) = S(0.7);
    f(2, 1) = S(-0.3);
    Eigen::Matrix<S, 3, 2> g;
    g.col(0) = test::random_normal<S, 3>(random);
    g.col(1) = test::random_normal<S, 3>(random);
    const Vec<S, 2> q{S(0.5), S(2)};
    factored.predict_first(f, g, q);
    Mat<S, N> whole = Mat<S, N>::Identity();
    whole.template topLeftCorner<3, 3>() = f;
    Mat<S, N> wanted = whole * p * whole.transpose();
    wanted.template topLeftCorner<3, 3>() += g * q.asDiagonal() * g.transpose();
    CHECK((factored.matrix() - wanted).cwiseAbs().maxCoeff() < tolerance<S>(wanted));

    const int k = random.integer(0, N - 1);
    factored.predict_process(k, S(0.6), S(0.4));
    wanted.row(k) *= S(0.6);
    wanted.col(k) *= S(0.6);
    wanted(k, k) += S(0.4);
    CHECK((factored.matrix() - wanted).cwiseAbs().maxCoeff() < tolerance<S>(wanted));
    CHECK(factored.diagonal().minCoeff() > S(0));
  }
}

TEST_CASE_TEMPLATE("covariance: a long row that is mostly zeros counts as any other", S, float,
                   double) {
  constexpr int M = 12;
  sim::Random random{"a long row"};
  Mat<S, M> a;
  for (int j = 0; j < M; ++j) a.col(j) = test::random_normal<S, M>(random);
  const Mat<S, M> p = a * a.transpose() + Mat<S, M>::Identity();
  auto factored = *FactoredCovariance<S, M>::from_matrix(p);
  Vec<S, M> row = Vec<S, M>::Zero();
  row[0] = S(0.6);
  row[1] = S(-0.8);
  row[7] = S(1);
  const Vec<S, M> ph = p * row;
  const S s = row.dot(ph) + S(0.3);
  const auto projected = factored.project(row);
  CHECK(std::abs(projected.variance + S(0.3) - s) < S(1e-4) * s);
  const Vec<S, M> gain = factored.update(projected, S(0.3));
  CHECK((gain - ph / s).norm() < S(1e3) * std::numeric_limits<S>::epsilon() * (ph / s).norm());
  const Mat<S, M> after = p - ph * ph.transpose() / s;
  CHECK((factored.matrix() - after).cwiseAbs().maxCoeff() <
        S(400) * std::numeric_limits<S>::epsilon() * p.cwiseAbs().maxCoeff());
}

TEST_CASE_TEMPLATE("covariance: known exactly stays so, without noise", S, float, double) {
  FactoredCovariance<S, 3> exact;
  const Eigen::Matrix<S, 3, 1> g = Eigen::Matrix<S, 3, 1>::Zero();
  exact.predict(Mat<S, 3>{Mat<S, 3>::Identity()}, g, Vec<S, 1>{S(0)});
  const Vec<S, 3> gain = exact.update(exact.project(Vec<S, 3>{S(1), S(2), S(3)}), S(0.1));
  CHECK(gain == Vec<S, 3>::Zero());
  CHECK(exact.matrix() == Mat<S, 3>::Zero());
}

TEST_CASE_TEMPLATE("covariance: a variance too small to divide by is none", S, float, double) {
  constexpr S tiny = S(256) * std::numeric_limits<S>::denorm_min();
  const Mat<S, 2> identity = Mat<S, 2>::Identity();
  FactoredCovariance<S, 2> covariance;
  covariance.predict(identity, identity, Vec<S, 2>{tiny, S(1)});
  Mat<S, 2> f = identity;
  f(1, 0) = S(0.5);
  covariance.predict(f, identity, Vec<S, 2>{S(0), S(0)});
  CHECK(covariance.matrix().allFinite());
  CHECK(covariance.matrix()(1, 1) == S(1));
}

TEST_CASE_TEMPLATE("covariance: what is none is refused", S, float, double) {
  Mat<S, 2> p;
  p << S(1), S(2), S(2), S(1);
  CHECK(FactoredCovariance<S, 2>::from_matrix(p).error() == Error::InvalidCovariance);
  p(1, 0) = std::numeric_limits<S>::quiet_NaN();
  CHECK(FactoredCovariance<S, 2>::from_matrix(p).error() == Error::NotFinite);
}

// A tag that moves at random among four anchors: nine states, position, velocity, acceleration.
template <class S>
struct Tracking {
  KalmanFilter<S, 9> filter{Vec<S, 9>::Zero(), FactoredCovariance<S, 9>{Vec<S, 9>::Constant(4)}};
  Mat<S, 9> f = Mat<S, 9>::Identity();
  Eigen::Matrix<S, 9, 3> g = Eigen::Matrix<S, 9, 3>::Zero();
  Vec<S, 3> q = Vec<S, 3>::Constant(S(0.005));

  Tracking() {
    for (int k = 0; k < 3; ++k) {
      f(k, 3 + k) = f(3 + k, 6 + k) = S(0.005);
      f(k, 6 + k) = S(0.0000125);
      g(6 + k, k) = S(1);
    }
  }
};

TEST_CASE("kalman: a hundred thousand updates in float are as many in double") {
  Tracking<float> single;
  Tracking<double> precise;
  sim::Random random{"long run"};
  for (int i = 0; i < 100'000; ++i) {
    const Vec<double, 3> row = test::random_direction<double, 3>(random);
    // Millimetres against metres of prior: what makes P − K s Kᵀ negative within a few steps.
    const double noise = i % 7 == 0 ? 1e-6 : 1e-2;
    const double innovation = random.normal(0, 0.1);
    single.filter.predict(single.f, single.g, single.q);
    precise.filter.predict(precise.f, precise.g, precise.q);
    REQUIRE(
        precise.filter.update(innovation - row.dot(precise.filter.state.head<3>()), row, noise));
    const Vec<float, 3> row_f = row.cast<float>();
    REQUIRE(single.filter.update(
        static_cast<float>(innovation) - row_f.dot(single.filter.state.head<3>()), row_f,
        static_cast<float>(noise)));
  }
  for (int k = 0; k < 9; ++k) {
    const double p = precise.filter.covariance(k, k);
    const auto s = static_cast<double>(single.filter.covariance(k, k));
    CHECK(single.filter.covariance.diagonal()[k] > 0);
    // Standard deviations agree to 1e-4, states to a thousandth of one.
    CHECK(std::sqrt(s) == doctest::Approx(std::sqrt(p)).epsilon(1e-4));
    CHECK(std::abs(static_cast<double>(single.filter.state[k]) - precise.filter.state[k]) <
          1e-3 * std::sqrt(p));
  }
}

TEST_CASE_TEMPLATE("kalman: bad numbers are refused and change nothing", S, float, double) {
  Tracking<S> t;
  const auto before = t.filter;
  const Vec<S, 2> row{S(1), S(0)};
  const S nan = std::numeric_limits<S>::quiet_NaN();
  CHECK(t.filter.update(nan, row, S(1)).error() == Error::NotFinite);
  CHECK(t.filter.update(S(1), Vec<S, 2>{nan, S(0)}, S(1)).error() == Error::NotFinite);
  CHECK(t.filter.update(S(1), row, S(0)).error() == Error::NonPositiveSigma);
  CHECK(t.filter.update(S(1), row, S(-1)).error() == Error::NonPositiveSigma);
  CHECK(t.filter.state == before.state);
  CHECK(t.filter.covariance.matrix() == before.covariance.matrix());
}

}  // namespace

}  // namespace tests::filter_factored_covariance
