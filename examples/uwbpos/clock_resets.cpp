// SPDX-License-Identifier: MIT
#include "clock_resets.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <span>
#include <utility>

#include "formats.hpp"
#include "statistics.hpp"

namespace uwbpos::host {
namespace {

using Rows = std::span<const Stamp>;
using Link = std::array<std::uint32_t, 3>;

Link of(const Stamp& row, bool coarse) { return coarse ? Link{row.link[0], 0, 0} : row.link; }

constexpr std::size_t kFewest = 8;     // rows that show a clock set back
constexpr std::size_t kLookedAt = 32;  // rows whose order is looked at

double usual_step(Rows rows) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    if (rows[i].t > rows[i - 1].t) steps.push_back(rows[i].t - rows[i - 1].t);
  }
  return steps.empty() ? 0 : median(std::move(steps));
}

bool mostly_ascends(Rows rows) {
  std::size_t down = 0;
  for (std::size_t i = 1; i < rows.size(); ++i) down += rows[i].t < rows[i - 1].t ? 1 : 0;
  return 4 * down <= rows.size();
}

// All that a link told, by time.
class Told {
 public:
  void add(double t, double value) { all_.emplace_back(t, value); }
  void finish() {
    std::ranges::sort(all_);
    std::vector<double> steps;
    for (std::size_t i = 1; i < all_.size(); ++i) {
      if (all_[i].first > all_[i - 1].first) steps.push_back(all_[i].first - all_[i - 1].first);
    }
    if (!steps.empty()) step_ = median(std::move(steps));
  }

  // Whether it told of a time, give or take: a hole in what it tells leaves a step or more.
  [[nodiscard]] bool covers(double t) const {
    constexpr double within = 0.75;  // of a step
    const auto after = std::ranges::lower_bound(all_, t, {}, &std::pair<double, double>::first);
    double nearest = std::numeric_limits<double>::infinity();
    if (after != all_.end()) nearest = after->first - t;
    if (after != all_.begin()) nearest = std::min(nearest, t - std::prev(after)->first);
    return nearest <= within * step_;
  }
  [[nodiscard]] bool told(double t, double value) const {
    return std::ranges::binary_search(all_, std::pair{t, value});
  }

 private:
  std::vector<std::pair<double, double>> all_;
  double step_ = 0;
};

// Whether the clock was set back at `at`, `newest` the latest time before. Counts the rows that it
// looked at.
bool set_back_at(Rows rows, std::size_t start, std::size_t at, double newest, std::size_t& work) {
  const Rows here = rows.subspan(at, std::min(kLookedAt, rows.size() - at));
  const std::size_t back = std::min(kLookedAt, at - start);
  if (here.size() < kFewest || back < kFewest) return false;
  const auto behind = [&](const Stamp& row) { return row.t < newest; };
  if (!std::ranges::all_of(here.first(kFewest), behind)) return false;
  if (!mostly_ascends(here) || !mostly_ascends(rows.subspan(at - back, back))) return false;

  // What was told before, of the times that come again and some more.
  constexpr double more = 2;  // times the step back
  const double since = here[0].t - std::max(kReorderWindow, more * (newest - here[0].t));
  constexpr std::size_t least = 64;
  std::size_t first = at;
  double oldest = newest;
  for (; first > start && (at - first < least || rows[first - 1].t >= since); --first, ++work) {
    oldest = std::min(oldest, rows[first - 1].t);
  }
  std::map<Link, Told> before;
  const auto tell = [&](bool coarse) {
    before.clear();
    for (const Stamp& row : rows.subspan(first, at - first)) {
      before[of(row, coarse)].add(row.t, row.value);
    }
  };
  tell(false);
  // Pairs of anchors that chance chooses seldom come twice: all of a tag are one.
  const bool coarse = at - first < 4 * before.size();
  if (coarse) tell(true);
  for (auto& [link, told] : before) told.finish();

  std::size_t met = 0;  // rows of times that were told of before
  std::size_t covered = 0;
  std::size_t twice = 0;
  std::size_t known = 0;
  double last = here[0].t;
  for (std::size_t i = at; i < rows.size(); ++i, ++work) {
    const Stamp& row = rows[i];
    if (row.t < last - kReorderWindow || row.t >= newest) break;
    last = std::max(last, row.t);
    const auto told = before.find(of(row, coarse));
    if (told != before.end()) ++known;
    if (row.t < oldest) continue;
    ++met;
    if (told == before.end()) continue;
    covered += told->second.covers(row.t) ? 1 : 0;
    twice += told->second.told(row.t, row.value) ? 1 : 0;
  }
  if (met >= kFewest) return 2 * covered >= met && 2 * twice < met;
  // Times that do not meet: a part that ends where the rest begins is one in the wrong order.
  return met == 0 && 2 * known >= here.size() && last < oldest - kReorderWindow;
}

}  // namespace

std::vector<SetBack> find_set_backs(std::vector<Stamp> rows) {
  std::vector<SetBack> found;
  double newest = -std::numeric_limits<double>::infinity();
  std::size_t start = 0;
  std::size_t work = 0;
  const std::size_t enough = 32 * rows.size();  // in a log without any order there is nothing
  for (std::size_t i = 0; i < rows.size() && work <= enough; ++i) {
    const double t = rows[i].t;
    if (i > 0 && t < rows[i - 1].t && set_back_at(rows, start, i, newest, work)) {
      const double forth = newest - t + usual_step(Rows{rows}.subspan(start, i - start));
      const auto later = Rows{rows}.subspan(i);
      if (!std::ranges::all_of(later, [&](const Stamp& s) { return std::isfinite(s.t + forth); })) {
        break;
      }
      for (std::size_t k = i; k < rows.size(); ++k) rows[k].t += forth;
      found.push_back({i, forth});
      start = i;
    }
    newest = std::max(newest, rows[i].t);
  }
  return found;
}

}  // namespace uwbpos::host
