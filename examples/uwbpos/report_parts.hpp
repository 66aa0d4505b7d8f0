// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// What the pages of reports are made of.

#include <string>
#include <string_view>

#include "plots.hpp"

namespace uwbpos::host {

/// A headline number and what it means.
[[nodiscard]] std::string number(std::string_view value, std::string_view meaning,
                                 bool first = false);

/// A card of text. `extent` names its classes in report_style.hpp.
[[nodiscard]] std::string card(std::string_view title, std::string_view content,
                               std::string_view extent = "later");

/// A card with a plot, or with what to do about one that could not be drawn.
[[nodiscard]] std::string figure(const Figure& f);

}  // namespace uwbpos::host
