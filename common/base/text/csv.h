/// Reads tables of numbers with a header; columns are found by name. Files are not trusted: every cell is
/// checked. Also writes the cells of needlelab's own tables.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Column-major numbers. All columns have the same length.
struct CsvTable {
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;
  std::vector<std::size_t> lines;  ///< line of the file at which each row begins, from 1
  [[nodiscard]] std::size_t rows() const { return columns.empty() ? 0 : columns.front().size(); }
  /// Index of a column, or -1.
  [[nodiscard]] int find(std::string_view name) const;
};

inline constexpr std::size_t kMaxCsvRows = 50'000'000;

struct CsvReading {
  std::size_t max_rows = kMaxCsvRows;
  std::vector<std::string> not_finite = {};  ///< columns that may have `nan` and infinities
  std::size_t lines_above = 0;               ///< lines to skip above the header
};

/// Reads the `required` columns and the `optional` columns that the file has, in any order (isColumn); it
/// skips other columns. CsvRows defines the syntax. Errors (kInvalidInput) name file, line, column, value: a
/// missing or doubled column, too few or many cells, a cell that is not a finite number, no rows, too many.
Result<CsvTable> readCsv(const std::filesystem::path& path, const std::vector<std::string>& required,
                         const std::vector<std::string>& optional = {}, const CsvReading& reading = {});

/// Appends the fewest digits that read back as the same double, at most 17; `nan` for not-a-number.
void appendNumber(std::string& out, double value);

// --- writing for spreadsheets

/// The separator and decimal sign that the reader's spreadsheet expects.
struct CsvStyle {
  char separator = ',';
  char decimal_sign = '.';
};
/// `name` is "comma", "semicolon" (with decimal commas, for countries that use them) or "tab". Errors:
/// kInvalidInput, naming the field "separator".
Result<CsvStyle> csvStyleOf(std::string_view name);
inline constexpr std::array<std::string_view, 3> kCsvSeparators = {"comma", "semicolon", "tab"};

/// The UTF-8 byte order mark: Excel reads a file without it as Windows-1252.
inline constexpr std::string_view kUtf8Mark = "\xef\xbb\xbf";

/// Appends a text as a cell (RFC 4180): in quotes if it has the separator, a quote or a line end. A text that
/// begins like a formula (= + - @ tab) gets a leading ' so that a spreadsheet does not run it.
void appendCsvText(std::string& out, std::string_view text, char separator = ',');
/// Appends a finite number for people: at most six decimals, no exponent, no trailing zeros.
void appendCsvNumber(std::string& out, double value, char decimal_sign);

}  // namespace needlelab
