// SPDX-License-Identifier: MIT
#include "csv.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>

#include <csv.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "failure.hpp"
#include "progress.hpp"

namespace uwbpos::host {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

bool is_blank(char c) { return c == ' ' || c == '\t'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

// What a message can show of a cell: short, and no control characters.
std::string shown(std::string_view text) {
  constexpr std::size_t longest = 40;
  std::string result;
  for (const char c : text.substr(0, longest)) {
    result += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  }
  if (text.size() > longest) result += "…";
  return result;
}

template <class Integer>
std::optional<Integer> parse_integer(std::string_view text) {
  Integer value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// The next line without its end, and how many bytes it took; of a longer one than the buffer, what
// fits. False at the end.
bool next_line(std::istream& stream, std::span<char> buffer, std::string_view& line,
               std::size_t& bytes) {
  stream.getline(buffer.data(), static_cast<std::streamsize>(buffer.size()));
  const auto count = static_cast<std::size_t>(stream.gcount());
  bytes += count;
  if (count == 0) return false;
  const bool ended = !stream.eof() && !stream.fail();  // by a newline, which is counted
  line = {buffer.data(), ended ? count - 1 : count};
  if (stream.fail() && !stream.eof() && !stream.bad()) {
    stream.clear();
    stream.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
    bytes += static_cast<std::size_t>(stream.gcount());
  }
  return true;
}

// Splits one line at a time with libcsv, so that every row knows its line.
class Splitter {
 public:
  Splitter() { start(); }
  ~Splitter() { csv_free(&parser_); }
  Splitter(const Splitter&) = delete;
  Splitter& operator=(const Splitter&) = delete;

  // The line's cells; throws std::runtime_error if its quotes are wrong.
  const std::vector<std::string>& split(std::string_view line) {
    count_ = 0;
    rows_ = 0;
    buffer_.assign(line);
    buffer_ += '\n';
    const std::size_t parsed =
        csv_parse(&parser_, buffer_.data(), buffer_.size(), &on_cell, &on_row, this);
    if (parsed != buffer_.size() || rows_ != 1) {
      csv_free(&parser_);
      start();
      throw std::runtime_error{rows_ > 1 ? "a carriage return inside the row"
                                         : "a quotation mark opens or closes in the wrong place"};
    }
    cells_.resize(count_);
    return cells_;
  }

 private:
  void start() {
    if (csv_init(&parser_, CSV_STRICT) != 0) throw Failure{"libcsv cannot be initialised"};
  }

  static void on_cell(void* data, std::size_t size, void* self) {
    auto& s = *static_cast<Splitter*>(self);
    if (s.cells_.size() <= s.count_) s.cells_.resize(s.count_ + 1);
    s.cells_[s.count_++].assign(static_cast<const char*>(data), size);
  }

  static void on_row(int, void* self) { ++static_cast<Splitter*>(self)->rows_; }

  csv_parser parser_;
  std::string buffer_;
  std::vector<std::string> cells_;
  std::size_t count_ = 0;
  int rows_ = 0;
};

std::string expected_columns(std::span<const Column> columns) {
  std::vector<std::string_view> required;
  for (const Column& column : columns) {
    if (column.required) required.push_back(column.name);
  }
  return fmt::format("{}", fmt::join(required, ","));
}

// The place of each wanted column in the file, −1 if it has none.
std::vector<int> find_columns(const std::filesystem::path& file, std::size_t line,
                              std::span<const Column> columns,
                              const std::vector<std::string>& names) {
  std::vector<int> places;
  for (const Column& column : columns) {
    const auto found = std::ranges::find(names, column.name);
    if (found == names.end() && column.required) {
      std::string hint;
      if (names.size() == 1 && names[0].find(';') != std::string::npos) {
        hint = "; the cells are separated by semicolons, expected commas";
      } else if (names.size() == 1 && names[0].find('\t') != std::string::npos) {
        hint = "; the cells are separated by tabs, expected commas";
      } else if (parse_number(names[0])) {
        hint = "; the first row must name the columns";
      }
      throw Failure{fmt::format("{}:{}: no column {}; expected a header row with {}, found {}{}",
                                file.string(), line, column.name, expected_columns(columns),
                                shown(fmt::format("{}", fmt::join(names, ","))), hint)};
    }
    if (found != names.end() && std::find(found + 1, names.end(), column.name) != names.end()) {
      throw Failure{fmt::format("{}:{}: two columns are called {}; expected one", file.string(),
                                line, column.name)};
    }
    places.push_back(found == names.end() ? -1 : static_cast<int>(found - names.begin()));
  }
  return places;
}

}  // namespace

void Problems::malformed(const std::filesystem::path& file, std::size_t line, std::size_t column,
                         std::string_view message) {
  const std::string name = file.string();
  const std::string full = column == 0 ? fmt::format("{}:{}: {}", name, line, message)
                                       : fmt::format("{}:{}:{}: {}", name, line, column, message);
  if (strict_) throw Failure{full};
  if (++counts_[name] > kToldPerFile) return;
  messages_.push_back(full);
  if (!quiet_) fmt::print(stderr, "{} (row skipped)\n", full);
}

std::size_t Problems::total() const {
  std::size_t sum = 0;
  for (const auto& [file, count] : counts_) sum += count;
  return sum;
}

void Problems::tell_rest() const {
  if (quiet_) return;
  for (const auto& [file, count] : counts_) {
    if (count > kToldPerFile) {
      fmt::print(stderr, "{}: {} rows skipped in all, {} not listed\n", file, count,
                 count - kToldPerFile);
    }
  }
}

std::optional<double> parse_number(std::string_view text) {
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  double value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  if (!std::isfinite(value)) return std::nullopt;
  return value;
}

std::string_view Row::text(std::size_t column) const {
  const int place = places_[column];
  return place < 0 ? std::string_view{} : std::string_view{cells_[static_cast<std::size_t>(place)]};
}

void Row::wrong(std::size_t column, std::string_view expected) const {
  throw CellError{static_cast<std::size_t>(std::max(places_[column], 0)),
                  fmt::format("{}: expected {}, found \"{}\"", columns_[column].name, expected,
                              shown(text(column)))};
}

double Row::number(std::size_t column) const {
  const auto value = parse_number(text(column));
  if (!value) wrong(column, "a finite number");
  return *value;
}

std::optional<double> Row::optional_number(std::size_t column) const {
  if (empty(column)) return std::nullopt;
  return number(column);
}

std::optional<double> Row::optional_positive(std::size_t column) const {
  const auto value = optional_number(column);
  if (value && !(*value > 0)) wrong(column, "a number above zero");
  return value;
}

std::uint32_t Row::id(std::size_t column) const {
  const auto value = parse_integer<std::uint32_t>(text(column));
  if (!value) wrong(column, "a whole number from 0 to 4294967295");
  return *value;
}

std::uint32_t Row::id_or(std::size_t column, std::uint32_t otherwise) const {
  return empty(column) ? otherwise : id(column);
}

std::uint64_t Row::ticks(std::size_t column) const {
  const auto value = parse_integer<std::uint64_t>(text(column));
  if (!value || *value >> 40 != 0) wrong(column, "a counter reading from 0 to 2^40 - 1");
  return *value;
}

std::size_t cell_column(std::string_view line, std::size_t cell_index) {
  bool quoted = false;
  std::size_t place = 0;
  for (std::size_t cell = 0; cell < cell_index && place < line.size(); ++place) {
    if (line[place] == '"') quoted = !quoted;
    if (line[place] == ',' && !quoted) ++cell;
  }
  while (place < line.size() && is_blank(line[place])) ++place;
  return place + 1;
}

void read_lines(const std::filesystem::path& file,
                const std::function<void(std::string_view, std::size_t)>& on_line) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) {
    throw Failure{fmt::format("{}: is a directory; expected a file", file.string())};
  }
  std::ifstream stream{file, std::ios::binary};
  if (!stream) throw Failure{fmt::format("{}: cannot be opened for reading", file.string())};
  std::error_code no_size;
  const std::uintmax_t told = std::filesystem::file_size(file, no_size);
  const std::uintmax_t size = no_size ? 0 : told;
  Progress progress{fmt::format("reading {}", file.string())};
  std::size_t bytes = 0;
  std::vector<char> buffer(kLongestLine + 2);  // one byte too many tells a longer line
  std::string_view line;
  for (std::size_t number = 1; next_line(stream, buffer, line, bytes); ++number) {
    constexpr std::size_t lines_between = 4096;
    if (number % lines_between == 0 && bytes < size) progress(bytes, size);
    if (number == 1) {
      if (line.starts_with("\xFF\xFE") || line.starts_with("\xFE\xFF")) {
        throw Failure{fmt::format("{}: is UTF-16 text; expected UTF-8", file.string())};
      }
      if (line.starts_with(kByteOrderMark)) line.remove_prefix(kByteOrderMark.size());
    }
    if (line.ends_with('\r')) line.remove_suffix(1);
    on_line(line, number);
  }
  if (stream.bad()) throw Failure{fmt::format("{}: cannot be read to its end", file.string())};
}

