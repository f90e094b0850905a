#include "client/admin/output.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <ostream>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/text/strict_json.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/scoring/measures/measures.h"

namespace needlelab {
namespace {

std::string cellText(const Json& row, const Column& column) {
  const auto found = row.find(column.key);
  if (found == row.end() || found->is_null()) return "-";
  switch (column.kind) {
    case Column::Kind::kTime:
      return localTime(found->get<std::int64_t>(), TimeForm::kZoned);
    case Column::Kind::kBytes:
      return bytesText(found->get<std::uint64_t>());
    case Column::Kind::kVerdict:
      return verdictName(*found == true || *found == "passed");
    case Column::Kind::kPlain:
      break;
  }
  if (found->is_string()) {
    const std::string text = oneLine(found->get<std::string>());
    return text.empty() ? "-" : text;
  }
  if (found->is_boolean()) return found->get<bool>() ? "yes" : "no";
  if (found->is_number_float()) {
    char text[32];
    std::snprintf(text, sizeof(text), "%.6g", found->get<double>());
    return text;
  }
  return found->dump();
}

/// Counts characters, not bytes: skips continuation bytes of UTF-8.
std::size_t widthOf(std::string_view text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

void pad(std::string& line, std::size_t to) {
  for (std::size_t width = widthOf(line); width < to; ++width) line += ' ';
}

}  // namespace

std::string bytesText(std::uint64_t bytes) {
  if (bytes < 1000) return fmt::format("{} B", bytes);
  double value = static_cast<double>(bytes);
  const char* unit = "";
  for (const char* next : {"kB", "MB", "GB", "TB"}) {
    if (value < 999.5) break;
    value /= 1000;
    unit = next;
  }
  char text[32];
  std::snprintf(text, sizeof(text), "%.3g %s", value, unit);
  return text;
}

std::string oneLine(std::string_view text) {
  std::string line;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto code = static_cast<unsigned char>(text[i]);
    // U+0080 to U+009F: a terminal treats U+009B as ESC [
    const bool c1 = code == 0xc2 && i + 1 < text.size() && static_cast<unsigned char>(text[i + 1]) < 0xa0;
    if (c1) ++i;
    line += c1 || code < 0x20 || code == 0x7f ? ' ' : text[i];
  }
  return showHidden(line);
}

Json storedJson(std::string_view text) {
  Json value = readShallowJson<Json>(text);
  // a discarded value would be printed as <discarded>, which is not JSON
  return value.is_discarded() ? Json() : value;
}

std::string tableText(const std::vector<Column>& columns, const Json& rows) {
  // format all cells first, to find the column widths
  std::vector<std::vector<std::string>> lines(1);
  for (const Column& column : columns) lines[0].emplace_back(column.title);
  for (const Json& row : rows) {
    auto& line = lines.emplace_back();
    for (const Column& column : columns) line.push_back(cellText(row, column));
  }
  std::string text;
  for (const auto& cells : lines) {
    std::string line;
    std::size_t begin = 0;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      line += cells[i];
      if (i + 1 == cells.size()) break;
      std::size_t width = 0;
      for (const auto& other : lines) width = std::max(width, widthOf(other[i]));
      begin += width + 2;
      pad(line, begin);
    }
    text += line + "\n";
  }
  return text;
}

Status Output::list(const std::vector<Column>& columns, const Json& rows, std::string_view if_empty) {
  if (json()) return writeJson(rows);
  if (rows.empty()) {
    remark(if_empty);
    return {};
  }
  out_ << tableText(columns, rows);
  return {};
}

Status Output::one(const std::vector<Column>& columns, const Json& row) {
  if (json()) return writeJson(Json::array({row}));
  lines(columns, row);
  return {};
}

Status Output::oneSecret(const std::vector<Column>& columns, const Json& row) {
  if (json()) return writeJson(Json::array({row}), 0600);
  lines(columns, row);
  return {};
}

void Output::lines(const std::vector<Column>& columns, const Json& row) {
  std::size_t width = 0;
  for (const Column& column : columns) width = std::max(width, widthOf(column.title));
  for (const Column& column : columns) {
    std::string line(column.title);
    pad(line, width + 2);
    out_ << line << cellText(row, column) << "\n";
  }
}

void Output::text(std::string_view line) {
  if (!json()) out_ << line << "\n";
}

void Output::document(std::string_view text) {
  out_ << text << "\n";
}

void Output::done(std::string_view line) {
  (json() ? err_ : out_) << line << "\n";
}

void Output::remark(std::string_view line) {
  err_ << line << "\n";
}

Status Output::writeJson(const Json& rows, unsigned mode) {
  const Json whole = {{"version", programVersion()}, {"machine", machineText()}, {"rows", rows}};
  // invalid UTF-8 (not expected) must not throw
  const std::string text = whole.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  if (!json_file_->empty()) return writeFileAtomically(*json_file_, viewOf(text), mode);
  out_ << text;
  return {};
}

}  // namespace needlelab
