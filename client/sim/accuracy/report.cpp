#include "client/sim/accuracy/report.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/sim/accuracy/study.h"
#include "client/sim/tools/hand_thresholds.h"
#include "common/base/program.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

constexpr std::size_t kWidth = 118;

std::string number(const std::optional<double>& value) {
  if (!value) return "-";
  return std::abs(*value) >= 1000 ? fmt::format("{:.0f}", *value) : fmt::format("{:.3g}", *value);
}

std::string errorCell(const AccuracyRow& row) {
  if (!row.error_N) return "-";
  const MeanInterval& error = *row.error_N;
  if (!std::isfinite(error.high)) return fmt::format("{:.2f} (no interval)", 1e3 * error.mean);
  return fmt::format("{:.2f} ({:.2f}–{:.2f})", 1e3 * error.mean, 1e3 * error.low, 1e3 * error.high);
}

std::string timeCell(const AccuracyRow& row) {
  return row.time ? fmt::format("{:.2f}–{:.2f}", 1e-3 * row.time->p50_ns, 1e-3 * row.time->p999_ns) : "-";
}

std::string rowCell(const AccuracyRow& row) {
  std::string name = row.comparator == Comparator::kValidation ? row.model : nameOf(row);
  if (row.nodes) name += fmt::format(", {:.0f} nodes", *row.nodes);
  if (row.stations) name += fmt::format(", {:.0f} stations", *row.stations);
  if (row.comparator == Comparator::kValidation) {
    const bool engine = std::find(std::begin(kAxialModelNames), std::end(kAxialModelNames), row.model) !=
                        std::end(kAxialModelNames);
    // of a fitted scene's name keep only what distinguishes rows
    if (row.scene.rfind("insertion", 0) != 0)
      name += row.variant.empty() ? "" : ", " + row.variant;
    else if (row.variant.rfind("PUNCTURE", 0) == 0)
      name += ", membranes";
    else if (!engine && !row.line)
      name += " (law only)";
  }
  return row.line ? name + " (baseline)" : name;
}

struct Column {
  const char* title;
  std::string (*cell)(const AccuracyRow&);
};
constexpr std::array<Column, 6> kColumns = {
    {{"model", rowCell},
     {"error [mN] (95 %)", errorCell},
     {"beyond 7 %",
      [](const AccuracyRow& row) {
        return row.beyond ? fmt::format("{:.1f} %", 100 * *row.beyond) : std::string("-");
      }},
     {"tick p50–p99.9 [µs]", timeCell},
     {"instructions", [](const AccuracyRow& row) { return number(row.instructions); }},
     {"K margin", [](const AccuracyRow& row) { return number(row.margin); }}}};

void appendTable(const std::vector<const AccuracyRow*>& rows, std::string& out) {
  std::array<std::size_t, kColumns.size()> widths{};
  for (std::size_t c = 0; c < kColumns.size(); ++c) {
    widths[c] = countCharacters(kColumns[c].title);
    for (const AccuracyRow* row : rows)
      widths[c] = std::max(widths[c], countCharacters(kColumns[c].cell(*row)));
  }
  const auto line = [&](const std::function<std::string(std::size_t)>& cell) {
    std::string text = "  ";
    for (std::size_t c = 0; c < kColumns.size(); ++c) text += padded(cell(c), widths[c]) + "  ";
    out += text.substr(0, text.find_last_not_of(' ') + 1) + "\n";
  };
  line([](std::size_t c) { return std::string(kColumns[c].title); });
  for (const AccuracyRow* row : rows) line([row](std::size_t c) { return kColumns[c].cell(*row); });
}

// Panels of the picture, by position: verification, replay, validation, refinement, cost, FEM.
constexpr int kVerified = 0, kReplayed = 1, kValidated = 2, kRefined = 3, kTimed = 4, kFemTimed = 5;
constexpr std::size_t kPanelWidth = 98, kShownWidth = 116;
constexpr char kCostShows[] =
    "shows tool, gate and engine in the station's loop at 1 kHz, from its own histogram; on the right the\n"
    "instructions of a tick, which repeat exactly";
