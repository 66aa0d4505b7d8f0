// SPDX-License-Identifier: MIT
#include "plots.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "uwbpos/core/chi_squared.hpp"

#include "gnuplot.hpp"
#include "scoring.hpp"
#include "statistics.hpp"

namespace uwbpos::host {
namespace {

constexpr std::size_t kMostDots = 3000;
constexpr std::size_t kBins = 160;
constexpr double kPause = 1;  // a line is broken over a longer gap in time [s]

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  [[nodiscard]] double length() const { return high - low; }
};

// What all plots share. Sizes are those of a phone; larger screens scale the picture.
std::string preamble(int width, int height) {
  const std::string text = ink(Ink::kText);
  const std::string muted = ink(Ink::kMuted);
  return fmt::format(
      "set terminal svg size {},{} dynamic enhanced font 'sans-serif,13'\n"
      "set border 3 lc {} lw 1\nset tics nomirror scale 0.5 tc {}\n"
      "set grid lc {} lw 1 dt 1\nset xlabel tc {} offset 0,0.3\nset ylabel tc {} offset 1,0\n"
      "set lmargin 7.5\nset rmargin 1.5\nset tmargin 1\nset bmargin 3.2\n"
      "set key off\nset encoding utf8\n",
      width, height, muted, text, ink(Ink::kGrid), muted, muted);
}

Figure finish(std::string title, const std::string& script, std::string_view prefix,
              std::string caption) {
  Figure figure{std::move(title), std::nullopt, std::move(caption)};
  if (const auto svg = run_gnuplot(script)) figure.svg = page_svg(*svg, prefix, figure.title);
  return figure;
}

template <class... Arguments>
void line(std::string& text, fmt::format_string<Arguments...> format, Arguments&&... arguments) {
  fmt::format_to(std::back_inserter(text), format, std::forward<Arguments>(arguments)...);
  text += '\n';
}

std::size_t stride_for(std::size_t count, std::size_t most) {
  return std::max<std::size_t>(1, (count + most - 1) / most);
}

std::string thinned(std::size_t stride) {
  return stride > 1 ? fmt::format(" One position in {} is drawn.", stride) : std::string{};
}

std::string label_metres(double value) {
  if (value < 0.0995) return fmt::format("{:.1f} cm", 100 * value);
  return value < 0.995 ? fmt::format("{:.0f} cm", 100 * value) : fmt::format("{:.2f} m", value);
}

// Tags in the order of their ids; the place is the colour.
std::vector<Id> tags_of(const Replay& replay) {
  std::vector<Id> tags;
  for (const auto& [tag, outcome] : replay.of_tag) tags.push_back(tag);
  return tags;
}

// The errors of scored positions, ascending.
std::vector<double> sorted_errors(const Replay& replay) {
  std::vector<double> errors;
  for (const Position& p : replay.track) {
    if (p.truth) errors.push_back(error_length(p.position - *p.truth, replay.dim));
  }
  std::ranges::sort(errors);
  return errors;
}

// How far an axis of errors reaches: to the largest, unless a few outliers would flatten the rest.
double error_limit(const std::vector<double>& ascending) {
  const double most = ascending.back();
  const double usual = 1.6 * quantile_of_sorted(ascending, 0.99);
  return std::max(1.05 * std::min(most, usual), 1e-3);
}

std::string beyond(const std::vector<double>& ascending, double limit) {
  const auto above = ascending.end() - std::ranges::upper_bound(ascending, limit);
  if (above == 0) return "";
  return fmt::format(" {} beyond the axis, up to {}.",
                     above == 1 ? std::string{"One lies"} : fmt::format("{} lie", above),
                     label_metres(ascending.back()));
}

// Headings at some forty places, as arrows of the given length.
std::string heading_arrows(const Body& body, double length) {
  constexpr std::size_t most = 40;
  std::string data = "$headings << EOD\n";
  const std::size_t stride = stride_for(body.track.size(), most);
  for (std::size_t i = 0; i < body.track.size(); i += stride) {
    const LevelPose<double>& pose = body.track[i].pose;
    line(data, "{:.3f} {:.3f} {:.4f} {:.4f}", pose.position.x(), pose.position.y(),
         length * std::cos(pose.heading), length * std::sin(pose.heading));
  }
  return data + "EOD\n";
}

// The share of measurements that were refused, by time, as heights up to `whole`.
std::string refused_shares(const Filtering& filtering, double start, double span, double whole) {
  std::vector<double> used(kBins, 0);
  std::vector<double> refused(kBins, 0);
  const auto count = [&](std::vector<double>& bins, double t) {
    const double bin = (t - start) / span * static_cast<double>(kBins);
    if (bin >= 0) ++bins[std::min(static_cast<std::size_t>(bin), kBins - 1)];
  };
  for (const Innovated& i : filtering.innovations) count(used, i.t);
  for (const RefusedMeasurement& r : filtering.refusals) count(refused, r.t);
  std::string data = "$refused << EOD\nNaN NaN\n";
  for (std::size_t i = 0; i < kBins; ++i) {
    if (refused[i] == 0) continue;
    line(data, "{:.3f} {:.5f}", (static_cast<double>(i) + 0.5) * span / static_cast<double>(kBins),
         whole * refused[i] / (refused[i] + used[i]));
  }
  return data + "EOD\n";
}

// Ellipses that hold 95 of 100, at some thirty places, ascending in time.
std::string spread_ellipses(const Filtering& filtering) {
  constexpr std::size_t most = 30;
  constexpr double quantile = 5.991;  // χ² of two
  std::string data = "$spreads << EOD\nNaN NaN NaN NaN NaN\n";
  const std::size_t stride = stride_for(filtering.spreads.size(), most);
  for (std::size_t i = 0; i < filtering.spreads.size(); i += stride) {
    const PositionSpread& s = filtering.spreads[i];
    const double mean = (s.covariance(0, 0) + s.covariance(1, 1)) / 2;
    const double half = (s.covariance(0, 0) - s.covariance(1, 1)) / 2;
    const double off = std::hypot(half, s.covariance(0, 1));
    const double angle = radians_to_degrees(std::atan2(s.covariance(0, 1), half) / 2);
    line(data, "{:.3f} {:.3f} {:.4f} {:.4f} {:.1f}", s.position.x(), s.position.y(),
         2 * std::sqrt(quantile * (mean + off)),
         2 * std::sqrt(quantile * std::max(mean - off, 0.0)), angle);
  }
  return data + "EOD\n";
}

// One quantity over time, as dots, and its name.
struct Course {
  std::string name;
  std::vector<std::pair<double, double>> points;  ///< time, value
};

// Courses over one axis of time, the first on the left axis, a second on the right one.
std::string course_script(const std::vector<Course>& courses,
                          const std::vector<std::string>& axes) {
  std::string script = preamble(520, 300);
  Range time;
  for (std::size_t i = 0; i < courses.size(); ++i) {
    std::string data;
    const std::size_t stride = stride_for(courses[i].points.size(), kMostDots);
    for (std::size_t j = 0; j < courses[i].points.size(); ++j) {
      time.include(courses[i].points[j].first);
      if (j % stride != 0) continue;
      line(data, "{:.3f} {:.5f}", courses[i].points[j].first, courses[i].points[j].second);
    }
    line(script, "$course{} << EOD\nNaN NaN\n{}EOD", i, data);
  }
  line(script, "set xrange [0:{:.4f}]", std::max(time.high, 1e-9));
  line(script, "set xlabel 'time since the first position [s]'\nset ylabel '{}'", axes[0]);
  if (axes.size() > 1) {
    line(script, "set rmargin 8\nset ytics nomirror\nset y2tics tc {}\nset y2label '{}' tc {}",
         ink(Ink::kText), axes[1], ink(Ink::kMuted));
  }
  line(
      script,
      "set tmargin 2.6\nset key at graph 0.5, screen 0.985 center top horizontal tc {} samplen 1.2 "
      "width -1 maxrows 1",
      ink(Ink::kText));
  line(script, "set xzeroaxis lc {} lw 1.2", ink(Ink::kMuted));
  script += "plot ";
  for (std::size_t i = 0; i < courses.size(); ++i) {
    const char* axis = axes.size() > 1 && i > 0 ? "axes x1y2 " : "";
    line(script, "$course{} {}with points pt 7 ps 0.22 lc {} notitle, \\", i, axis, series_ink(i));
    line(script, "NaN with points pt 7 ps 0.8 lc {} title '{}'{}", series_ink(i), courses[i].name,
         i + 1 < courses.size() ? ", \\" : "");
  }
  return script;
}

}  // namespace

