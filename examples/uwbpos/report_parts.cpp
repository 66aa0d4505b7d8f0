// SPDX-License-Identifier: MIT
#include "report_parts.hpp"

#include <fmt/format.h>

namespace uwbpos::host {

std::string number(std::string_view value, std::string_view meaning, bool first) {
  return fmt::format("<div class=\"number{}\"><b>{}</b><span>{}</span></div>\n",
                     first ? " first" : "", value, meaning);
}

std::string figure(const Figure& f) {
  return fmt::format("<figure class=\"card\"><h2>{}</h2>{}<figcaption>{}</figcaption></figure>\n",
                     f.title,
                     f.svg ? *f.svg
                           : "<p class=\"missing\">This plot is missing: gnuplot could not be run. "
                             "Install it (Debian: gnuplot-nox) and replay again.</p>",
                     f.caption);
}

std::string card(std::string_view title, std::string_view content, std::string_view extent) {
  return fmt::format("<section class=\"card {}\"><h2>{}</h2>{}</section>\n", extent, title,
                     content);
}

}  // namespace uwbpos::host