constexpr char kFemShows[] =
    "shows the tick with a compliance that was made before the lesson; beside the points the mesh's nodes";

std::string beyondCell(const AccuracyRow& row) {
  return row.beyond ? fmt::format("{:.1f} %", 100 * *row.beyond) : std::string();
}

struct PanelRange {
  double x_from = 0, x_to = 0, y_from = 0, y_to = 0;
};

// Rows of the dot panels by name, in order of their first dots.
class Panels {
 public:
  explicit Panels(PlotBlocks& blocks) : blocks_(blocks) {}
  int place(int panel, const std::string& name) {
    auto& names = names_[static_cast<std::size_t>(panel)];
    const auto at = std::find(names.begin(), names.end(), name);
    if (at != names.end()) return static_cast<int>(at - names.begin()) + 1;
    names.push_back(name);
    const auto place = static_cast<int>(names.size());
    blocks_.row(fmt::format("names {};", panel), {static_cast<double>(place)}, {name});
    return place;
  }
  // Logarithmic axis: an interval that reaches 0 starts at a hundredth; without an interval only a point is
  // drawn.
  void dot(int panel, int series, int place, double value, double low, double high,
           const std::string& label) {
    const bool known = std::isfinite(high);
    const double from = known ? std::max(low, 0.01 * value) : value, to = known ? high : value;
    extend(panel, std::max(from, 0.1 * value), to, 1, 1);
    blocks_.row(fmt::format("dots {} {};", panel, series), {value, static_cast<double>(place), from, to},
                {label});
  }
  void dot(int panel, int series, int place, const AccuracyRow& row, const std::string& label) {
    dot(panel, series, place, 1e3 * row.error_N->mean, 1e3 * row.error_N->low, 1e3 * row.error_N->high,
        label);
  }
  void line(int panel, int series, double x, double from, double to) {
    blocks_.row(fmt::format("lines {} {};", panel, series), {x, from, to});
  }
  void point(int panel, std::size_t series, double x, const AccuracyRow& row) {
    const double y = 1e3 * row.error_N->mean, high = 1e3 * row.error_N->high;
    const double low = std::max(1e3 * row.error_N->low, 0.1 * y);
    extend(panel, x, x, low, high);
    blocks_.row(fmt::format("curve {} {};", panel, series), {x, y, low, high},
                {fmt::format("{:.0f}", *row.nodes)});
  }
  // Minima and maxima of x and y; 0 and 0 if nothing was drawn.
  [[nodiscard]] std::vector<double> range(double(PanelRange::*bound)) const {
    std::vector<double> bounds;
    for (const PanelRange& range : ranges_) bounds.push_back(range.*bound);
    return bounds;
  }

 private:
  void extend(int panel, double x_from, double x_to, double y_from, double y_to) {
    PanelRange& range = ranges_[static_cast<std::size_t>(panel)];
    const bool first = range.x_to == 0;
    range = {first ? x_from : std::min(range.x_from, x_from), std::max(range.x_to, x_to),
             first ? y_from : std::min(range.y_from, y_from), std::max(range.y_to, y_to)};
  }
  PlotBlocks& blocks_;
  std::array<std::vector<std::string>, 6> names_;
  std::array<PanelRange, 6> ranges_{};
};

void addVerified(const AccuracyRow& row, Panels& panels) {
  // The first series is the station's. A law that is a mean over insertions has no other.
  constexpr std::array<std::pair<double, double>, 5> kSeries = {
      {{1000, 1e-5}, {250, 1e-5}, {4000, 1e-5}, {1000, 5e-5}, {1000, 1e-6}}};
  const std::pair<double, double> at = {*row.rate_hz, row.encoder_m.value_or(kStationEncoder_m)};
  const auto found = std::find(kSeries.begin(), kSeries.end(), at);
  if (found == kSeries.end()) return;
  const auto series = static_cast<int>(found - kSeries.begin()) + 1;
  panels.dot(kVerified, series, panels.place(kVerified, nameOf(row)), row,
             series == 1 ? beyondCell(row) : "");
}

