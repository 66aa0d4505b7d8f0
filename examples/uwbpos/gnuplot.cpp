// SPDX-License-Identifier: MIT
#include "gnuplot.hpp"

#include <array>
#include <charconv>
#include <cstdio>
#include <memory>

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace uwbpos::host {
namespace {

struct Closer {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Closer>;

void replace_all(std::string& text, std::string_view from, std::string_view to) {
  for (std::size_t at = text.find(from); at != std::string::npos;
       at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
}

std::string variable(int code) {
  constexpr auto names = std::to_array<std::string_view>(
      {"", "text", "muted", "grid", "truth", "anchor", "mark", "worst"});
  const int series = code - static_cast<int>(Ink::kSeries0);
  if (series >= 0) return fmt::format("var(--series-{})", series % kSeriesColours);
  const auto place = static_cast<std::size_t>(code);
  return place < names.size() ? fmt::format("var(--{})", names[place]) : "currentColor";
}

// Turns `rgb(0, 0, NN)` into the variable that NN stands for.
std::string with_variables(std::string_view svg) {
  constexpr std::string_view opening = "rgb(";
  std::string text;
  text.reserve(svg.size());
  while (true) {
    const std::size_t start = svg.find(opening);
    const std::size_t end = start == std::string_view::npos ? start : svg.find(')', start);
    if (end == std::string_view::npos) break;
    text += svg.substr(0, start);
    std::size_t last = svg.rfind(',', end) + 1;
    while (last < end && svg[last] == ' ') ++last;
    int code = 0;
    std::from_chars(svg.data() + last, svg.data() + end, code);
    text += variable(code);
    svg.remove_prefix(end + 1);
  }
  text += svg;
  return text;
}

}  // namespace

std::optional<std::string> run_gnuplot(const std::string& script) {
  const File in{std::tmpfile()};
  const File out{std::tmpfile()};
  if (!in || !out) return std::nullopt;
  if (std::fwrite(script.data(), 1, script.size(), in.get()) != script.size()) return std::nullopt;
  (void)std::fseek(in.get(), 0, SEEK_SET);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, fileno(in.get()), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, fileno(out.get()), STDOUT_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  std::string name = "gnuplot";
  std::array<char*, 2> arguments{name.data(), nullptr};
  pid_t child = 0;
  const int failed =
      posix_spawnp(&child, name.c_str(), &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) return std::nullopt;
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    return std::nullopt;
  }

  std::string svg;
  std::array<char, 4096> buffer{};
  (void)std::fseek(out.get(), 0, SEEK_SET);
  for (std::size_t count = 0;
       (count = std::fread(buffer.data(), 1, buffer.size(), out.get())) > 0;) {
    svg.append(buffer.data(), count);
  }
  if (svg.find("</svg>") == std::string::npos) return std::nullopt;
  return svg;
}

std::string picture_preamble(int height) {
  return fmt::format(
      "set terminal svg size 640,{} dynamic enhanced font 'sans-serif,13' background '#ffffff'\n"
      "set encoding utf8\nset grid lc rgb '#e2e5ea'\nset border 3\nset tics nomirror\n"
      "set key above\n",
      height);
}

std::string data_block(std::string_view name, std::string_view lines) {
  return fmt::format("${} << EOD\n{}EOD\n", name, lines);
}

std::string ink(Ink colour) { return fmt::format("rgb '#0000{:02x}'", static_cast<int>(colour)); }

std::string series_ink(std::size_t series) {
  return ink(static_cast<Ink>(static_cast<int>(Ink::kSeries0) +
                              static_cast<int>(series % kSeriesColours)));
}

std::string page_svg(std::string_view svg, std::string_view prefix, std::string_view description) {
  const std::size_t start = svg.find("<svg");
  const std::size_t end = svg.rfind("</svg>");
  if (start == std::string_view::npos || end == std::string_view::npos) return "";
  std::string text = with_variables(svg.substr(start, end + 6 - start));
  replace_all(text, "gpPt", fmt::format("{}-pt", prefix));
  replace_all(text, "gpDot", fmt::format("{}-dot", prefix));
  replace_all(text, "gnuplot_plot_", fmt::format("{}-plot-", prefix));
  replace_all(text, "gnuplot_canvas", fmt::format("{}-canvas", prefix));
  replace_all(text, "'textbox'", fmt::format("'{}-textbox'", prefix));
  replace_all(text, "'greybox'", fmt::format("'{}-greybox'", prefix));
  replace_all(text, " font-family=\"sans-serif\"", "");
  replace_all(text, "<title>Gnuplot</title>", "");
  replace_all(text, "<desc>Produced by GNUPLOT 5.4 patchlevel 4 </desc>", "");
  replace_all(text, "color=\"black\"", "color=\"var(--text)\"");
  replace_all(text, "xlink:href", "href");
  text.insert(4, fmt::format(" role=\"img\" aria-label=\"{}\"", description));
  return text;
}

}  // namespace uwbpos::host