Figure nis_figure(const Replay& replay) {
  const std::vector<Innovated>& all = replay.filtering->innovations;
  const std::size_t each = std::max<std::size_t>(20, stride_for(all.size(), 200));
  const auto n = static_cast<double>(each);
  // A mean of n squares of standard normals stays between these 95 times in 100.
  constexpr double z = 1.96;
  const double low = chi_squared_gate(static_cast<int>(each), -z) / n;
  const double high = chi_squared_gate(static_cast<int>(each), z) / n;
  std::string data = "$nis << EOD\nNaN NaN\n";
  std::vector<double> means;
  for (std::size_t first = 0; first + each <= all.size(); first += each) {
    double mean = 0;
    for (std::size_t i = first; i < first + each; ++i) mean += all[i].normalised / n;
    line(data, "{:.3f} {:.4f}", all[first + each / 2].t - replay.track.front().t, mean);
    means.push_back(mean);
  }
  data += "EOD\n";
  std::ranges::sort(means);
  const bool any = !means.empty();
  const double top = any ? std::max(high, quantile_of_sorted(means, 0.99)) : high;
  std::string script = preamble(520, 300) + data;
  line(script, "set xrange [0:{:.4f}]\nset yrange [0:{:.4f}]",
       std::max(replay.track.back().t - replay.track.front().t, 1e-9), 1.15 * top);
  line(script, "set xlabel 'time since the first position [s]'\nset ylabel 'NIS'");
  line(script,
       "set object 1 rectangle from graph 0, first {:.5f} to graph 1, first {:.5f} behind fc {} "
       "fs transparent solid 0.18 noborder",
       low, high, series_ink(1));
  line(script, "set arrow 1 from graph 0, first 1 to graph 1, first 1 nohead lc {} lw 1.2",
       ink(Ink::kMuted));
  line(script, "plot $nis with points pt 7 ps 0.35 lc {}", series_ink(0));
  const double overall = any ? mean(means) : 0;
  const auto within = std::ranges::count_if(means, [&](double m) { return m >= low && m <= high; });
  const double inside =
      any ? 100 * static_cast<double>(within) / static_cast<double>(means.size()) : 0;
  std::string caption = fmt::format(
      "Squares of innovations over their variances, means of {} in a row. Noises as they were "
      "taken "
      "to be would put 95 of 100 into the band: {:.0f} are, their mean is {:.2f}.",
      each, inside, overall);
  if (any && overall < low) {
    caption += " Below it: the radio is better than its sigmas say.";
  } else if (any && overall > high) {
    caption += " Above it: noise or motion is larger than the filter thinks, or errors are biases.";
  }
  return finish("Innovations (NIS)", script, "nis", caption);
}

