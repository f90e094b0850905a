#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "client/sim/stability/case.h"
#include "client/sim/tools/hand_thresholds.h"
#include "client/sim/tools/small_sample.h"
#include "common/base/text/text.h"
#include "common/haptics/axial_entry.h"

namespace needlelab {

std::string_view verdictText(Verdict verdict) {
  constexpr std::array<std::string_view, 4> kTexts = {"stable", "chatters", "diverges", ""};
  return kTexts[static_cast<std::size_t>(verdict)];
}

std::optional<bool> stepIsNoticeable(const CaseRow& row) {
  if (!row.max_unexplained_step_N) return std::nullopt;
  return *row.max_unexplained_step_N > kNoticeableStep_N;
}

std::vector<AxialModel> modelsOf(const std::vector<CaseRow>& rows) {
  std::vector<AxialModel> models;
  for (const CaseRow& row : rows)
    if (std::find(models.begin(), models.end(), row.model) == models.end()) models.push_back(row.model);
  return models;
}

namespace {

constexpr double kShownAsZero = 1e-9;  // rounding errors, in any unit of a row
constexpr AxialModel kWall = AxialModel::kEnhancedTrackingWall;
constexpr std::size_t kName = 24, kColumn = 15;

template <typename T>
nlohmann::ordered_json orNull(const std::optional<T>& value) {
  return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
}
nlohmann::ordered_json countOf(const CaseRow& row, std::size_t NeighbourCount::*which) {
  return row.neighbours ? nlohmann::ordered_json((*row.neighbours).*which) : nlohmann::ordered_json(nullptr);
}
template <typename T>
nlohmann::ordered_json ifJudged(const CaseRow& row, const T& value) {
  return row.applicable ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

std::string column(const std::string& text, std::size_t width) {
  return padded(text + " ", width);
}

std::string cell(const CaseRow* row) {
  if (row == nullptr || !row->applicable) return "";
  const char* mark = row->verdict == Verdict::kChatters   ? " ~"
                     : row->verdict == Verdict::kDiverges ? " !"
                                                          : "";
  return (row->neighbours ? neighboursText(*row->neighbours) : shortNumber(row->measured)) + mark;
}

// The wall's notes, another model's notes if the wall has none, and the reasons of failures.
bool worthReading(const std::vector<CaseRow>& rows, const CaseRow& row) {
  const CaseRow* wall = rowOf(rows, row.case_name, kWall);
  return wall == nullptr || wall == &row || wall->note.empty() || !row.passed;
}

// One line per case for which `cells` returns text.
template <typename Cells>
std::string perCase(const std::vector<CaseRow>& rows, const std::string& title, Cells&& cells) {
  std::string text;
  for (const std::string& name : caseNames(rows))
    if (const std::string line = cells(name); !line.empty()) text += "  " + column(name, kName) + line + "\n";
  return text.empty() ? text : title + text;
}

// Coupled stability and passivity of the wall's closed loops, separately.
std::string marginsText(const std::vector<CaseRow>& rows) {
  return perCase(rows,
                 "\nWhat theory allows over the wall's stiffness: with the case's hand (coupled stability); "
                 "with the device's own damping alone (passivity: below 1 the loop is not passive); energy "
                 "got at the grip [J]\n",
                 [&](const std::string& name) -> std::string {
                   const CaseRow* row = rowOf(rows, name, kWall);
                   if (row == nullptr || !row->passive_margin || !row->coupled_margin) return {};
                   const char* mark = *row->passive_margin < 1 ? " not" : "";
                   return column(shortNumber(row->coupled_margin), kColumn) +
                          column(shortNumber(row->passive_margin) + mark, kColumn) +
                          shortNumber(row->grip_energy_J);
                 });
}

std::string noticeableSteps(const std::vector<CaseRow>& rows) {
  return perCase(
      rows,
      fmt::format("\nForce steps that no spring explains and that a hand may notice (above {:g} N) [N]\n",
                  kNoticeableStep_N),
      [&](const std::string& name) {
        std::string models;
        for (const CaseRow& row : rows)
          if (row.case_name == name && row.applicable && stepIsNoticeable(row).value_or(false))
            models += fmt::format("{}{} {}", models.empty() ? "" : ", ", shortName(row.model),
                                  shortNumber(row.max_unexplained_step_N));
        return models;
      });
}

}  // namespace

std::string_view shortName(AxialModel model) {
  return axialEntry(model).short_name;
}

std::string shortNumber(std::optional<double> value) {
  if (!value) return "-";
  if (std::abs(*value) < kShownAsZero) return "0";
  return fmt::format("{:.3g}", *value);
}

std::string neighboursText(const NeighbourCount& count) {
  const ShareInterval interval = wilsonInterval(count.share(), count.all);
  return fmt::format("{:.0f} % {:.0f}-{:.0f}", 100 * count.share(), 100 * interval.low, 100 * interval.high);
}

std::string limitText(const CaseRow& row) {
  return row.neighbours && row.limit ? fmt::format("{:.0f} %", 100 * (1 - *row.limit))
                                     : shortNumber(row.limit);
}

std::vector<std::string> caseNames(const std::vector<CaseRow>& rows) {
  std::vector<std::string> names;
  for (const CaseRow& row : rows)
    if (std::find(names.begin(), names.end(), row.case_name) == names.end()) names.push_back(row.case_name);
  return names;
}

const CaseRow* rowOf(const std::vector<CaseRow>& rows, const std::string& case_name, AxialModel model) {
  const auto found = std::find_if(rows.begin(), rows.end(), [&](const CaseRow& row) {
    return row.case_name == case_name && row.model == model;
  });
  return found == rows.end() ? nullptr : &*found;
}

std::string findingOf(const std::vector<CaseRow>& rows) {
  int wall_cases = 0, wall_stable = 0, judged = 0;
  struct Count {
    AxialModel model;
    int bad = 0, all = 0;
  };
  std::vector<Count> others;
  for (const AxialModel model : modelsOf(rows)) {
    Count count{model};
    for (const CaseRow& row : rows) {
      if (row.model != model || !row.applicable) continue;
      ++count.all;
      if (row.verdict != Verdict::kStable) ++count.bad;
    }
    judged += count.all;
    if (model == kWall)
      wall_cases = count.all, wall_stable = count.all - count.bad;
    else if (count.bad > 0)
      others.push_back(count);
  }
  std::stable_sort(others.begin(), others.end(),
                   [](const Count& a, const Count& b) { return a.bad > b.bad; });
  std::string text;
  if (wall_cases > 0)
    text =
        fmt::format("The enhanced tracking wall is stable in {} of {} hard cases", wall_stable, wall_cases);
  if (judged == 0) return "Nothing was judged: these cases say nothing about these models";
  if (others.empty()) return text.empty() ? "All that was asked for is stable" : text;
  text += text.empty() ? "Not stable: " : "; not stable: ";
  for (std::size_t i = 0; i < std::min<std::size_t>(3, others.size()); ++i)
    text += fmt::format("{}{} in {} of {}", i > 0 ? ", " : "", shortName(others[i].model), others[i].bad,
                        others[i].all);
  if (others.size() > 3)
    text += fmt::format(", and {}{} in at most {}", others.size() - 3,
                        others.size() > 4 ? " others" : " other", others[3].bad);
  return text;
}

nlohmann::ordered_json rowsJson(const std::vector<CaseRow>& rows) {
  auto list = nlohmann::ordered_json::array();
  for (const CaseRow& row : rows)
    list.push_back({{"case", row.case_name},
                    {"model", axialModelName(row.model)},
                    {"applicable", row.applicable},
                    {"finite", ifJudged(row, row.finite)},
                    {"max_force_n", orNull(row.max_force_N)},
                    {"max_unexplained_step_n", orNull(row.max_unexplained_step_N)},
                    {"chatter_n", orNull(row.chatter_N)},
                    {"step_noticeable", orNull(stepIsNoticeable(row))},
                    {"energy_j", orNull(row.energy_J)},
                    {"coupled_margin", orNull(row.coupled_margin)},
                    {"passive_margin", orNull(row.passive_margin)},
                    {"grip_energy_j", orNull(row.grip_energy_J)},
                    {"controlled_energy_j", orNull(row.controlled_energy_J)},
                    {"distortion_n", orNull(row.distortion_N)},
                    {"second_energy_j", orNull(row.second_energy_J)},
                    {"hold_swing_n", orNull(row.hold_swing_N)},
                    {"neighbours", countOf(row, &NeighbourCount::all)},
                    {"neighbours_stable", countOf(row, &NeighbourCount::stable)},
                    {"measured", orNull(row.measured)},
                    {"limit", orNull(row.limit)},
                    {"passed", ifJudged(row, row.passed)},
                    {"verdict", ifJudged(row, verdictText(row.verdict))},
                    {"quantity", row.quantity},
                    {"note", row.note}});
  return list;
}

std::string rowsText(const std::vector<CaseRow>& rows) {
  const auto models = modelsOf(rows);
  std::string text = column("", kName) + column("limit", kColumn);
  for (const AxialModel model : models) text += column(std::string(shortName(model)), kColumn);
  text += "measured\n";
  for (const std::string& name : caseNames(rows)) {
    std::string limit = "-", line, quantity;
    for (const AxialModel model : models) {
      const CaseRow* row = rowOf(rows, name, model);
      line += column(cell(row), kColumn);
      if (row == nullptr || !row->applicable) continue;
      if (limit == "-") limit = limitText(*row);
      if (quantity.empty()) quantity = row->quantity;
    }
    text += column(name, kName) + column(limit, kColumn) + line + quantity + "\n";
  }
  text +=
      "no mark: stable; ~ chatters: bounded, but over the limit (or its second condition, see below); ! "
      "diverges: grows, or only the gate holds it\n";
  std::string notes;
  for (const CaseRow& row : rows)
    if (row.applicable && !row.note.empty() && worthReading(rows, row))
      notes += "  " + column(row.case_name, kName) + column(std::string(shortName(row.model)), kColumn) +
               row.note + "\n";
  if (!notes.empty()) text += "\nNotes\n" + notes;
  return text + marginsText(rows) + noticeableSteps(rows) + "\n" + findingOf(rows) + ".\n";
}

}  // namespace needlelab
