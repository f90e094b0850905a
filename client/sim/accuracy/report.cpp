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

constexpr std::size_t kWidth = 118, kPanelWidth = 76;

std::string number(const std::optional<double>& value) {
  if (!value) return "-";
  return std::abs(*value) >= 1000 ? fmt::format("{:.0f}", *value) : fmt::format("{:.3g}", *value);
}

std::string errorCell(const AccuracyRow& row) {
  if (!row.error_N) return "-";
  const MeanInterval& error = *row.error_N;
  const std::string mean = fmt::format("{:.2f}", 1e3 * error.mean);
  if (!std::isfinite(error.high)) return mean;
  return mean + fmt::format(" ({:.2f}–{:.2f})", 1e3 * error.low, 1e3 * error.high);
}

std::string greatestCell(const AccuracyRow& row) {
  if (!row.greatest_N) return "-";
  return fmt::format("{:.0f}", 1e3 * *row.greatest_N) +
         (row.greatest_at.empty() ? "" : " (" + row.greatest_at + ")");
}

std::string timeCell(const AccuracyRow& row) {
  if (!row.time) return "-";
  return fmt::format("{:.2f} ({:.2f}–{:.2f})", 1e-3 * row.time->p50_ns, 1e-3 * row.time->low_ns,
                     1e-3 * row.time->high_ns);
}

std::string rowCell(const AccuracyRow& row) {
  std::string name = nameOf(row);
  if (row.nodes) name += fmt::format(", {:.0f} nodes", *row.nodes);
  if (row.stations) name += fmt::format(", {:.0f} stations", *row.stations);
  return name;
}

struct Column {
  const char* title;
  std::string (*cell)(const AccuracyRow&);
};
constexpr std::array<Column, 9> kColumns = {
    {{"model", rowCell},
     {"error [mN]", errorCell},
     {"greatest [mN]", greatestCell},
     {"jump late [ms]",
      [](const AccuracyRow& row) {
        return row.delay_s ? fmt::format("{:.2f}", 1e3 * *row.delay_s) : std::string("-");
      }},
     {"beyond 7 %",
      [](const AccuracyRow& row) {
        return row.beyond ? fmt::format("{:.1f} %", 100 * *row.beyond) : std::string("-");
      }},
     {"before [s]",
      [](const AccuracyRow& row) {
        return row.prepare_s ? fmt::format("{:.2f}", *row.prepare_s) : std::string("-");
      }},
     {"tick [µs]", timeCell},
     {"instructions", [](const AccuracyRow& row) { return number(row.instructions); }},
     {"K margin", [](const AccuracyRow& row) { return number(row.margin); }}}};

// Without the columns that no row has.
void appendTable(const std::vector<const AccuracyRow*>& rows, std::string& out) {
  std::array<std::size_t, kColumns.size()> widths{};
  for (std::size_t c = 0; c < kColumns.size(); ++c)
    for (const AccuracyRow* row : rows)
      if (const std::string cell = kColumns[c].cell(*row); cell != "-")
        widths[c] = std::max({widths[c], countCharacters(cell), countCharacters(kColumns[c].title)});
  const auto line = [&](const std::function<std::string(std::size_t)>& cell) {
    std::string text = "  ";
    for (std::size_t c = 0; c < kColumns.size(); ++c)
      if (widths[c] > 0) text += padded(cell(c), widths[c]) + "  ";
    out += text.substr(0, text.find_last_not_of(' ') + 1) + "\n";
  };
  line([](std::size_t c) { return std::string(kColumns[c].title); });
  for (const AccuracyRow* row : rows) line([row](std::size_t c) { return kColumns[c].cell(*row); });
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
    const std::string sentence = sentenceOf(comparator, rows);
    out += (sentence.empty() ? "" : "\n" + wrapped("→ " + sentence, 2, kWidth)) + "\n";
  }
  if (!rows.empty())
    out += wrapped(
        fmt::format(
            "Error: rms; in brackets its 95 % interval, Student's over gestures or hands. "
            "Beyond 7 %: share of ticks whose error is more than 7 % of the local force, "
            "and more than the {:.1f} mN that a hand notices beside little force. Before: the preparation, "
            "before the lesson. Tick: tool, gate and engine in the station's loop at 1 kHz, the median; in "
            "brackets its range over three rounds. Models whose ranges overlap are not told apart: they have "
            "one median. K margin: stiffness that the device's own damping makes passive, over the model's.",
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

std::vector<PlotVariable> accuracyPicture(const AccuracyRows& rows) {
  std::vector<std::string> laws, stations;
  for (const AccuracyRow& row : rows) {
    if (row.comparator == Comparator::kVerification && row.encoder_m && isMain(row))
      laws.push_back(nameOf(row));
    if (row.comparator != Comparator::kRefinement) continue;
    const std::string key =
        fmt::format("{:.0f} stations", *row.stations) +
        (row.time ? fmt::format(", {:.2g} µs a tick", 1e-3 * row.time->p50_ns) : "") +
        (row.instructions ? fmt::format(" ({:.0f} instructions)", *row.instructions) : "");
    if (std::find(stations.begin(), stations.end(), key) == stations.end()) stations.push_back(key);
  }
  // gnuplot has no empty arrays
  if (laws.empty()) laws.emplace_back();
  if (stations.empty()) stations.emplace_back();
  const auto said = [&](Comparator comparator) {
    return wrapped(sentenceOf(comparator, rows), 0, kPanelWidth);
  };
  return {{"laws", laws},
          {"stations", stations},
          {"encoder_m", kStationEncoder_m},
          {"noticed_mN", 1e3 * kNoticeableStep_N},
          {"sentences",
           std::vector<std::string>{said(Comparator::kVerification), said(Comparator::kRefinement)}}};
}

}  // namespace needlelab
