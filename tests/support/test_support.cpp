// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/LU>
#include <doctest/doctest.h>

#include "data.hpp"
#include "nees.hpp"
#include "numeric_jacobian.hpp"
#include "random_geometry.hpp"
#include "statistics.hpp"

namespace tests::support_support {

// What judges the library is judged first.

namespace {

using namespace uwbpos::test;
using uwbpos::Mat;
using uwbpos::Vec;

TEST_CASE("Order statistics and moments of a small sample are those worked out by hand") {
  const std::vector<double> samples{4, 1, 3, 2, 100};
  CHECK(mean(samples) == 22);
  CHECK(median(samples) == 3);
  CHECK(quantile(samples, 0.25) == 2);
  CHECK(quantile(samples, 0.125) == 1.5);
  CHECK(quantile(samples, 0) == 1);
  CHECK(quantile(samples, 1) == 100);
  CHECK(robust_deviation(samples) == doctest::Approx(1.4826));
  CHECK(variance({1, 2, 3, 4}) == doctest::Approx(5.0 / 3));
  CHECK(root_mean_square({3, 4}) == doctest::Approx(std::sqrt(12.5)));
  CHECK(std::isnan(median({})));
  CHECK(std::isnan(mean({})));
}

TEST_CASE("Quantiles agree with printed tables") {
  CHECK(normal_quantile(0.5) == doctest::Approx(0).epsilon(1e-12));
  CHECK(normal_quantile(0.975) == doctest::Approx(1.959963985).epsilon(1e-9));
  CHECK(normal_quantile(0.001) == doctest::Approx(-3.090232306).epsilon(1e-9));
  // As in any table of χ², to its last digit.
  CHECK(std::abs(chi_squared_quantile(0.95, 3) - 7.815) < 5e-4);
  CHECK(std::abs(chi_squared_quantile(0.999, 6) - 22.458) < 5e-4);
  CHECK(std::abs(chi_squared_quantile(0.01, 10) - 2.558) < 5e-4);
  CHECK(std::abs(chi_squared_quantile(0.99, 30) - 50.892) < 5e-4);
  CHECK(std::abs(chi_squared_quantile(0.005, 100) - 67.328) < 5e-4);
  // Two degrees of freedom in closed form, and the normal limit of very many (Cornish-Fisher:
  // k + z √(2k) + (2/3)(z² − 1), next term 0.002).
  CHECK(chi_squared_quantile(0.99, 2) == doctest::Approx(-2 * std::log(0.01)).epsilon(1e-9));
  CHECK(std::abs(chi_squared_quantile(0.995, 1e5) -
                 (1e5 + 2.575829304 * std::sqrt(2e5) + 2.0 / 3 * (6.634896601 - 1))) < 0.01);
}

TEST_CASE_TEMPLATE("Intervals hold as often as their confidence says, and say so of right samples",
                   S, float, double) {
  uwbpos::sim::Random random{"intervals"};
  constexpr int kRounds = 2000;
  constexpr std::size_t kCount = 50;
  int nees_inside = 0;
  int mean_inside = 0;
  int variance_inside = 0;
  Mat<S, 2> covariance;
  covariance << S(4), S(1), S(1), S(2);
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> nees;
    std::vector<double> plain;
    for (std::size_t i = 0; i < kCount; ++i) {
      // L·z with the Cholesky factor of the covariance.
      const Vec<S, 2> z = random_normal<S, 2>(random);
      const Vec<S, 2> error{S(2) * z(0), S(0.5) * z(0) + std::sqrt(S(1.75)) * z(1)};
      nees.push_back(normalised_squared_error<S, 2>(error, covariance, Vec<double, 2>::Zero()));
      plain.push_back(random.normal(5, 3));
    }
    nees_inside += mean_nees_interval(2, kCount, 0.9).contains(mean(nees)) ? 1 : 0;
    mean_inside += mean_interval(5, 3, kCount, 0.9).contains(mean(plain)) ? 1 : 0;
    variance_inside += variance_ratio_interval(kCount, 0.9).contains(variance(plain) / 9) ? 1 : 0;
  }
  // 90 % ± 4 √(0.09 / 2000).
  CHECK(std::abs(nees_inside / double{kRounds} - 0.9) < 0.027);
  CHECK(std::abs(mean_inside / double{kRounds} - 0.9) < 0.027);
  CHECK(std::abs(variance_inside / double{kRounds} - 0.9) < 0.027);
}

TEST_CASE_TEMPLATE("Central differences find known derivatives", S, float, double) {
  const auto f = [](const Vec<S, 3>& x) -> Vec<S, 2> {
    return {x(0) * x(1), std::sin(x(2)) + x(0)};
  };
  const Vec<S, 3> x{S(1.5), S(-2), S(0.3)};
  Eigen::Matrix<S, 2, 3> wanted;
  wanted << x(1), x(0), S(0), S(1), S(0), std::cos(x(2));
  // ε^(2/3), times three for arguments up to two.
  const S tolerance = 3 * std::pow(std::numeric_limits<S>::epsilon(), S(2) / 3);
  CHECK((numeric_jacobian<2>(f, x) - wanted).cwiseAbs().maxCoeff() < tolerance);
  const auto g = [&](const Vec<S, 3>& y) { return f(y)(0); };
  const Vec<S, 3> gradient = numeric_gradient(g, x);
  CHECK((gradient.transpose() - wanted.row(0)).cwiseAbs().maxCoeff() < tolerance);
}

TEST_CASE_TEMPLATE("Random rotations are rotations, in no preferred direction", S, float, double) {
  uwbpos::sim::Random random{"rotations"};
  constexpr int kCount = 4000;
  Vec<double, 3> sum = Vec<double, 3>::Zero();
  for (int i = 0; i < kCount; ++i) {
    const Mat<S, 3> r = random_rotation<S, 3>(random);
    const Mat<S, 2> q = random_rotation<S, 2>(random);
    // A quaternion of length 1 ± 2ε gives rows of length 1 ± 4ε; products, sums: 16ε.
    const S tolerance = 16 * std::numeric_limits<S>::epsilon();
    CHECK((r * r.transpose() - Mat<S, 3>::Identity()).cwiseAbs().maxCoeff() < tolerance);
    CHECK((q * q.transpose() - Mat<S, 2>::Identity()).cwiseAbs().maxCoeff() < tolerance);
    CHECK(r.determinant() > 0);
    CHECK(q.determinant() > 0);
    sum += r.template cast<double>().col(0);
  }
  // Components of a random direction have variance 1/3.
  CHECK((sum / kCount).cwiseAbs().maxCoeff() < 4 * std::sqrt(1.0 / 3 / kCount));
}

TEST_CASE("A shuffled sequence has the same members, each anywhere") {
  uwbpos::sim::Random random{"shuffle"};
  std::vector<int> first(5);
  for (int i = 0; i < 5000; ++i) {
    std::vector<int> items{0, 1, 2, 3, 4};
    shuffle(random, items);
    ++first[static_cast<std::size_t>(items[0])];
    std::sort(items.begin(), items.end());
    REQUIRE(items == std::vector<int>{0, 1, 2, 3, 4});
  }
  for (const int count : first) CHECK(std::abs(count - 1000) < 4 * std::sqrt(800.0));
}

TEST_CASE("UWBPOS_DATA names the folder of recordings, and one that is not there is not found") {
  const char* const before = std::getenv("UWBPOS_DATA");
  const std::string kept = before != nullptr ? before : "";
  const auto folder = std::filesystem::temp_directory_path();
  setenv("UWBPOS_DATA", folder.c_str(), 1);
  CHECK(data_dir() == folder);
  setenv("UWBPOS_DATA", (folder / "no-such-folder-of-recordings").c_str(), 1);
  CHECK_FALSE(data_dir());
  if (before != nullptr) {
    setenv("UWBPOS_DATA", kept.c_str(), 1);
  } else {
    unsetenv("UWBPOS_DATA");
  }
}

}  // namespace

}  // namespace tests::support_support