Replay drawn(const Replay& replay) {
  if (!replay.body) return replay;
  Replay view;
  view.dim = replay.dim;
  view.filtering = replay.filtering;
  view.body = replay.body;
  view.all = outcome_of(*replay.body);
  view.of_tag = {{0, view.all}};
  for (const SolvedPose& p : replay.body->track) {
    view.track.push_back({p.t, 0, p.pose.position, p.chi_squared, p.degrees_of_freedom, p.readings,
                          p.chosen_by_prior, std::nullopt});
    if (p.truth) view.track.back().truth = p.truth->position;
  }
  return view;
}

Figure heading_figure(const Body& body) {
  Course course{"heading", {}};
  std::vector<double> sizes;
  for (const SolvedPose& p : body.track) {
    if (!p.truth || !p.heading_known) continue;
    const double error =
        radians_to_degrees(angle_difference(p.pose.heading, heading_of(p.truth->rotation)));
    course.points.emplace_back(p.t - body.track.front().t, error);
    sizes.push_back(std::abs(error));
  }
  std::ranges::sort(sizes);
  const double limit = error_limit(sizes);
  std::string script = course_script({course}, {"error of heading [deg]"});
  const std::size_t plot = script.rfind("plot ");
  script.insert(plot, fmt::format("set yrange [{:.4f}:{:.4f}]\nset key off\n", -limit, limit));
  const auto above = sizes.end() - std::ranges::upper_bound(sizes, limit);
  return finish("Error of heading over time", script, "heading",
                "Solved minus true heading, counter-clockwise positive." +
                    (above > 0 ? fmt::format(" {} beyond the axis, up to {:.0f} degrees.", above,
                                             sizes.back())
                               : std::string{}));
}

Figure twist_figure(const std::vector<BodyTwist>& twists) {
  Course forward{"forward", {}};
  Course turning{"turn rate", {}};
  for (const BodyTwist& t : twists) {
    const double since = t.t - twists.front().t;
    forward.points.emplace_back(since, t.twist.body_velocity.x());
    turning.points.emplace_back(since, radians_to_degrees(t.twist.turn_rate));
  }
  return finish("Velocity over time",
                course_script({forward, turning}, {"forward [m/s]", "turn rate [deg/s]"}), "twist",
                "Forward velocity and turn rate of the body, each between two poses.");
}