// The picture's series for a question.
int seriesOf(const AccuracyRow& row) {
  if (row.scene.rfind("hold", 0) == 0) return 3;
  if (row.scene.rfind("withdrawal", 0) == 0) return 4;
  return row.scene.find("beyond") != std::string::npos ? 2 : 1;
}

std::string validatedName(const AccuracyRow& row) {
  const int series = seriesOf(row);
  return series < 3 ? rowCell(row) : fmt::format("{}: {}", series == 3 ? "hold" : "withdrawal", row.variant);
}

void addValidated(const AccuracyRow& row, Panels& panels) {
  if (row.line) return;
  panels.dot(kValidated, seriesOf(row), panels.place(kValidated, validatedName(row)), row, "");
}

// Draws the better baseline of each question along its rows.
void addLines(const AccuracyRows& rows, Panels& panels) {
  for (int series = 1; series <= 4; ++series) {
    double best_N = 0, from = 0, to = 0;
    for (const AccuracyRow& row : rows) {
      if (row.comparator != Comparator::kValidation || !row.error_N || seriesOf(row) != series) continue;
      if (row.line) {
        best_N = best_N > 0 ? std::min(best_N, row.error_N->mean) : row.error_N->mean;
        continue;
      }
      const double place = panels.place(kValidated, validatedName(row));
      from = from > 0 ? std::min(from, place) : place;
      to = std::max(to, place);
    }
    if (best_N > 0 && from > 0) panels.line(kValidated, series, 1e3 * best_N, from - 0.45, to + 0.45);
  }
}

// One curve per number of stations; `stations` gets those with a curve.
void addMeshes(const AccuracyRows& rows, Panels& panels, std::vector<std::string>& stations) {
  for (const int count : kStationCounts) {
    std::string name;
    for (const AccuracyRow& row : rows) {
      if (row.comparator != Comparator::kRefinement || row.stations != static_cast<double>(count)) continue;
      if (name.empty()) {
        name = fmt::format("{} stations", count);
        stations.push_back(name);
      }
      panels.point(kRefined, stations.size(), *row.nodes, row);
      if (row.instructions) panels.point(kFemTimed, stations.size(), *row.instructions, row);
    }
  }
}

// Each model once, with the tick time common to its rows.
void addTimes(const AccuracyRows& rows, Panels& panels) {
  std::vector<std::string> seen;
  for (const AccuracyRow& row : rows) {
    if (!row.time || row.line || row.comparator == Comparator::kValidation) continue;
    const std::string name =
        row.stations ? fmt::format("{}, {:.0f} stations", row.model, *row.stations) : nameOf(row);
    if (std::find(seen.begin(), seen.end(), name) != seen.end()) continue;
    seen.push_back(name);
    panels.dot(kTimed, 1, panels.place(kTimed, name), 1e-3 * row.time->p50_ns, 1e-3 * row.time->p50_ns,
               1e-3 * row.time->p999_ns, row.instructions ? number(row.instructions) : "");
  }
}

}  // namespace

