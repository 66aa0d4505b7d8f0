// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Names for what went wrong, as keys of summary.json and as words.

#include <cstddef>
#include <map>
#include <string>
#include <string_view>

#include "uwbpos/core/result.hpp"

namespace uwbpos::host {

/// Reason → how often.
using Counts = std::map<std::string, std::size_t>;

/// A short stable name, such as `too_few_measurements`.
[[nodiscard]] std::string_view reason_name(Error error);

/// The reason in words; `name` is one of `reason_name`'s or of the command's own.
[[nodiscard]] std::string_view reason_words(std::string_view name);

[[nodiscard]] std::size_t total(const Counts& counts);

}  // namespace uwbpos::host
