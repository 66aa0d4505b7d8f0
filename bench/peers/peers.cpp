// SPDX-License-Identifier: MIT
// Prints the table of ratios, Markdown. Answers come before times: `off` counts the cases whose χ²
// is more than a thousandth above the least that any contender found, and one of ours ends the
// program with an error. Peers compute no covariance, ours do.
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include <Eigen/Dense>

#include <uwbpos/accuracy/cramer_rao.hpp>
#include <uwbpos/solve/toa_closed_form.hpp>

#include "cases.hpp"
#include "pieces.hpp"
#include "small_races.hpp"
#include "timing.hpp"

namespace {

using namespace peers;

constexpr std::size_t kCases = 512;
constexpr double kWorse = 1e-3;  // of χ²: a thirtieth of a standard deviation
int failures = 0;

const double kNowhere = std::nan("");

template <class Problem>
Place ours(const Case& c);
template <>
Place ours<Toa>(const Case& c) {
  const auto fix = uwbpos::toa_least_squares(c.toa);
  keep(fix);
  return fix ? fix->position : Place::Constant(kNowhere);
}
template <>
Place ours<Tdoa>(const Case& c) {
  const auto fix = uwbpos::tdoa_least_squares(c.anchors[0], c.tdoa, kSigma);
  keep(fix);
  return fix ? fix->position : Place::Constant(kNowhere);
}

struct Scripted {
  std::vector<Place> places;
  double nanoseconds = kNowhere;
};

// The script solves the first `count` cases; empty where it cannot.
Scripted scipy(const std::string& script, const char* kind, const std::vector<Case>& all,
               std::size_t count) {
  Scripted result;
  if (script.empty()) return result;
  char name[] = "/tmp/uwbpos_peers_XXXXXX";
  const int file = mkstemp(name);
  if (file < 0) return result;
  {
    std::ofstream out{name};
    out.precision(17);
    for (std::size_t i = 0; i < count; ++i) {
      const Case& c = all[i];
      out << kind << ' ' << kSigma << ' ' << c.start.transpose();
      for (std::size_t k = 0; k < kAnchors; ++k) {
        out << ' ' << c.anchors[k].transpose() << ' ' << c.ranges[k];
      }
      out << '\n';
    }
  }
  std::vector<double> times;
  if (FILE* const pipe = popen(("python3 '" + script + "' < " + name).c_str(), "r")) {
    Place p;
    double spent;
    while (std::fscanf(pipe, "%lf %lf %lf %lf", &p[0], &p[1], &p[2], &spent) == 4) {
      result.places.push_back(p);
      times.push_back(spent);
    }
    pclose(pipe);
  }
  std::remove(name);
  if (result.places.size() != count) return {};
  result.nanoseconds = median(times);
  return result;
}

void row(const char* what, const char* name, double nanoseconds, double ratio, const char* target,
         const std::string& off) {
  std::printf("| %s | %s | %.4g ns | %.3g | %s | %s |\n", what, name, nanoseconds, ratio, target,
              off.c_str());
}

// How many of `found` are off the best of all.
template <class Problem>
std::string off(const std::vector<Case>& all, const std::vector<double>& best,
                const std::vector<Place>& found, std::size_t* count) {
  *count = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!(chi_squared<Problem>(all[i], found[i]) <= best[i] + kWorse)) ++*count;
  }
  return std::to_string(*count) + " of " + std::to_string(found.size());
}