Figure target_figure(const std::vector<SeenTarget>& seen) {
  Course distance{"distance", {}};
  Course bearing{"bearing", {}};
  for (const SeenTarget& s : seen) {
    const double since = s.t - seen.front().t;
    distance.points.emplace_back(since, s.target.distance);
    bearing.points.emplace_back(since, radians_to_degrees(s.target.bearing));
  }
  std::string script = course_script({distance, bearing}, {"distance [m]", "bearing [deg]"});
  script.insert(script.rfind("plot "), "set yrange [0:*]\nset y2range [-180:180]\nset y2tics 60\n");
  return finish("Target over time", script, "target",
                "Distance and bearing of the target from the body; bearings count from its forward "
                "axis, to the left.");
}

Figure map_figure(const Replay& replay, const Points& anchors,
                  const std::optional<Vec<double, 2>>& target) {
  Range x;
  Range y;
  for (const auto& [id, position] : anchors) {
    x.include(position.x());
    y.include(position.y());
  }
  if (target) {
    x.include(target->x());
    y.include(target->y());
  }
  std::vector<double> xs;
  std::vector<double> ys;
  for (const Position& p : replay.track) {
    xs.push_back(p.position.x());
    ys.push_back(p.position.y());
    if (p.truth) {
      x.include(p.truth->x());
      y.include(p.truth->y());
    }
  }
  std::ranges::sort(xs);
  std::ranges::sort(ys);
  constexpr double tail = 0.01;
  for (const double fraction : {tail, 1 - tail}) {
    if (xs.empty()) break;
    x.include(quantile_of_sorted(xs, fraction));
    y.include(quantile_of_sorted(ys, fraction));
  }
  const double margin = std::max(0.07 * std::max(x.length(), y.length()), 0.2);
  x = {x.low - margin, x.high + margin};
  y = {y.low - margin, y.high + margin};

  const int width = 520;
  const int height =
      static_cast<int>(std::clamp(100 + (width - 84) * y.length() / x.length(), 260.0, 700.0));
  const std::size_t stride = stride_for(replay.track.size(), kMostDots);
  const std::vector<Id> tags = tags_of(replay);
  std::string data = "$anchors << EOD\n";
  for (const auto& [id, position] : anchors) {
    line(data, "{:.4f} {:.4f} {}", position.x(), position.y(), id);
  }
  data += "EOD\n";
  std::size_t outside = 0;
  for (std::size_t i = 0; i < tags.size(); ++i) {
    std::string truth;
    std::string track;
    double last = 0;
    std::size_t count = 0;
    for (const Position& p : replay.track) {
      if (p.tag != tags[i]) continue;
      const bool inside = p.position.x() >= x.low && p.position.x() <= x.high &&
                          p.position.y() >= y.low && p.position.y() <= y.high;
      outside += inside ? 0 : 1;
      const bool drawn = count++ % stride == 0;
      if (drawn && inside) line(track, "{:.3f} {:.3f}", p.position.x(), p.position.y());
      if (!p.truth || !drawn) continue;
      if (p.t - last > kPause * static_cast<double>(stride)) truth += '\n';
      line(truth, "{:.3f} {:.3f}", p.truth->x(), p.truth->y());
      last = p.t;
    }
    data +=
        fmt::format("$truth{} << EOD\n{}EOD\n$track{} << EOD\n{}EOD\n", i,
                    truth.empty() ? "NaN NaN\n" : truth, i, track.empty() ? "NaN NaN\n" : track);
  }
  const bool with_headings = replay.body && !replay.body->track.empty();
  if (with_headings) data += heading_arrows(*replay.body, 0.05 * std::max(x.length(), y.length()));
  if (target) line(data, "$target << EOD\n{:.4f} {:.4f}\nEOD", target->x(), target->y());
  if (replay.filtering) data += spread_ellipses(*replay.filtering);
  std::string script = preamble(width, height) + data;
  line(script, "set size ratio -1\nset xrange [{:.4f}:{:.4f}]\nset yrange [{:.4f}:{:.4f}]", x.low,
       x.high, y.low, y.high);
  line(script, "set xlabel 'x [m]'\nset ylabel 'y [m]'");
  line(
      script,
      "set tmargin 2.6\nset key at graph 0.5, screen 0.985 center top horizontal tc {} samplen 1.2 "
      "width -1 maxrows 1",
      ink(Ink::kText));
  if (replay.filtering) line(script, "set tmargin 3.6");
  script += "plot ";
  for (std::size_t i = 0; i < tags.size() && replay.all.scored > 0; ++i) {
    line(script, "$truth{} with lines lc {} lw 1.2 {}, \\", i, ink(Ink::kTruth),
         i == 0 ? "title 'truth'" : "notitle");
  }
  for (std::size_t i = 0; i < tags.size(); ++i) {
    const std::string name = replay.body        ? std::string{"body"}
                             : tags.size() == 1 ? std::string{"track"}
                                                : fmt::format("tag {}", tags[i]);
    line(script, "$track{} with points pt 7 ps 0.22 lc {} notitle, \\", i, series_ink(i));
    // The key shows a larger dot than the map.
    line(script, "NaN with points pt 7 ps 0.8 lc {} title '{}', \\", series_ink(i), name);
  }
  if (with_headings) {
    line(script,
         "$headings using 1:2:3:4 with vectors head size screen 0.012,22 filled lc {} lw 1.3 "
         "title 'heading', \\",
         ink(Ink::kMark));
  }
  if (target) {
    line(script, "$target using 1:2 with points pt 2 ps 1.3 lw 2.5 lc {} title 'target', \\",
         ink(Ink::kMark));
  }
  if (replay.filtering) {
    line(script,
         "$spreads using 1:2:3:4:5 with ellipses units xx fs empty border lc {} lw 1.2 notitle, \\",
         ink(Ink::kWorst));
    line(script, "NaN with lines lc {} lw 1.6 title '95 %', \\", ink(Ink::kWorst));
  }
  line(script, "$anchors using 1:2 with points pt 9 ps 1.1 lc {} title 'anchor', \\",
       ink(Ink::kAnchor));
  line(script, "$anchors using 1:2:3 with labels offset 0,0.8 font ',12' tc {} notitle",
       ink(Ink::kText));
  std::string caption = "Plan view, one metre as long in x as in y; anchors by their ids.";
  if (with_headings) caption += " Arrows: headings as solved, some of them.";
  if (replay.filtering) {
    caption += " Ellipses: where the filter holds the body to be, 95 in 100, at some places.";
  }
  caption += thinned(stride);
  if (outside > 0) {
    caption += fmt::format(" {} {} outside the map.", outside,
                           outside == 1 ? "position lies" : "positions lie");
  }
  return finish("Map", script, "map", caption);
}

