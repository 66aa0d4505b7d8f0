// SPDX-License-Identifier: MIT
#pragma once

/// @file
/// Comma-separated files with a header row: columns found by name in any order, unknown columns
/// ignored, `#` lines and blank lines skipped, LF or CRLF, UTF-8 with or without BOM.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace uwbpos::host {

/// Counts what was wrong with rows of the input. Tells the first few of each file on standard
/// error, all of them in `counts()`. In a strict run the first one ends the run (`Failure`).
class Problems {
 public:
  static constexpr std::size_t kToldPerFile = 8;

  explicit Problems(bool strict = false, bool quiet = false) : strict_{strict}, quiet_{quiet} {}

  /// A row that is skipped. `line` and `column` count from one; `column` in bytes, 0 if the row as
  /// a whole is meant.
  void malformed(const std::filesystem::path& file, std::size_t line, std::size_t column,
                 std::string_view message);

  /// How many rows were skipped, per file.
  [[nodiscard]] const std::map<std::string, std::size_t>& counts() const { return counts_; }

  /// The first few messages, `file:line:column: message`.
  [[nodiscard]] const std::vector<std::string>& messages() const { return messages_; }

  /// How many rows were skipped in all.
  [[nodiscard]] std::size_t total() const;

  /// Says on standard error how many there were in files with more than the first few.
  void tell_rest() const;

 private:
  bool strict_;
  bool quiet_;
  std::map<std::string, std::size_t> counts_;
  std::vector<std::string> messages_;
};

/// A cell that does not hold what its column promises; makes the row malformed.
struct CellError : std::runtime_error {
  CellError(std::size_t cell, const std::string& message)
      : std::runtime_error{message}, cell_index{cell} {}
  std::size_t cell_index;  ///< place of the cell in its row, from zero
};

/// What a file's reader wants from it.
struct Column {
  std::string_view name;
  bool required = false;
};

/// One row; the argument `column` of each function is the place in the reader's list of columns.
/// Functions throw `CellError` on text that does not fit. A column that the file does not have
/// reads as empty cells.
class Row {
 public:
  Row(std::span<const Column> columns, std::span<const int> places,
      std::span<const std::string> cells, std::size_t line)
      : columns_{columns}, places_{places}, cells_{cells}, line_{line} {}

  [[nodiscard]] bool empty(std::size_t column) const { return text(column).empty(); }
  [[nodiscard]] std::size_t line() const { return line_; }

  /// A finite number.
  [[nodiscard]] double number(std::size_t column) const;
  [[nodiscard]] std::optional<double> optional_number(std::size_t column) const;
  /// A number above zero, if the cell is not empty.
  [[nodiscard]] std::optional<double> optional_positive(std::size_t column) const;
  /// A whole number in [0, 2³²).
  [[nodiscard]] std::uint32_t id(std::size_t column) const;
  [[nodiscard]] std::uint32_t id_or(std::size_t column, std::uint32_t otherwise) const;
  /// A reading of a counter of at most 40 bits.
  [[nodiscard]] std::uint64_t ticks(std::size_t column) const;

 private:
  [[nodiscard]] std::string_view text(std::size_t column) const;
  [[noreturn]] void wrong(std::size_t column, std::string_view expected) const;

  std::span<const Column> columns_;
  std::span<const int> places_;
  std::span<const std::string> cells_;
  std::size_t line_;
};

/// The line, and the byte in it, at which the cell with this index starts, both from one.
[[nodiscard]] std::size_t cell_column(std::string_view line, std::size_t cell_index);

/// Reads a file row by row, one row in memory at a time. Returns the number of rows seen,
/// malformed ones included. Throws `Failure` if the file cannot be read or lacks a required column.
std::size_t read_csv(const std::filesystem::path& file, std::initializer_list<Column> columns,
                     Problems& problems, const std::function<void(const Row&)>& on_row);

/// The longest line that is read [bytes].
inline constexpr std::size_t kLongestLine = std::size_t{1} << 16;

/// Calls `on_line(line, number)` for each line of a text file, without its line end and without a
/// byte-order mark. Of a line longer than `kLongestLine` it gets as much and some more, so that a
/// binary file without lines fills no memory. Throws `Failure` if it cannot be read.
void read_lines(const std::filesystem::path& file,
                const std::function<void(std::string_view, std::size_t)>& on_line);

/// A finite number and nothing else, or nothing.
[[nodiscard]] std::optional<double> parse_number(std::string_view text);

}  // namespace uwbpos::host
