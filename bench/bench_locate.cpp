// SPDX-License-Identifier: MIT
// Cost of one position from ranges, for each solver, beside the way it is commonly written: an
// iteration from the anchors' mean with Eigen's dynamic matrices. And of what tells how good a
// position can be.
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Dense>
#include <benchmark/benchmark.h>

#include <uwbpos/accuracy/dop.hpp>
#include <uwbpos/geometry/height.hpp>
#include <uwbpos/solve/exclude_outliers.hpp>
#include <uwbpos/solve/locate.hpp>
#include <uwbpos/solve/toa_chan.hpp>
#include <uwbpos/solve/toa_linear.hpp>
#include <uwbpos/solve/toa_refine.hpp>
#include <uwbpos/solve/toa_three_anchors.hpp>

#include "scenes.hpp"

namespace {

using namespace benches;

// The common way: from the mean of the anchors until the step is small, everything allocated.
template <class S, int D>
Result<Fix<S, D>> textbook(const std::vector<RangeTo<S, D>>& ranges) {
  using Matrix = Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<S, Eigen::Dynamic, 1>;
  const auto n = static_cast<Eigen::Index>(ranges.size());
  Vector position = Vector::Zero(D);
  for (const auto& r : ranges) position += r.anchor / static_cast<S>(n);
  position[D - 1] -= S(1);  // off the plane, or the first step is singular
  Matrix jacobian(n, D);
  Vector residual(n);
  for (int iteration = 0; iteration < 30; ++iteration) {
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto& r = ranges[static_cast<std::size_t>(i)];
      const Vector offset = position - r.anchor;
      const S predicted = offset.norm();
      jacobian.row(i) = offset.transpose() / (predicted * r.sigma);
      residual[i] = (r.range - predicted) / r.sigma;
    }
    const Vector step =
        (jacobian.transpose() * jacobian).ldlt().solve(jacobian.transpose() * residual);
    position += step;
    if (step.norm() < S(1e-4)) break;
  }
  Fix<S, D> fix;
  fix.position = position;
  fix.covariance = (jacobian.transpose() * jacobian).inverse();
  fix.chi_squared = residual.squaredNorm();
  fix.degrees_of_freedom = static_cast<int>(n) - D;
  return fix;
}

template <class S, int D>
void textbook_gauss_newton(benchmark::State& state) {
  solve_all(state, epochs<S, D>(static_cast<int>(state.range(0))),
            [](const auto& e) { return textbook<S, D>(e.ranges); });
}
BENCHMARK(textbook_gauss_newton<double, 2>)->Apply(by_anchors<4>);
BENCHMARK(textbook_gauss_newton<double, 3>)->Apply(by_anchors<4>);

template <class S, int D>
void locate(benchmark::State& state) {
  solve_all(state, epochs<S, D>(static_cast<int>(state.range(0))),
            [](const auto& e) { return uwbpos::locate(e.ranges); });
}
BENCHMARK(locate<float, 2>)->Apply(by_anchors<3>);
BENCHMARK(locate<double, 2>)->Apply(by_anchors<3>);
BENCHMARK(locate<float, 3>)->Apply(by_anchors<4>);
BENCHMARK(locate<double, 3>)->Apply(by_anchors<4>);

template <class S>
void locate_below_ceiling(benchmark::State& state) {
  solve_all(state, epochs<S, 3>(static_cast<int>(state.range(0)), 0, true),
            [](const auto& e) { return uwbpos::locate(e.ranges, {.side = {0, 0, -1}}); });
}
BENCHMARK(locate_below_ceiling<float>)->Apply(by_anchors<3>);
BENCHMARK(locate_below_ceiling<double>)->Apply(by_anchors<3>);

template <class S, int D>
void least_squares(benchmark::State& state) {
  solve_all(state, epochs<S, D>(static_cast<int>(state.range(0))),
            [](const auto& e) { return toa_least_squares(e.ranges); });
}
BENCHMARK(least_squares<float, 2>)->Apply(by_anchors<3>);
BENCHMARK(least_squares<double, 2>)->Apply(by_anchors<3>);
BENCHMARK(least_squares<float, 3>)->Apply(by_anchors<4>);
BENCHMARK(least_squares<double, 3>)->Apply(by_anchors<4>);

// From 30 cm beside the tag, in each direction.
template <class S, int D>
void refine(benchmark::State& state) {
  solve_all(state, epochs<S, D>(static_cast<int>(state.range(0))), [](const auto& e) {
    return toa_refine(e.ranges, Vec<S, D>{e.tag + Vec<S, D>::Constant(S(0.3))});
  });
}
BENCHMARK(refine<float, 3>)->Apply(by_anchors<4>);
BENCHMARK(refine<double, 3>)->Apply(by_anchors<4>);