Figure time_figure(const Replay& replay) {
  const std::vector<double> ascending = sorted_errors(replay);
  const double limit = error_limit(ascending);
  const double start = replay.track.front().t;
  const std::vector<Id> tags = tags_of(replay);
  const std::size_t stride = stride_for(ascending.size(), kMostDots);
  const double span = std::max(replay.track.back().t - start, 1e-9);
  std::vector<std::vector<double>> bins(kBins);
  std::string data;
  for (std::size_t i = 0; i < tags.size(); ++i) {
    data += fmt::format("$error{} << EOD\nNaN NaN\n", i);
    std::size_t count = 0;
    for (const Position& p : replay.track) {
      if (p.tag != tags[i] || !p.truth) continue;
      const double error = error_length(p.position - *p.truth, replay.dim);
      const auto bin = static_cast<std::size_t>((p.t - start) / span * kBins);
      bins[std::min(bin, kBins - 1)].push_back(error);
      if (count++ % stride == 0 && error <= limit) line(data, "{:.3f} {:.4f}", p.t - start, error);
    }
    data += "EOD\n";
  }
  data += "$median << EOD\nNaN NaN\n";
  for (std::size_t i = 0; i < kBins; ++i) {
    if (bins[i].empty()) {
      data += '\n';
    } else {
      line(data, "{:.3f} {:.4f}", (static_cast<double>(i) + 0.5) * span / kBins, median(bins[i]));
    }
  }
  data += "EOD\n";
  if (replay.filtering) data += refused_shares(*replay.filtering, start, span, limit / 3);
  std::string script = preamble(520, 300) + data;
  line(script, "set xrange [0:{:.4f}]\nset yrange [0:{:.4f}]", span, limit);
  line(script, "set xlabel 'time since the first position [s]'\nset ylabel 'error [m]'");
  line(
      script,
      "set tmargin 2.6\nset key at graph 0.5, screen 0.985 center top horizontal tc {} samplen 1.2 "
      "width -1 maxrows 1",
      ink(Ink::kText));
  script += "plot ";
  for (std::size_t i = 0; i < tags.size(); ++i) {
    line(script, "$error{} with points pt 7 ps 0.22 lc {} notitle, \\", i, series_ink(i));
    line(script, "NaN with points pt 7 ps 0.8 lc {} title '{}', \\", series_ink(i),
         tags.size() == 1 ? std::string{"position"} : fmt::format("tag {}", tags[i]));
  }
  if (replay.filtering) {
    line(script, "$refused with impulses lc {} lw 1.2 notitle, \\", ink(Ink::kWorst));
    line(script, "NaN with lines lc {} lw 2 title 'refused', \\", ink(Ink::kWorst));
  }
  line(script, "$median with lines lc {} lw 1.8 title 'median'", ink(Ink::kText));
  return finish("Error over time", script, "time",
                std::string{"Distance of each position from the truth at its time; the line is the "
                            "median of successive stretches."} +
                    (replay.filtering ? " Bars from below: the share of measurements that the gate "
                                        "refused, a third of the height for all of them."
                                      : "") +
                    thinned(stride) + beyond(ascending, limit));
}

