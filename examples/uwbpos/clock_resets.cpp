// SPDX-License-Identifier: MIT
#include "clock_resets.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "statistics.hpp"

namespace uwbpos::host {
namespace {

using Rows = std::span<const Stamp>;
using Subject = std::array<std::uint32_t, 3>;

constexpr std::size_t kFewest = 8;     // rows that show that a clock was set
constexpr std::size_t kLookedAt = 32;  // rows whose order is looked at
constexpr double kForth = 1e8;         // a step forward that nothing else explains [s]

// How far below an earlier one a time lies [s].
double disorder(Rows rows) {
  double most = 0;
  double newest = -std::numeric_limits<double>::infinity();
  for (const Stamp& row : rows) {
    newest = std::max(newest, row.t);
    most = std::max(most, newest - row.t);
  }
  return most;
}

// What a row is of: its link, or, where pairs of anchors that chance chooses seldom come twice,
// each of its anchors in its place.
std::array<Subject, 2> subjects_of(const Stamp& row, bool coarse) {
  if (!coarse) return {row.link, row.link};
  return {Subject{row.link[0], row.link[1], 0xFFFF'FFFF},
          Subject{row.link[0], 0xFFFF'FFFF, row.link[2]}};
}

// All that a link told, by time.
class Told {
 public:
  void add(double t, double value) { all_.emplace_back(t, value); }
  void finish() {
    std::ranges::sort(all_);
    const std::vector<double> steps = steps_forward(all_, &std::pair<double, double>::first);
    if (steps.empty()) return;
    step_ = median(steps);
    const auto usual = std::ranges::count_if(
        steps, [&](double step) { return std::abs(step - step_) <= 0.2 * step_; });
    regular_ = steps.size() > 2 && 2 * static_cast<std::size_t>(usual) > steps.size();
  }

  // When it is to tell again; nothing of one without a rhythm.
  [[nodiscard]] std::optional<double> next() const {
    return regular_ ? std::optional{all_.back().first + step_} : std::nullopt;
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
  bool regular_ = false;
};

// What was told before a row of what follows.
struct Before {
  std::map<Subject, Told> told;
  double oldest;
  bool coarse;
};

// Of the rows `start` to `at`, those of times from `since` on and some more.
Before told_before(Rows rows, std::size_t start, std::size_t at, double since, std::size_t& work) {
  constexpr std::size_t least = 64;
  std::size_t first = at;
  Before before{{}, std::numeric_limits<double>::infinity(), false};
  for (; first > start && (at - first < least || rows[first - 1].t >= since); --first, ++work) {
    before.oldest = std::min(before.oldest, rows[first - 1].t);
  }
  const auto tell = [&] {
    before.told.clear();
    for (const Stamp& row : rows.subspan(first, at - first)) {
      for (const Subject& subject : subjects_of(row, before.coarse)) {
        before.told[subject].add(row.t, row.value);
      }
    }
  };
  tell();
  const auto of_pair = [](const Stamp& row) { return row.link[2] != 0; };
  if (at - first < 4 * before.told.size() &&
      std::ranges::any_of(rows.subspan(first, at - first), of_pair)) {
    before.coarse = true;
    tell();
  }
  for (auto& [subject, told] : before.told) told.finish();
  return before;
}

// By how much the rows from `at` on are to be moved so that each link goes on as it did [s].
double shift_at(Rows rows, std::size_t start, std::size_t at, double newest, const Before& before) {
  std::vector<double> shifts;
  std::set<Subject> seen;
  for (const Stamp& row : rows.subspan(at, std::min(2 * kLookedAt, rows.size() - at))) {
    if (!seen.insert(row.link).second || before.coarse) continue;
    const auto told = before.told.find(row.link);
    const auto next = told == before.told.end() ? std::nullopt : told->second.next();
    if (next) shifts.push_back(*next - row.t);
  }
  // A link that lost a row asks for a step less.
  if (!shifts.empty()) return quantile(std::move(shifts), 0.75);
  return newest - rows[at].t + usual_step(rows.subspan(start, at - start), &Stamp::t);
}

enum class Meaning : std::uint8_t { kNothing, kReset, kPart };

// What the step back at `at` means, `newest` the latest time before. Counts the rows that it looked
// at.
Meaning meaning_of(Rows rows, std::size_t start, std::size_t at, double newest, Before& before,
                   std::size_t& work) {
  const Rows here = rows.subspan(at, std::min(kLookedAt, rows.size() - at));
  const std::size_t back = std::min(kLookedAt, at - start);
  if (here.size() < kFewest || back < kFewest) return Meaning::kNothing;
  const auto behind = [&](const Stamp& row) { return row.t < newest; };
  if (!std::ranges::all_of(here.first(kFewest), behind)) return Meaning::kNothing;
  const double step = newest - here[0].t;
  const Rows there = rows.subspan(at - back, back);
  if (2 * disorder(here) > step || 2 * disorder(there) > step) return Meaning::kNothing;

  constexpr double more = 2;  // times the step back
  before = told_before(rows, start, at, here[0].t - std::max(kReorderWindow, more * step), work);
  std::size_t met = 0;  // rows of times that were told of before
  std::size_t covered = 0;
  std::size_t twice = 0;
  std::size_t known = 0;
  std::size_t looked = 0;
  double last = here[0].t;
  for (std::size_t i = at; i < rows.size(); ++i, ++work) {
    const Stamp& row = rows[i];
    if (row.t < last - kReorderWindow || row.t >= newest) break;
    last = std::max(last, row.t);
    ++looked;
    std::size_t heard = 0;
    std::size_t covers = 0;
    bool again = false;
    for (const Subject& subject : subjects_of(row, before.coarse)) {
      const auto told = before.told.find(subject);
      if (told == before.told.end()) continue;
      ++heard;
      covers += told->second.covers(row.t) ? 1 : 0;
      again = again || (!before.coarse && told->second.told(row.t, row.value));
    }
    known += heard == 2 ? 1 : 0;
    if (row.t < before.oldest) continue;
    ++met;
    covered += covers == 2 ? 1 : 0;
    twice += again ? 1 : 0;
  }
  if (8 * known < looked) return Meaning::kPart;
  // Of pairs, either anchor may be at rest for longer than it usually is.
  const std::size_t needed = before.coarse ? met / 4 : met / 2;
  if (met >= (before.coarse ? 2 * kFewest : kFewest)) {
    return covered >= needed && 2 * twice < met ? Meaning::kReset : Meaning::kNothing;
  }
  // Times that do not meet: a part that ends where the rest begins is one in the wrong order.
  const bool apart = met == 0 && 2 * known >= looked && last < before.oldest - kReorderWindow;
  return apart ? Meaning::kReset : Meaning::kNothing;
}

// Whether the rows from `at` on are of a clock that was set forward by years.
bool set_forward_at(Rows rows, std::size_t start, std::size_t at, double newest) {
  constexpr double times = 100;  // what the log took so far
  const double least = std::max(kForth, times * (newest - rows[start].t));
  if (at - start < kFewest || rows.size() - at < kFewest) return false;
  return std::ranges::all_of(rows.subspan(at, kFewest),
                             [&](const Stamp& row) { return row.t - newest > least; });
}

// Clocks are set now and then. One that is again and again overflows, and begins where it began.
bool plausible(const std::vector<ClockStep>& steps, Rows rows) {
  constexpr int few = 3;        // in a part
  constexpr double often = 30;  // [s]
  const double lowest = std::ranges::min_element(rows, {}, &Stamp::t)->t;
  const double highest = std::ranges::max_element(rows, {}, &Stamp::t)->t;
  int resets = 0;
  double since = rows.front().t;  // of the part, as mended
  double before = 0;              // by how much the rows before the step are moved
  for (const ClockStep& step : steps) {
    const double last = rows[step.row - 1].t + before;
    before = step.forth;
    if (!step.is_reset) {
      resets = 0;
      since = rows[step.row].t;
    }
    const bool overflow = rows[step.row].t - lowest < 0.1 * (highest - lowest);
    if (!step.is_reset || overflow) continue;
    ++resets;
    if (resets > few && last - since < often * resets) return false;
  }
  return true;
}

}  // namespace

std::vector<ClockStep> find_clock_steps(const std::vector<Stamp>& stamps) {
  const Rows rows{stamps};
  std::vector<ClockStep> found;
  double newest = -std::numeric_limits<double>::infinity();  // of rows from `start` on
  double forth = 0;
  std::size_t start = 0;
  std::size_t work = 0;
  const std::size_t enough = 32 * rows.size();  // in a log without any order there is nothing
  std::set<Subject> ever;                       // links of rows before `told`
  std::size_t told = 0;
  for (std::size_t i = 0; i < rows.size() && work <= enough; ++i) {
    const double t = rows[i].t;
    Before before;
    Meaning meaning = Meaning::kNothing;
    if (i > start && t < rows[i - 1].t) {
      meaning = meaning_of(rows, start, i, newest, before, work);
      if (meaning == Meaning::kPart) {
        // Links that were heard before, as by another gateway, go on with what comes.
        for (; told < i; ++told) ever.insert(rows[told].link);
        const Rows here = rows.subspan(i, std::min(kLookedAt, rows.size() - i));
        const auto is_new = [&](const Stamp& row) { return !ever.contains(row.link); };
        if (2 * static_cast<std::size_t>(std::ranges::count_if(here, is_new)) < here.size()) {
          meaning = Meaning::kNothing;
        }
      }
    } else if (i > start && set_forward_at(rows, start, i, newest)) {
      meaning = Meaning::kReset;
      before = told_before(rows, start, i, newest, work);
    }
    if (meaning != Meaning::kNothing) {
      const bool is_reset = meaning == Meaning::kReset;
      forth = is_reset ? forth + shift_at(rows, start, i, newest, before) : 0;
      if (!std::isfinite(forth)) break;
      if (is_reset || !found.empty()) found.push_back({i, forth, is_reset});
      start = i;
      newest = t;
    }
    newest = std::max(newest, t);
  }
  return found.empty() || plausible(found, rows) ? found : std::vector<ClockStep>{};
}

void align_clock_resets(const std::vector<LogClock>& logs) {
  constexpr double pause = 10;  // [s]
  std::size_t count = 0;
  for (const LogClock& log : logs) count = std::max(count, log.resets.size());
  for (std::size_t k = 0; k < count; ++k) {
    double most = -std::numeric_limits<double>::infinity();
    double least = std::numeric_limits<double>::infinity();
    for (const LogClock& log : logs) {
      if (log.resets.empty()) continue;
      if (log.resets.size() != count) return;
      most = std::max(most, log.resets[k].back);
      least = std::min(least, log.resets[k].back);
    }
    if (!(most - least < pause)) return;
    for (const LogClock& log : logs) {
      if (log.resets.empty()) continue;
      const double later = most - log.resets[k].back;
      log.moves(log.resets[k].t, later);
      for (std::size_t j = k; j < count; ++j) log.resets[j].t += later;
      log.resets[k].back = most;
    }
  }
}

}  // namespace uwbpos::host