std::string accuracyTable(const AccuracyRows& rows) {
  std::string out;
  for (std::size_t c = 0; c < kComparatorCount; ++c) {
    const auto comparator = static_cast<Comparator>(c);
    std::vector<std::string> scenes;
    for (const AccuracyRow& row : rows)
      if (row.comparator == comparator && std::find(scenes.begin(), scenes.end(), row.scene) == scenes.end())
        scenes.push_back(row.scene);
    if (scenes.empty()) continue;
    const ComparatorText& text = textOf(comparator);
    out += std::string(text.title) + "\n" + wrapped("shows " + std::string(text.shows), 2, kWidth);
    for (const std::string& scene : scenes) {
      std::vector<const AccuracyRow*> shown;
      for (const AccuracyRow& row : rows)
        if (row.comparator == comparator && row.scene == scene && isMain(row)) shown.push_back(&row);
      if (shown.empty()) continue;
      out += "\n" + wrapped(scene + "; against " + shown.front()->against, 2, kWidth);
      appendTable(shown, out);
      out += wrapped("cannot show: " + shown.front()->cannot_show, 2, kWidth);
    }
    out += "\n" + wrapped("→ " + sentenceOf(comparator, rows), 2, kWidth) + "\n";
  }
  if (!rows.empty())
    out += wrapped(
        fmt::format(
            "beyond 7 %: share of ticks (of a curve: of bins) whose error is more than 7 % of the local "
            "force, and more than the {:.1f} mN that a hand notices beside little force. Tick: tool, "
            "gate and engine in the station's loop at 1 kHz. K margin: stiffness that the device's own "
            "damping makes passive, over the model's. Intervals are Student's over gestures, halves of "
            "a curve or hands; of FEM what the finest mesh itself may miss.",
            1e3 * kNoticeableStep_N),
        0, kWidth);
  return out;
}

std::string accuracyCsv(const AccuracyRows& rows) {
  std::string out;
  const auto names = jsonOf(AccuracyRow{});
  for (const auto& item : names.items()) out += (out.empty() ? "" : ",") + item.key();
  out += "\n";
  for (const AccuracyRow& row : rows) {
    std::string line;
    const auto json = jsonOf(row);
    for (const auto& item : json.items()) {
      if (!line.empty() || item.key() != "comparator") line += ",";
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

AccuracyPicture accuracyPicture(const AccuracyRows& rows) {
  PlotBlocks blocks;
  Panels panels(blocks);
  for (const AccuracyRow& row : rows) {
    if (!row.error_N) continue;
    switch (row.comparator) {
      case Comparator::kVerification:
        addVerified(row, panels);
        break;
      case Comparator::kReplay:
        panels.dot(kReplayed, 1, panels.place(kReplayed, rowCell(row)), row, beyondCell(row));
        break;
      case Comparator::kValidation:
        addValidated(row, panels);
        break;
      case Comparator::kRefinement:
        break;
    }
  }
  std::vector<std::string> stations;
  addMeshes(rows, panels, stations);
  if (stations.empty()) stations.emplace_back();  // gnuplot does not support empty arrays
  addLines(rows, panels);
  addTimes(rows, panels);
  const auto shown = [](Comparator comparator) {
    return wrapped("shows " + std::string(textOf(comparator).shows), 0, kShownWidth);
  };
  const auto said = [](const std::string& sentence) { return wrapped(sentence, 0, kPanelWidth); };
  const auto title = [](Comparator comparator) { return std::string(textOf(comparator).title); };
  using C = Comparator;
  return {
      blocks.text(),
      {{"titles",
        std::vector<std::string>{title(C::kVerification), title(C::kReplay), title(C::kValidation),
                                 title(C::kRefinement), "Cost: what a tick takes of the station's time",
                                 "Cost: FEM's error over what its tick takes"}},
       {"shows", std::vector<std::string>{shown(C::kVerification), shown(C::kReplay), shown(C::kValidation),
                                          shown(C::kRefinement), kCostShows, kFemShows}},
       {"sentences",
        std::vector<std::string>{said(sentenceOf(C::kVerification, rows)), said(sentenceOf(C::kReplay, rows)),
                                 said(sentenceOf(C::kValidation, rows)),
                                 said(sentenceOf(C::kRefinement, rows)), said(costSentence(rows)),
                                 said(femSentence(rows))}},
       {"stations", stations},
       {"x_from", panels.range(&PanelRange::x_from)},
       {"x_to", panels.range(&PanelRange::x_to)},
       {"y_from", panels.range(&PanelRange::y_from)},
       {"y_to", panels.range(&PanelRange::y_to)}}};
}

}  // namespace needlelab
