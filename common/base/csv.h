/// Tables of numbers with a header; columns are found by name. Files are not trusted: every cell is checked.
/// And the cells of the tables that needlelab writes.
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
  std::vector<std::size_t> lines;  ///< of the file, at which the rows begin, from 1
  [[nodiscard]] std::size_t rows() const { return columns.empty() ? 0 : columns.front().size(); }
  /// Index of a column, or -1.
  [[nodiscard]] int find(std::string_view name) const;
};

inline constexpr std::size_t kMostCsvRows = 50'000'000;

struct CsvReading {
  std::size_t max_rows = kMostCsvRows;
  std::vector<std::string> not_finite = {};  ///< columns in which `nan` and infinities are read
  std::size_t lines_above = 0;               ///< lines above the header that are passed over
};

/// Reads the `required` columns and the `optional` columns that the file has, in any order (isColumn); it
/// skips other columns. The text is of CsvRows. Errors (kInvalidInput) name file, line, column, value: a
/// missing or doubled column, too few or many cells, a cell that is not a finite number, no rows, too many.
Result<CsvTable> readCsv(const std::filesystem::path& path, const std::vector<std::string>& required,
                         const std::vector<std::string>& optional = {}, const CsvReading& reading = {});

/// Appends a number so that reading it back gives the same double: 17 significant digits, `nan` for
/// not-a-number.
void appendNumber(std::string& out, double value);

// --- writing for a person's spreadsheet

/// What the reader's spreadsheet expects between columns, and before decimals.
struct CsvStyle {
  char separator = ',';
  char decimal_sign = '.';
};
/// "comma", "semicolon" (with decimal commas: for countries that write them), "tab". kInvalidInput, with the
/// field "separator".
Result<CsvStyle> csvStyleOf(std::string_view name);
inline constexpr std::array<std::string_view, 3> kCsvSeparators = {"comma", "semicolon", "tab"};

/// The byte order mark of UTF-8: Excel takes a file without it for Windows-1252.
inline constexpr std::string_view kUtf8Mark = "\xef\xbb\xbf";

/// Appends a text as a cell (RFC 4180): in quotes where it has the separator, a quote or a line end. A text
/// that begins like a formula (= + - @ tab) gets a ' in front: a spreadsheet must not run it.
void appendCsvText(std::string& out, std::string_view text, char separator = ',');
/// Appends a finite number as people write it: at most six decimals, no exponent, no zeros at the end.
void appendCsvNumber(std::string& out, double value, char decimal_sign);

}  // namespace needlelab
