#include "client/sim/benchmark/benchmark.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/sim/stability/gestures/passivity_observer.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kWidth = 120;

Json orNull(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
}

std::string number(const std::optional<double>& value, const char* format = "{:.3f}") {
  return value && std::isfinite(*value) ? fmt::format(fmt::runtime(format), *value) : std::string();
}

std::string paired(const std::optional<PairedDifference>& difference) {
  if (!difference) return {};
  std::string text = fixedText(difference->mean_N, 3, Sign::kBoth);
  if (difference->low_N)
    text += fmt::format(" ({} to {})", fixedText(*difference->low_N, 3, Sign::kBoth),
                        fixedText(*difference->high_N, 3, Sign::kBoth));
  return text;
}

struct ReportColumn {
  const char* title;
  std::string (*cell)(const BenchmarkRow&);
  bool left = false;
};
constexpr std::array<ReportColumn, 13> kReportColumns = {{
    {"model", [](const BenchmarkRow& r) { return r.model; }, true},
    {"numbers", [](const BenchmarkRow& r) { return fmt::format("{}", r.parameters); }},
    {"error [N]", [](const BenchmarkRow& r) { return number(r.error_N); }},
    {"95 %",
     [](const BenchmarkRow& r) {
       return r.error_low_N ? number(r.error_low_N) + "-" + number(r.error_high_N) : std::string();
     }},
    {"max [N]", [](const BenchmarkRow& r) { return number(r.max_error_N); }},
    {"fitted [N]", [](const BenchmarkRow& r) { return number(r.fit_error_N); }},
    {"beats trivial by [N]", [](const BenchmarkRow& r) { return paired(r.beats); }},
    {"behind the best by [N]", [](const BenchmarkRow& r) { return paired(r.behind); }},
    {"verdict", [](const BenchmarkRow& r) { return std::string(nameOf(r.verdict)); }, true},
    {"tick [ns]", [](const BenchmarkRow& r) { return number(r.median_ns, "{:.0f}"); }},
    {"given [µJ]",
     [](const BenchmarkRow& r) {
       return r.energy_given_J ? fixedText(*r.energy_given_J * 1e6, 1) : std::string();
     }},
    {"95 % band", [](const BenchmarkRow& r) { return r.band; }, true},
    {"variant", [](const BenchmarkRow& r) { return r.variant; }, true},
}};

std::string tableOf(const std::vector<BenchmarkRow>& rows) {
  std::vector<std::string> lines(rows.size() + 1);
  for (const ReportColumn& column : kReportColumns) {
    std::vector<std::string> cells = {column.title};
    for (const BenchmarkRow& row : rows) cells.push_back(column.cell(row));
    if (std::all_of(cells.begin() + 1, cells.end(), [](const std::string& cell) { return cell.empty(); }))
      continue;
    std::size_t width = 0;
    for (const std::string& cell : cells) width = std::max(width, countCharacters(cell));
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const std::string space(width - countCharacters(cells[i]), ' ');
      lines[i] += "  " + (column.left ? cells[i] + space : space + cells[i]);
    }
  }
  std::string text;
  for (std::string& line : lines) {
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

std::string dataText(const BenchmarkReport& report) {
  const auto counted = [](std::size_t count, const char* one) {
    return fmt::format("{} {}{}", count, one, count == 1 ? "" : "s");
  };
  return fmt::format("{}: {} of {}, {}, {} and {}; licence: {}; source: {}", report.data,
                     counted(report.curves, "curve"), counted(report.tissues, "tissue"),
                     counted(report.specimens, "specimen"), counted(report.needles, "needle"),
                     counted(report.speeds, "speed"), report.licence, report.source);
}

Json rowJson(const BenchmarkRow& row) {
  const PairedDifference none{std::nan(""), {}, {}};
  const PairedDifference beats = row.beats.value_or(none), behind = row.behind.value_or(none);
  return {{"held_out", nameOf(row.what)},
          {"model", row.model},
          {"kind", nameOf(row.kind)},
          {"variant", row.variant},
          {"parameters", row.parameters},
          {"units", row.units},
          {"error_n", row.error_N},
          {"error_low_n", orNull(row.error_low_N)},
          {"error_high_n", orNull(row.error_high_N)},
          {"max_error_n", row.max_error_N},
          {"fit_error_n", row.fit_error_N},
          {"beats_n", orNull(beats.mean_N)},
          {"beats_low_n", orNull(beats.low_N)},
          {"beats_high_n", orNull(beats.high_N)},
          {"behind_n", orNull(behind.mean_N)},
          {"behind_low_n", orNull(behind.low_N)},
          {"behind_high_n", orNull(behind.high_N)},
          {"verdict", nameOf(row.verdict)},
          {"share_in_band", orNull(row.in_band)},
          {"band", row.band},
          {"median_ns", orNull(row.median_ns)},
          {"energy_given_j", orNull(row.energy_given_J)}};
}

}  // namespace

std::string benchmarkText(const BenchmarkReport& report) {
  std::string out = wrapped(dataText(report), 0, kWidth);
  out += wrapped(
      fmt::format(
          "models have at most {} numbers each; a row's error is the mean over units, its interval "
          "Student's t. Margin: {} % of the held-out rms force. specimen-start calibrates on the first "
          "{} mm",
          report.max_numbers, numberText(100 * report.margin), numberText(1e3 * report.calibration_m)),
      0, kWidth);
  for (const QuestionResult& question : report.questions) {
    out += fmt::format("\nheld out: {}\n", nameOf(question.what)) + tableOf(question.rows);
    out += wrapped(question.text, 2, kWidth);
  }
  if (!report.notes.empty()) out += "\n";
  for (const std::string& note : report.notes) out += wrapped("note: " + note, 0, kWidth);
  return out + "\n" + wrapped(report.conclusion, 0, kWidth);
}