template <class S, int D>
void chan(benchmark::State& state) {
  solve_all(state, epochs<S, D>(static_cast<int>(state.range(0))),
            [](const auto& e) { return toa_chan(e.ranges); });
}
BENCHMARK(chan<float, 3>)->Apply(by_anchors<4>);
BENCHMARK(chan<double, 3>)->Apply(by_anchors<4>);

template <class S, int D>
void linear(benchmark::State& state) {
  solve_all(state, epochs<S, D>(static_cast<int>(state.range(0))),
            [](const auto& e) { return toa_linear(e.ranges); });
}
BENCHMARK(linear<float, 3>)->Apply(by_anchors<4>);
BENCHMARK(linear<double, 3>)->Apply(by_anchors<4>);

// Of its two images the one nearer to the tag.
template <class S, int D>
void closed_form(benchmark::State& state) {
  struct Nearer {
    Vec<S, D> position;
  };
  solve_all(
      state, epochs<S, D>(static_cast<int>(state.range(0))), [](const auto& e) -> Result<Nearer> {
        const auto images = toa_closed_form(e.ranges);
        if (!images) return std::unexpected(images.error());
        const bool first =
            squared_norm<S, D>(images->first - e.tag) <= squared_norm<S, D>(images->second - e.tag);
        return Nearer{first ? images->first : images->second};
      });
}
BENCHMARK(closed_form<float, 2>)->Apply(by_anchors<3>);
BENCHMARK(closed_form<double, 2>)->Apply(by_anchors<3>);
BENCHMARK(closed_form<float, 3>)->Apply(by_anchors<3>);
BENCHMARK(closed_form<double, 3>)->Apply(by_anchors<3>);

// Three anchors by bare arithmetic.
template <class S>
void three_anchors(benchmark::State& state) {
  struct Found {
    Vec<S, 2> position;
  };
  solve_all(state, epochs<S, 2>(static_cast<int>(state.range(0))),
            [](const auto& e) -> Result<Found> {
              const auto found = toa_three_anchors<S>({e.ranges[0], e.ranges[1], e.ranges[2]});
              if (!found) return std::unexpected(found.error());
              return Found{*found};
            });
}
BENCHMARK(three_anchors<float>)->ArgName("anchors")->Arg(3);
BENCHMARK(three_anchors<double>)->ArgName("anchors")->Arg(3);

// One range is 2 m too long; the bound is that of all of them, were they good. Tries each: the time
// per anchor grows.
template <class S, int D>
void locate_without_outlier(benchmark::State& state) {
  auto all = epochs<S, D>(static_cast<int>(state.range(0)));
  sim::Random random{"bench outliers"};
  for (auto& e : all) {
    e.ranges[static_cast<std::size_t>(random.integer(0, static_cast<int>(state.range(0)) - 1))]
        .range += S(2);
  }
  solve_all(state, all, [](const auto& e) -> Result<Fix<S, D>> {
    const auto found = locate_excluding(e.ranges);
    if (!found) return std::unexpected(found.error());
    return found->fix;
  });
}
BENCHMARK(locate_without_outlier<float, 3>)->Apply(by_anchors<8>);
BENCHMARK(locate_without_outlier<double, 3>)->Apply(by_anchors<8>);

template <class S, int D>
void dilution(benchmark::State& state) {
  struct Seen {
    std::vector<Vec<S, D>> anchors;
    Vec<S, D> tag;
  };
  std::vector<Seen> all;
  for (const auto& e : epochs<S, D>(static_cast<int>(state.range(0)))) {
    all.push_back({{}, e.tag});
    for (const auto& r : e.ranges) all.back().anchors.push_back(r.anchor);
  }
  take_time(state, all, [](const Seen& s) { return range_dop(s.anchors, s.tag); });
  tell_growth(state);
}
BENCHMARK(dilution<float, 3>)->Apply(by_anchors<4>);
BENCHMARK(dilution<double, 3>)->Apply(by_anchors<4>);

template <class S, int D>
void bound(benchmark::State& state) {
  take_time(state, epochs<S, D>(static_cast<int>(state.range(0))),
            [](const auto& e) { return cramer_rao_bound(e.ranges, e.tag); });
  tell_growth(state);
}
BENCHMARK(bound<float, 3>)->Apply(by_anchors<4>);
BENCHMARK(bound<double, 3>)->Apply(by_anchors<4>);

template <class S>
void height_projection(benchmark::State& state) {
  const auto all = epochs<S, 3>(4);
  take_time(state, all, [](const auto& e) {
    return horizontal_range<S>({e.ranges[0].range, S(kSigma * kSigma)}, e.ranges[0].anchor[2],
                               e.tag[2]);
  });
}
BENCHMARK(height_projection<float>);
BENCHMARK(height_projection<double>);

}  // namespace