Figure distribution_figure(const Replay& replay) {
  const std::vector<double> ascending = sorted_errors(replay);
  const double limit = error_limit(ascending);
  constexpr int steps = 400;
  std::string script = preamble(520, 300) + "$share << EOD\n";
  for (int i = 0; i <= steps; ++i) {
    const double share = static_cast<double>(i) / steps;
    const double error = quantile_of_sorted(ascending, share);
    if (error <= limit) line(script, "{:.5f} {:.4f}", error, 100 * share);
  }
  const auto within = std::ranges::upper_bound(ascending, limit);
  line(script, "{:.5f} {:.4f}", limit,
       100 * static_cast<double>(within - ascending.begin()) /
           static_cast<double>(ascending.size()));
  script += "EOD\n$marks << EOD\n";
  constexpr double marked[] = {0.5, 0.9, 0.95};
  for (const double share : marked) {
    line(script, "{:.5f} {:.1f}", quantile_of_sorted(ascending, share), 100 * share);
  }
  script += "EOD\n";
  line(script, "set xrange [0:{:.5f}]\nset yrange [0:100]\nset ytics 20", limit);
  line(script, "set xlabel 'error [m]'\nset ylabel 'share of positions [%]'");
  int arrow = 1;
  for (const double share : marked) {
    const double error = quantile_of_sorted(ascending, share);
    line(script, "set arrow {} from {:.5f},0 to {:.5f},{:.1f} nohead lc {} lw 1 dt (4,3)", arrow,
         error, error, 100 * share, ink(Ink::kMark));
    line(script, "set arrow {} from 0,{:.1f} to {:.5f},{:.1f} nohead lc {} lw 1 dt (4,3)",
         arrow + 1, 100 * share, error, 100 * share, ink(Ink::kMark));
    // Side by side where the marks are close: 90 % above, 95 % below would collide. Where they
    // leave no room to the right, under the curve.
    const bool middle = share < 0.6;
    const double at = quantile_of_sorted(ascending, middle ? 0.5 : 0.95);
    const bool narrow = at > 0.75 * limit;
    const double height =
        middle ? (narrow ? 36 : 46) : (share < 0.92 ? 74 : 84) - (narrow ? 62 : 0);
    line(script, "set label {} '{:.0f} %: {}' at {:.5f},{:.1f} offset {} tc {}", arrow, 100 * share,
         label_metres(error), narrow && !middle ? quantile_of_sorted(ascending, 0.9) : at, height,
         narrow ? "-0.8,0 right" : "0.8,0 left", ink(Ink::kText));
    arrow += 2;
  }
  line(script, "plot $share with lines lc {} lw 2, $marks with points pt 7 ps 0.7 lc {}",
       series_ink(0), ink(Ink::kMark));
  return finish(
      "Distribution of errors", script, "share",
      "How many positions are no farther from the truth than that." + beyond(ascending, limit));
}