std::string benchmarkCsv(const BenchmarkReport& report) {
  std::string out;
  const Json names = rowJson(BenchmarkRow{});
  for (const auto& item : names.items()) out += (out.empty() ? "" : ",") + item.key();
  out += "\n";
  for (const QuestionResult& question : report.questions)
    for (const BenchmarkRow& row : question.rows) {
      const Json object = rowJson(row);
      bool first = true;
      for (const auto& item : object.items()) {
        if (!first) out += ',';
        first = false;
        if (item.value().is_null()) continue;
        if (!item.value().is_string()) {
          out += item.value().dump();
          continue;
        }
        out += '"';
        for (const char c : item.value().get<std::string>())
          out += c == '"' ? std::string("\"\"") : std::string(1, c);
        out += '"';
      }
      out += '\n';
    }
  return out;
}

Json benchmarkRows(const BenchmarkReport& report) {
  Json rows = Json::array();
  for (const QuestionResult& question : report.questions)
    for (const BenchmarkRow& row : question.rows) {
      Json object = rowJson(row);
      object["unit_errors_n"] = row.unit_errors_N;
      rows.push_back(std::move(object));
    }
  return rows;
}

Json benchmarkRest(const BenchmarkReport& report) {
  Json questions = Json::array();
  for (const QuestionResult& question : report.questions) {
    const BenchmarkRow* best = question.best();
    Json named = Json::array();
    for (const BenchmarkRow* row : question.named()) named.push_back(row->model);
    questions.push_back({{"held_out", nameOf(question.what)},
                         {"asks", questionOf(question.what)},
                         {"predicts", !predictedIn(question.what).empty()},
                         {"units", question.units},
                         {"best", best != nullptr ? Json(best->model) : Json(nullptr)},
                         {"margin_n", question.margin_N},
                         {"named", named},
                         {"text", question.text}});
  }
  return {{"data",
           {{"name", report.data},
            {"licence", report.licence},
            {"source", report.source},
            {"curves", report.curves},
            {"tissues", report.tissues},
            {"specimens", report.specimens},
            {"needles", report.needles},
            {"speeds", report.speeds}}},
          {"most_numbers", report.max_numbers},
          {"margin", report.margin},
          {"calibration_m", report.calibration_m},
          {"questions", questions},
          {"notes", report.notes},
          {"conclusion", report.conclusion}};
}

BenchmarkPicture benchmarkPicture(const BenchmarkReport& report) {
  BenchmarkPicture picture;
  PlotBlocks data;
  std::vector<std::string> questions;
  std::vector<double> floors_N, bests_N, margins_N;
  std::size_t places = 0;
  for (const QuestionResult& question : report.questions)
    for (const BenchmarkRow& row : question.rows) places = std::max(places, row.place);
  for (std::size_t q = 0; q < report.questions.size(); ++q) {
    const QuestionResult& question = report.questions[q];
    questions.push_back(std::string(nameOf(question.what)));
    floors_N.push_back(-1);
    bests_N.push_back(-1);
    margins_N.push_back(question.margin_N);
    for (const BenchmarkRow& row : question.rows) {
      if (row.kind == ModelKind::kFloor) {
        if (!asksForPhase(question.what)) floors_N.back() = row.error_N;
        continue;
      }
      if (isModel(row.kind) && (bests_N.back() < 0 || row.error_N < bests_N.back()))
        bests_N.back() = row.error_N;
      std::string label = row.model;
      const auto same = std::count_if(question.rows.begin(), question.rows.end(),
                                      [&](const BenchmarkRow& other) { return other.model == row.model; });
      if (same > 1) label += " (" + row.variant.substr(0, row.variant.find_first_of(",:;")) + ")";
      if (row.median_ns) label += fmt::format(", {:.0f} ns", *row.median_ns);
      if (row.energy_given_J) label += fmt::format(", {} µJ", fixedText(*row.energy_given_J * 1e6, 0));
      const double low_N = row.error_low_N.value_or(row.error_N);
      const double high_N = row.error_high_N.value_or(row.error_N);
      const bool gives = row.energy_given_J.value_or(0) > PassivityLimits{}.energy_J;
      data.row(fmt::format("question {}", q),
               {static_cast<double>(places + 1 - row.place), row.error_N, low_N, high_N,
                static_cast<double>(row.kind == ModelKind::kFormula  ? 1
                                    : row.kind == ModelKind::kEngine ? 2
                                                                     : 0),
                gives ? 1.0 : 0.0, row.verdict == BenchmarkVerdict::kNamed ? 1.0 : 0.0},
               {label, fmt::format("{}", row.parameters)});
    }
  }
  picture.data = data.text();
  std::vector<std::string> finding;
  std::string rest = wrapped(report.conclusion, 0, 34 + 34 * questions.size());
  while (!rest.empty()) {
    const std::size_t end = rest.find('\n');
    finding.push_back(rest.substr(0, end));
    rest.erase(0, end == std::string::npos ? rest.size() : end + 1);
  }
  picture.variables = {{"finding", finding},
                       {"set", report.data},
                       {"questions", questions},
                       {"floors", floors_N},
                       {"bests", bests_N},
                       {"margins", margins_N},
                       {"rows", static_cast<double>(places)}};
  return picture;
}

}  // namespace needlelab