std::size_t read_csv(const std::filesystem::path& file, std::initializer_list<Column> columns,
                     Problems& problems, const std::function<void(const Row&)>& on_row) {
  const std::span<const Column> wanted{columns.begin(), columns.size()};
  Splitter splitter;
  std::vector<int> places;
  std::size_t width = 0;
  std::size_t rows = 0;
  read_lines(file, [&](std::string_view line, std::size_t number) {
    const std::string_view content = trimmed(line);
    if (content.empty() || content.front() == '#') return;
    const bool header = places.empty();
    if (!header) ++rows;
    try {
      if (line.size() > kLongestLine) throw std::runtime_error{"the line exceeds 64 KiB"};
      const std::vector<std::string>& cells = splitter.split(line);
      if (header) {
        places = find_columns(file, number, wanted, cells);
        width = cells.size();
        return;
      }
      const bool only_empty_extras =
          cells.size() > width &&
          std::all_of(cells.begin() + static_cast<std::ptrdiff_t>(width), cells.end(),
                      [](const std::string& cell) { return cell.empty(); });
      if (cells.size() != width && !only_empty_extras) {
        throw CellError{
            std::min(width, cells.size()),
            fmt::format("expected {} cells as in the header row, found {}", width, cells.size())};
      }
      on_row(Row{wanted, places, cells, number});
    } catch (const Failure&) {
      throw;
    } catch (const CellError& error) {
      problems.malformed(file, number, cell_column(line, error.cell_index), error.what());
    } catch (const std::runtime_error& error) {
      if (header) throw Failure{fmt::format("{}:{}: {}", file.string(), number, error.what())};
      problems.malformed(file, number, 1, error.what());
    }
  });
  if (places.empty()) {
    throw Failure{fmt::format("{}: is empty; expected a header row with {}", file.string(),
                              expected_columns(wanted))};
  }
  return rows;
}

}  // namespace uwbpos::host
