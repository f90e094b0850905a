#include "client/sim/accuracy/report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/sim/accuracy/pareto.h"

namespace needlelab {
namespace {

std::string number(const std::optional<double>& value, double scale = 1) {
  if (!value) return {};
  char text[40];
  std::snprintf(text, sizeof text, "%.3g", *value * scale);
  // %g falls into powers of ten above 999: figures of a table stay plain
  if (std::abs(*value * scale) >= 1000) std::snprintf(text, sizeof text, "%.0f", *value * scale);
  return text;
}

// letters, not bytes: µ has two
std::size_t letters(std::string_view text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0u) != 0x80u; }));
}

struct Column {
  const char* title;
  std::function<std::string(const AccuracyRow&, bool on_front)> cell;
};

const std::vector<Column>& columns() {
  using Row = AccuracyRow;
  static const std::vector<Column> all = {
      {"choice", [](const Row& r, bool) { return choiceOf(r); }},
      {"rms error [N]", [](const Row& r, bool) { return number(r.rms_error_n); }},
      {"± [N]", [](const Row& r, bool) { return number(r.rms_error_spread_n); }},
      {"max [N]", [](const Row& r, bool) { return number(r.max_error_n); }},
      {"step [N]", [](const Row& r, bool) { return number(r.max_step_n); }},
      {"K margin", [](const Row& r, bool) { return number(r.stiffness_margin); }},
      {"rms [µm]", [](const Row& r, bool) { return number(r.rms_error_m, 1e6); }},
      {"bytes/sample", [](const Row& r, bool) { return number(r.bytes_per_sample); }},
      {"kB/s", [](const Row& r, bool) { return number(r.bytes_per_s, 1e-3); }},
      {"latency [ms]", [](const Row& r, bool) { return number(r.latency_ms); }},
      {"p99 [ms]", [](const Row& r, bool) { return number(r.latency_p99_ms); }},
      {"median [ns]", [](const Row& r, bool) { return number(r.median_ns); }},
      {"p99 [ns]", [](const Row& r, bool) { return number(r.p99_ns); }},
      {"core [%]", [](const Row& r, bool) { return number(r.cpu_share, 100); }},
      {"fits", [](const Row& r, bool) { return !r.fits_rate   ? ""
                                               : *r.fits_rate ? "yes"
                                                              : "NO"; }},
      {"front", [](const Row&, bool on_front) { return on_front ? "*" : ""; }},
      {"variant", [](const Row& r, bool) { return r.variant; }},
      {"uncertainty", [](const Row& r, bool) { return r.uncertainty; }},
  };
  return all;
}

using Cells = std::vector<std::vector<std::string>>;

Cells cellsOf(const RowGroup& group) {
  Cells cells(columns().size());
  const std::vector<bool> front = paretoFront(group);
  for (std::size_t c = 0; c < columns().size(); ++c)
    for (std::size_t r = 0; r < group.rows.size(); ++r)
      cells[c].push_back(columns()[c].cell(*group.rows[r], front[r]));
  return cells;
}

void appendTable(std::string& out, const Cells& cells) {
  const std::size_t rows = cells.front().size();
  std::vector<std::string> lines(rows + 1);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    if (std::all_of(cells[c].begin(), cells[c].end(), [](const std::string& s) { return s.empty(); }))
      continue;
    std::size_t width = letters(columns()[c].title);
    for (const std::string& cell : cells[c]) width = std::max(width, letters(cell));
    // words to the left, numbers to the right
    const bool left = c == 0 || c + 2 >= cells.size();
    for (std::size_t r = 0; r <= rows; ++r) {
      const std::string cell = r == 0 ? columns()[c].title : cells[c][r - 1];
      const std::string space(width - letters(cell), ' ');
      lines[r] += "  " + (left ? cell + space : space + cell);
    }
  }
  for (std::string& line : lines) {
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + "\n";
  }
}

}  // namespace

std::string wrapped(std::string_view text, std::size_t width, std::string_view indent) {
  std::string out, line(indent);
  bool empty = true;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find(' '), text.size());
    const std::string_view word = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (word.empty()) continue;
    if (!empty && letters(line) + 1 + letters(word) > width) {
      out += line + "\n";
      line = indent;
      empty = true;
    }
    line += (empty ? "" : " ") + std::string(word);
    empty = false;
  }
  return empty ? out : out + line + "\n";
}

std::string accuracyTables(const AccuracyRows& rows) {
  std::string out;
  for (const RowGroup& group : groupsOf(rows)) {
    out += std::string(nameOf(group.study)) + " · " + group.scene +
           (group.model.empty() ? "" : " · " + group.model) + "\n";
    out += wrapped("against: " + group.reference, 120, "  ");
    appendTable(out, cellsOf(group));
    std::vector<std::string> said;
    for (const AccuracyRow* row : group.rows)
      if (std::find(said.begin(), said.end(), row->cannot_show) == said.end())
        said.push_back(row->cannot_show);
    for (const std::string& text : said) out += wrapped("cannot show: " + text, 120, "  ");
    out += "\n";
  }
  return out;
}

std::string accuracyCsv(const AccuracyRows& rows) {
  std::string out;
  const auto names = jsonOf(AccuracyRow{});
  for (const auto& item : names.items()) out += (out.empty() ? "" : ",") + item.key();
  out += "\n";
  for (const AccuracyRow& row : rows) {
    std::string line;
    const auto object = jsonOf(row);
    for (const auto& item : object.items()) {
      if (!line.empty() || item.key() != "study") line += ",";
      if (item.value().is_null()) continue;
      if (!item.value().is_string()) {
        line += item.value().dump();
        continue;
      }
      line += '"';
      for (const char c : item.value().get<std::string>())
        line += c == '"' ? std::string("\"\"") : std::string(1, c);
      line += '"';
    }
    out += line + "\n";
  }
  return out;
}

}  // namespace needlelab