Figure height_figure(const Replay& replay) {
  const double start = replay.track.front().t;
  const std::size_t stride = stride_for(replay.track.size(), kMostDots);
  std::vector<double> heights;
  for (const Position& p : replay.track) heights.push_back(p.position.z());
  std::ranges::sort(heights);
  Range z{quantile_of_sorted(heights, 0.01), quantile_of_sorted(heights, 0.99)};
  std::string track;
  std::string truth;
  std::size_t count = 0;
  for (const Position& p : replay.track) {
    if (p.truth) z.include(p.truth->z());
    if (count++ % stride != 0) continue;
    line(track, "{:.3f} {:.4f}", p.t - start, p.position.z());
    if (p.truth) line(truth, "{:.3f} {:.4f}", p.t - start, p.truth->z());
  }
  const double margin = std::max(0.1 * z.length(), 0.1);
  std::string script = preamble(520, 300);
  line(script, "$track << EOD\n{}EOD\n$truth << EOD\nNaN NaN\n{}EOD", track, truth);
  line(script, "set yrange [{:.4f}:{:.4f}]", z.low - margin, z.high + margin);
  line(script, "set xrange [0:{:.4f}]", std::max(replay.track.back().t - start, 1e-9));
  line(script, "set xlabel 'time since the first position [s]'\nset ylabel 'z [m]'");
  line(script, "plot $track with points pt 7 ps 0.22 lc {}, $truth with points pt 7 ps 0.22 lc {}",
       series_ink(0), ink(Ink::kTruth));
  return finish("Height over time", script, "height",
                replay.all.scored > 0
                    ? "Coloured: solved; grey: truth. The axis leaves out the extreme 2 %."
                    : "The axis leaves out the extreme 2 %.");
}

Figure residual_figure(const Replay& replay, const std::vector<AnchorQuality>& worst_first) {
  constexpr std::size_t most = 24;
  std::vector<AnchorQuality> shown{
      worst_first.begin(),
      worst_first.begin() + static_cast<std::ptrdiff_t>(std::min(most, worst_first.size()))};
  std::ranges::sort(shown, [](const auto& a, const auto& b) { return a.anchor < b.anchor; });
  std::string script = preamble(520, 300) + "$boxes << EOD\n";
  std::string tics;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const std::vector<double>& q = shown[i].quantiles;
    const bool worst = shown.size() > 1 && shown[i].anchor == worst_first.front().anchor;
    line(script, "{} {:.5f} {:.5f} {:.5f} {:.5f} {:.5f} {}", i, q[1], q[0], q[4], q[3], q[2],
         worst ? 1 : 0);
    tics += fmt::format("{}'{}' {}", i == 0 ? "" : ",", shown[i].anchor, i);
  }
  script += "EOD\n";
  line(script, "set xrange [-0.7:{:.1f}]", static_cast<double>(shown.size()) - 0.3);
  line(script, "set xtics ({}){}\nset boxwidth 0.5\nunset grid\nset grid ytics lc {} dt 1", tics,
       shown.size() > 12 ? " rotate by 45 right font ',10'" : "", ink(Ink::kGrid));
  line(script, "set xlabel 'anchor'\nset ylabel 'residual [m]'\nset style fill solid 0.35 border");
  line(script, "set xzeroaxis lc {} lw 1.4", ink(Ink::kMuted));
  line(script,
       "plot $boxes using ($7==0?$1:NaN):2:3:4:5 with candlesticks whiskerbars 0.6 lc {} lw 1.3, "
       "$boxes using ($7==1?$1:NaN):2:3:4:5 with candlesticks whiskerbars 0.6 lc {} lw 1.3, "
       "$boxes using 1:6:6:6:6 with candlesticks lc {} lw 2",
       series_ink(0), ink(Ink::kWorst), ink(Ink::kText));
  std::string caption =
      replay.of_differences
          ? fmt::format(
                "Measured minus {} difference; each counts for both of its anchors, with the "
                "sign that a range to that anchor would have.",
                replay.residuals_to_truth ? "true" : "solved")
      : replay.residuals_to_truth
          ? "Measured minus true range, after the bias table if there is one."
          : "Measured range minus distance from the solved position to the anchor.";
  caption += " Box: the middle half, with the median; whiskers: 5 to 95 %.";
  if (worst_first.size() > 1) caption += " The worst anchor has a colour of its own.";
  if (worst_first.size() > most) {
    caption += fmt::format(" The {} worst of {} anchors.", most, worst_first.size());
  }
  return finish("Residuals of each anchor", script, "residual", caption);
}

