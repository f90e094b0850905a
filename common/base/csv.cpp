#include "common/base/csv.h"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "common/base/files.h"

namespace needlelab {
namespace {

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

// calls `cell(index, text)` for each comma-separated cell; returns the number of cells
template <typename Cell>
std::size_t splitCells(std::string_view line, Cell cell) {
  std::size_t index = 0;
  for (;;) {
    const std::size_t comma = line.find(',');
    cell(index++, trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return index;
    line.remove_prefix(comma + 1);
  }
}

// the file's text appears in messages on a terminal: remove control characters
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
                         const std::vector<std::string>& optional, std::size_t max_rows,
                         const std::vector<std::string>& not_finite) {
  ASSIGN_OR_RETURN(auto file, readWholeFile(path, std::size_t{4} << 30));
  std::string_view text = file;
  std::size_t line_number = 0;
  const auto nextLine = [&](std::string_view& line) {
    if (text.empty()) return false;
    const std::size_t end = text.find('\n');
    line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    ++line_number;
    return true;
  };
  const auto fail = [&](const std::string& why) {
    return Error{ErrorCode::kInvalidInput, fmt::format("{} line {}: {}", path.string(), line_number, why)};
  };

  // header: map the cells of a row to the wanted columns
  std::string_view line;
  if (!nextLine(line)) {
    line_number = 1;
    return fail("the file is empty; a header with the columns " + required.front() + ", … is expected");
  }
  if (line.substr(0, 3) == "\xEF\xBB\xBF") line.remove_prefix(3);
  CsvTable table;
  std::vector<int> target;
  std::string doubled;
  const auto isOf = [](const std::vector<std::string>& names, std::string_view name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  std::vector<bool> finite;  // whether a column's numbers must be
  const std::size_t cells = splitCells(line, [&](std::size_t, std::string_view name) {
    if (!isOf(required, name) && !isOf(optional, name)) {
      target.push_back(-1);
    } else if (table.find(name) >= 0) {
      doubled = name;
      target.push_back(-1);
    } else {
      target.push_back(static_cast<int>(table.names.size()));
      table.names.emplace_back(name);
      finite.push_back(!isOf(not_finite, name));
    }
  });
  if (!doubled.empty()) return fail("column " + inQuotes(doubled) + " stands twice in the header");
  for (const auto& name : required)
    if (table.find(name) < 0) return fail("column " + inQuotes(name) + " is missing in the header");
  table.columns.resize(table.names.size());

  while (nextLine(line)) {
    if (trimmed(line).empty()) continue;
    if (table.rows() == max_rows) return fail(fmt::format("more than {} rows", max_rows));
    std::string why;
    const std::size_t count = splitCells(line, [&](std::size_t index, std::string_view cell) {
      if (index >= cells || target[index] < 0 || !why.empty()) return;
      const auto column = static_cast<std::size_t>(target[index]);
      double value = 0;
      const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
      if (error != std::errc() || end != cell.data() + cell.size() ||
          (finite[column] && !std::isfinite(value)))
        why = "column " + inQuotes(table.names[column]) + ": " + inQuotes(cell) +
              (finite[column] ? " is not a finite number" : " is not a number");
      else
        table.columns[column].push_back(value);
    });
    if (count != cells) return fail(fmt::format("{} cells, the header has {}", count, cells));
    if (!why.empty()) return fail(why);
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
  const auto [end, error] =
      std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::general, 17);
  (void)error;  // 40 characters hold any double at 17 digits
  out.append(buffer, end);
}

}  // namespace needlelab
