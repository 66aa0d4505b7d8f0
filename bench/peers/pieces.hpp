// SPDX-License-Identifier: MIT
// What a fix cannot do without, each as a share of the whole fix, in one run: how far below our
// time a solver of this kind could go.
#pragma once
#include <utility>
#include <vector>

#include <uwbpos/solve/direct_pseudoranges.hpp>
#include <uwbpos/solve/direct_ranges.hpp>

#include "cases.hpp"
#include "timing.hpp"

namespace peers {

struct Piece {
  const char* name;
  double share;  // of a fix
};

// One root and one division for each of eight measurements, two to a register, nothing else.
inline auto roots_and_divisions(const Case& c) {
  return uwbpos::sum_in_lanes<double, 1>(
      c.toa, [](auto& sum, const auto& take, const auto& one) __attribute__((always_inline)) {
        const auto range = take([](const auto& r) { return r.range; });
        sum[0] += one / uwbpos::square_root(range);
      });
}

// Divisions and roots of which each waits for the one before, as those on a fix's longest path do;
// a call begins with the result of the last, so that calls cannot overlap either.
class Chain {
 public:
  Chain(int divisions, int roots) : divisions_(divisions), roots_(roots) {}
  double operator()(const Case& c, std::size_t) const {
    double x = c.ranges[0] + 1e-300 * last_;
    for (int i = 0; i < divisions_; ++i) x = c.ranges[1] / x;
    for (int i = 0; i < roots_; ++i) x = uwbpos::square_root(x);
    last_ = x;
    return x;
  }

 private:
  int divisions_;
  int roots_;
  mutable double last_ = 0;
};

// The first contender is the fix; `pieces` are functions of a case and its number.
template <class Fix, class... Pieces>
std::vector<Piece> shares(const std::vector<Case>& all, const Fix& fix,
                          const std::pair<const char*, Pieces>&... pieces) {
  std::vector<Contender> contenders;
  const auto enter = [&](const auto& work) {
    contenders.push_back({all.size(), [&all, &work] {
                            for (std::size_t i = 0; i < all.size(); ++i) keep(work(all[i], i));
                          }});
  };
  enter(fix);
  (enter(pieces.second), ...);
  const Times times = race(contenders);
  std::vector<Piece> result;
  std::size_t i = 0;
  (result.push_back({pieces.first, times.ratios[++i]}), ...);
  return result;
}

inline std::vector<Piece> range_pieces() {
  using namespace uwbpos;
  const std::vector<Case> all = cases(512);
  const auto squares = [](const Case& c, std::size_t) {
    const RangeSpan<double, 3> view{c.toa};
    return range_squares<double, 3, double>(view, first_anchor<double, 3>(view));
  };
  std::vector<Vec<double, 3>> starts;
  for (const Case& c : all) {
    const auto found = squares(c, 0);
    starts.push_back({found.place[0], found.place[1], found.place[2]});
  }
  return shares(
      all, [](const Case& c, std::size_t) { return toa_least_squares(c.toa); },
      std::pair{"eight roots and divisions",
                [](const Case& c, std::size_t) { return roots_and_divisions(c); }},
      std::pair{"six divisions and a root that wait for each other", Chain{6, 1}},
      std::pair{"a starting point", squares},
      std::pair{"one evaluation of J, H and the gradient", [&](const Case& c, std::size_t i) {
                  const RangeSpan<double, 3> view{c.toa};
                  return range_normal<double, 3>(view, view[0].anchor, starts[i], {},
                                                 Curvature::Full);
                }});
}

inline std::vector<Piece> difference_pieces() {
  using namespace uwbpos;
  const std::vector<Case> all = cases(512);
  const auto view_of = [](const Case& c) {
    return DifferenceView<double, 3>{c.anchors[0], c.tdoa, kSigma};
  };
  const auto squares = [&](const Case& c, std::size_t) {
    const auto view = view_of(c);
    return square_minimum<double, 3, double>(view, first_anchor<double, 3>(view), 0.0);
  };
  std::vector<Numbers<double, 4>> starts;
  for (const Case& c : all) starts.push_back(squares(c, 0).minimum);
  return shares(
      all,
      [](const Case& c, std::size_t) { return tdoa_least_squares(c.anchors[0], c.tdoa, kSigma); },
      std::pair{"eight roots and divisions",
                [](const Case& c, std::size_t) { return roots_and_divisions(c); }},
      std::pair{"eight divisions and two roots that wait for each other", Chain{8, 2}},
      std::pair{"a starting point", squares},
      std::pair{"one evaluation of J, H and the gradient", [&](const Case& c, std::size_t i) {
                  const auto view = view_of(c);
                  return direct_profile<double, 3, Curvature::Full, double>(
                      view, first_anchor<double, 3>(view), 0.0, starts[i],
                      kSigma * kSigma / kAnchors, 0.0);
                }});
}

}  // namespace peers