// Returns what TinySolver takes of our time.
template <class Problem>
double least_squares(const std::string& script, const char* what, const char* kind,
                     const char* tiny_target, const char* solver_target) {
  const std::vector<Case> all = cases(kCases);
  using Solve = Place (*)(const Case&);
  struct Peer {
    const char* name;
    Solve solve;
    std::size_t calls;
    const char* target;
  };
  const Peer list[] = {
      {"uwbpos, with covariance", &ours<Problem>, kCases, ""},
      {"ceres::TinySolver", &ceres_tiny<Problem>, kCases, tiny_target},
      {"Eigen's Levenberg-Marquardt", &eigen_levenberg<Problem>, kCases, ""},
      {"ceres::Solver, DENSE_QR", &ceres_solver<Problem>, 32, solver_target},
  };
  std::vector<double> best(kCases, 1e300);
  std::vector<std::vector<Place>> found;
  const auto note = [&](std::vector<Place> places) {
    for (std::size_t i = 0; i < places.size(); ++i) {
      const double chi = chi_squared<Problem>(all[i], places[i]);
      if (chi < best[i]) best[i] = chi;
    }
    found.push_back(std::move(places));
  };
  for (const Peer& peer : list) {
    std::vector<Place> places;
    for (const Case& c : all) places.push_back(peer.solve(c));
    note(std::move(places));
  }
  const Scripted scripted = scipy(script, kind, all, 64);
  note(scripted.places);

  std::vector<Contender> contenders;
  for (const Peer& peer : list) {
    contenders.push_back({peer.calls, [&all, &peer] {
                            for (std::size_t i = 0; i < peer.calls; ++i) keep(peer.solve(all[i]));
                          }});
  }
  const Times times = race(contenders);
  std::size_t count = 0;
  for (std::size_t i = 0; i < std::size(list); ++i) {
    const std::string text = off<Problem>(all, best, found[i], &count);
    row(what, list[i].name, times.nanoseconds[i], times.ratios[i], list[i].target, text);
    if (i == 0 && count != 0) ++failures;
  }
  if (!scripted.places.empty()) {
    const std::string text = off<Problem>(all, best, scripted.places, &count);
    row(what, "SciPy's least_squares", scripted.nanoseconds,
        scripted.nanoseconds / times.nanoseconds[0], "", text);
  }
  return times.ratios[1];
}

void small(const char* what, const char* other, const char* target, const SmallRace& race) {
  row(what, "uwbpos", race.times.nanoseconds[0], 1, "", race.agree ? "agree" : "DIFFER");
  row(what, other, race.times.nanoseconds[1], race.times.ratios[1], target, "");
  if (!race.agree) ++failures;
}

// `times` rounds over eight cases of one row of the table, for instructions.py to count.
int repeat(const std::string& what, long times) {
  const std::pair<const char*, Place (*)(const Case&)> rows[] = {
      {"ranges", &ours<Toa>},
      {"ranges-tiny", &ceres_tiny<Toa>},
      {"differences", &ours<Tdoa>},
      {"differences-tiny", &ceres_tiny<Tdoa>}};
  const std::vector<Case> all = cases(8);
  for (const auto& [name, solve] : rows) {
    if (what != name) continue;
    for (long i = 0; i < times; ++i) {
      for (const Case& c : all) keep(solve(c));
    }
    return 0;
  }
  std::fprintf(stderr, "peers: no row %s\n", what.c_str());
  return 2;
}

}  // namespace

int main(int count, char** arguments) {
  if (count == 4 && std::string{arguments[1]} == "--repeat") {
    return repeat(arguments[2], std::atol(arguments[3]));
  }
  const std::string script = count > 1 ? arguments[1] : "";
  std::printf("| case (double) | contender | a call | ratio | target | answers off |\n");
  std::printf("|---|---|---:|---:|---|---|\n");
  const double ranges = least_squares<Toa>(script, "ranges, 3-D, 8 anchors", "toa", "≥ 6", "≥ 100");
  const double differences =
      least_squares<Tdoa>(script, "differences, 3-D, 8 anchors", "tdoa", "≥ 5", "≥ 80");
  small("three anchors on axes", "bare arithmetic", "≥ 1/1.5", on_axes());
  small("three anchors anywhere, 2-D", "bare arithmetic", "≥ 1/1.5", anywhere());
  small("filter update, 9 states", "dense Joseph", "≥ 8", filter_update<double>());
  small("filter update, 9 states, float", "dense Joseph", "≥ 8", filter_update<float>());
  small("network 21-50-50-1", "Eigen expression", "> 1", bias_network<double>());
  small("network 21-50-50-1, float", "Eigen expression", "> 1", bias_network<float>());
  const auto linear = by_anchors();
  std::printf("\nRanges in 3-D by the number of anchors, ns a call and an anchor:");
  for (const auto& [anchors, each] : linear) std::printf(" %d: %.3g", anchors, each);
  std::printf("\n");
  std::printf("\nA fix, and what it cannot do without, as shares of its time:\n");
  const auto tell = [](const char* what, const std::vector<Piece>& pieces, double share) {
    std::printf("%s:", what);
    for (const Piece& piece : pieces) std::printf(" %s %.2f;", piece.name, piece.share);
    std::printf(" the target asks for %.2f in all\n", share);
  };
  tell("ranges", range_pieces(), ranges / 6);
  tell("differences", difference_pieces(), differences / 5);
  if (failures != 0) std::printf("\n%d comparisons of answers FAILED\n", failures);
  return failures == 0 ? 0 : 1;
}