Figure range_error_figure(const std::vector<ScoredRange>& ranges) {
  struct Method {
    const char* name;
    std::string data;
    bool any = false;
  };
  Method methods[] = {{"ranged here", {}}, {"as logged", {}}, {"clocks not corrected", {}}};
  const std::size_t stride = stride_for(ranges.size(), kMostDots / 3);
  std::vector<double> errors;
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const ScoredRange& range = ranges[i];
    // Not every so-manieth: that would fall in step with the links.
    constexpr double golden = 0.6180339887498949;
    const double place = golden * static_cast<double>(i);
    const bool drawn = (place - std::floor(place)) * static_cast<double>(stride) < 1;
    const std::optional<double> values[] = {range.range, range.logged, range.uncorrected};
    for (std::size_t m = 0; m < std::size(methods); ++m) {
      if (!values[m]) continue;
      errors.push_back(*values[m] - range.truth);
      methods[m].any = true;
      if (drawn) line(methods[m].data, "{:.4f} {:.4f}", range.truth, errors.back());
    }
  }
  std::ranges::sort(errors);
  Range y{quantile_of_sorted(errors, 0.005), quantile_of_sorted(errors, 0.995)};
  y.include(0);
  const double margin = std::max(0.15 * y.length(), 0.01);
  std::string script = preamble(520, 340);
  for (std::size_t m = 0; m < std::size(methods); ++m) {
    line(script, "$method{} << EOD\nNaN NaN\n{}EOD", m, methods[m].data);
  }
  line(script, "set yrange [{:.4f}:{:.4f}]\nset offsets graph 0.02, graph 0.02", y.low - margin,
       y.high + margin);
  line(script, "set xlabel 'true distance [m]'\nset ylabel 'error of the range [m]'");
  line(script, "set xzeroaxis lc {} lw 1.4", ink(Ink::kMuted));
  line(
      script,
      "set tmargin 2.6\nset key at graph 0.5, screen 0.985 center top horizontal tc {} samplen 1.2 "
      "width -1 maxrows 1",
      ink(Ink::kText));
  script += "plot ";
  for (const std::size_t m : {2uz, 1uz, 0uz}) {
    if (!methods[m].any) continue;
    line(script, "$method{} with points pt 7 ps 0.3 lc {} notitle, \\", m, series_ink(m));
    line(script, "NaN with points pt 7 ps 0.8 lc {} title '{}'{}", series_ink(m), methods[m].name,
         m == 0 ? "" : ", \\");
  }
  return finish("Error of ranges", script, "ranges",
                stride > 1
                    ? fmt::format("Range minus true distance. One exchange in {} is drawn.", stride)
                    : std::string{"Range minus true distance."});
}

Figure lag_figure(const std::vector<ShotDot>& lags, double max_lag) {
  const std::size_t stride = stride_for(lags.size(), kMostDots);
  std::string sure;
  std::string unsure;
  std::size_t count = 0;
  for (const ShotDot& dot : lags) {
    if (count++ % stride != 0) continue;
    line(dot.ambiguous ? unsure : sure, "{:.3f} {:.4f}", dot.t - lags.front().t, 100 * dot.value);
  }
  std::string script = preamble(520, 300);
  line(script, "$sure << EOD\nNaN NaN\n{}EOD\n$unsure << EOD\nNaN NaN\n{}EOD", sure, unsure);
  line(script, "set xrange [0:{:.4f}]\nset yrange [0:{:.4f}]",
       std::max(lags.back().t - lags.front().t, 1e-9), 100 * max_lag);
  line(script, "set xlabel 'time since the first shot [s]'\nset ylabel 'lag [cm]'");
  line(script, "plot $sure with points pt 7 ps 0.3 lc {}, $unsure with points pt 7 ps 0.3 lc {}",
       series_ink(0), ink(Ink::kWorst));
  return finish("Lag over time", script, "lag",
                "What all receivers of a shot were late by. Shots that another repair might "
                "explain have a colour of their own." +
                    thinned(stride));
}

Figure repair_figure(const std::vector<std::pair<std::string, std::size_t>>& repairs) {
  constexpr std::size_t most = 12;
  const std::size_t shown = std::min(most, repairs.size());
  std::string script = preamble(520, 300) + "$bars << EOD\n";
  std::string tics;
  for (std::size_t i = 0; i < shown; ++i) {
    line(script, "{} {}", i, repairs[i].second);
    tics += fmt::format("{}'{}' {}", i == 0 ? "" : ",", repairs[i].first, i);
  }
  script += "EOD\n";
  line(script, "set xrange [-0.7:{:.1f}]\nset yrange [0:*]", static_cast<double>(shown) - 0.3);
  line(script, "set xtics ({}) rotate by 40 right font ',10'\nset bmargin 5\nset boxwidth 0.6",
       tics);
  line(script, "set ylabel 'shots'\nset style fill solid 0.6 noborder");
  line(script, "plot $bars with boxes lc {}", series_ink(0));
  return finish(
      "Repairs", script, "repairs",
      "Whole waves added to each length, by ascending receiver id." +
          (repairs.size() > most ? fmt::format(" The {} most frequent of {}.", most, repairs.size())
                                 : std::string{}));
}

}  // namespace uwbpos::host
