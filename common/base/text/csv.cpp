#include "common/base/text/csv.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "common/base/files/files.h"
#include "common/base/text/csv_rows.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

// messages show the file's text on a terminal: remove control characters
std::string inQuotes(std::string_view text) {
  std::string shown(text.substr(0, 40));
  for (char& c : shown)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return "'" + shown + "'";
}

}  // namespace

int CsvTable::find(std::string_view name) const {
  const auto at = std::find(names.begin(), names.end(), name);
  return at == names.end() ? -1 : static_cast<int>(at - names.begin());
}

Result<CsvTable> readCsv(const std::filesystem::path& path, const std::vector<std::string>& required,
                         const std::vector<std::string>& optional, const CsvReading& reading) {
  ASSIGN_OR_RETURN(auto bytes, readWholeFile(path, std::size_t{4} << 30));
  ASSIGN_OR_RETURN(const std::string text,
                   utf8TextOf(path.string(), std::move(bytes), TextEncoding::kAsciiParts));
  CsvRows rows(text, reading.lines_above, CommentLines::kYes);
  const auto fail = [&](const std::string& why) {
    return Error{ErrorCode::kInvalidInput, fmt::format("{} line {}: {}", path.string(), rows.line(), why)};
  };
  const auto nextRow = [&]() -> Result<bool> {
    auto there = rows.next();
    if (!there.ok()) return Error{there.error().code, path.string() + " " + there.error().message};
    return there;
  };

  // header: map the cells of a row to the wanted columns
  ASSIGN_OR_RETURN(const bool has_header, nextRow());
  if (!has_header)
    return fail("the file is empty; a header with the columns " + required.front() + ", … is expected");
  CsvTable table;
  std::vector<int> target;
  std::vector<bool> finite;  // whether a column's numbers must be
  const auto wantedColumn = [&](std::string_view cell) -> const std::string* {
    for (const auto* names : {&required, &optional})
      for (const std::string& name : *names)
        if (isColumn(cell, name)) return &name;
    return nullptr;
  };
  for (const std::string_view cell : rows.cells()) {
    const std::string* const name = wantedColumn(cell);
    target.push_back(name == nullptr ? -1 : static_cast<int>(table.names.size()));
    if (name == nullptr) continue;
    if (table.find(*name) >= 0) return fail("column " + inQuotes(*name) + " stands twice in the header");
    table.names.push_back(*name);
    finite.push_back(std::find(reading.not_finite.begin(), reading.not_finite.end(), *name) ==
                     reading.not_finite.end());
  }
  const std::size_t columns = target.size();
  for (const auto& name : required)
    if (table.find(name) < 0)
      return fail("column " + inQuotes(name) + " is missing: " + headerText(rows.cells(), rows.separator()));
  table.columns.resize(table.names.size());

  for (;;) {
    ASSIGN_OR_RETURN(const bool there, nextRow());
    if (!there) break;
    const auto cells = rows.cells();
    if (table.rows() == reading.max_rows) return fail(fmt::format("more than {} rows", reading.max_rows));
    if (cells.size() != columns)
      return fail(fmt::format("{} cells, the header has {}", cells.size(), columns));
    for (std::size_t i = 0; i < columns; ++i) {
      if (target[i] < 0) continue;
      const auto column = static_cast<std::size_t>(target[i]);
      const auto value = csvNumber(cells[i], rows.separator());
      if (!value || (finite[column] && !std::isfinite(*value)))
        return fail("column " + inQuotes(table.names[column]) + ": " + inQuotes(cells[i]) +
                    (finite[column] ? " is not a finite number" : " is not a number"));
      table.columns[column].push_back(*value);
    }
    table.lines.push_back(rows.line());
  }
  if (table.rows() == 0) return fail("no rows after the header");
  return table;
}

void appendNumber(std::string& out, double value) {
  if (std::isnan(value)) {
    out += "nan";
    return;
  }
  char buffer[40];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::general);
  (void)error;  // 40 characters hold any double
  out.append(buffer, end);
}

Result<CsvStyle> csvStyleOf(std::string_view name) {
  if (name == "comma") return CsvStyle{',', '.'};
  if (name == "semicolon") return CsvStyle{';', ','};
  if (name == "tab") return CsvStyle{'\t', '.'};
  return Error{ErrorCode::kInvalidInput,
               fmt::format("separator: {}, allowed are {}", inQuotes(name), fmt::join(kCsvSeparators, ", "))};
}

void appendCsvText(std::string& out, std::string_view text, char separator) {
  const bool is_formula =
      !text.empty() && std::string_view("=+-@\t\r").find(text.front()) != std::string_view::npos;
  const bool is_quoted = text.find(separator) != std::string_view::npos ||
                         text.find_first_of("\"\r\n") != std::string_view::npos;
  if (is_quoted) out += '"';
  if (is_formula) out += '\'';
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  if (is_quoted) out += '"';
}

void appendCsvNumber(std::string& out, double value, char decimal_sign) {
  std::string text = fixedText(value, 6);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  std::replace(text.begin(), text.end(), '.', decimal_sign);
  out += text;
}

}  // namespace needlelab
